"""The method `confidence` against brute force in NumPy and SciPy, and what no rotation, scale or order may change."""

import json
import re
from pathlib import Path

import confidence_oracle
import numpy as np
import pytest
import scipy.sparse as sp
import skinwright_native as native
from glb import data_folder, joined, read_meshes

SMALL = ["qm_women/Formal/Formal_Legs", "qm_men/Suit/Suit_Legs", "qm_women/Soldier/Soldier_Legs"]


def real_case(name):
    """Body and garment of the data folder as (positions, triangles, weights) and (positions, triangles), float64."""
    folder = data_folder()
    entry = next(entry for entry in json.loads((folder / "cases.json").read_text()) if entry["id"] == name)
    body = joined(read_meshes(folder / entry["body"]))
    meshes = read_meshes(folder / entry["garment"])
    garment = next(mesh for mesh in meshes if mesh.name == entry.get("mesh", mesh.name))
    source = (body.positions.astype(float), body.triangles, body.weights.tocsr())
    return source, (garment.positions.astype(float), garment.triangles)


def native_source(positions, triangles, weights):
    weights = sp.csr_matrix(weights)
    weights.sort_indices()
    return native.Source(
        positions, triangles, native.Weights(weights.indptr, weights.indices, weights.data, weights.shape[1])
    )


def tubes(seed=0):
    """Two limbs side by side as source and a wavy sleeve over both as target: gaps, tilts, ties, every kind of edge."""
    rng = np.random.default_rng(seed)

    def tube(centre, radius, rings, sides):
        u, v = np.meshgrid(np.linspace(0, 1, rings), np.arange(sides) / sides * 2 * np.pi, indexing="ij")
        around = np.stack([radius * np.cos(v) + centre, radius * np.sin(v), u], axis=-1).reshape(-1, 3)
        i, j = np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij")
        a, b = (i * sides + j).ravel(), (i * sides + (j + 1) % sides).ravel()
        return around, np.vstack([np.stack([a, b, a + sides], 1), np.stack([b, b + sides, a + sides], 1)])

    left, faces = tube(-0.12, 0.08, 16, 14)
    right, _ = tube(0.12, 0.08, 16, 14)
    source = np.vstack([left, right]), np.vstack([faces, faces + len(left)])
    height = np.clip(source[0][:, 2], 0, 1)
    side = (source[0][:, 0] > 0).astype(float)
    weights = np.stack([(1 - side) * (1 - height), side * (1 - height), (1 - side) * height, side * height], axis=1)
    cloth, cloth_faces = tube(0.0, 0.26, 14, 26)
    cloth[:, 1] *= 0.45
    cloth += rng.normal(0, 0.004, cloth.shape)
    as_f32 = lambda x: x.astype(np.float32).astype(float)  # noqa: E731
    return (as_f32(source[0]), source[1], sp.csr_matrix(weights)), (as_f32(cloth), cloth_faces)


def dense(transfer):
    return transfer.weights.to_dense()


@pytest.mark.parametrize("name", ["tubes", *SMALL])
def test_raw_weights_equal_brute_force(name):
    source, target = tubes() if name == "tubes" else real_case(name)
    prepared = native.Inpainting(native_source(*source), *target, method="confidence")
    expected = confidence_oracle.transfer(source, target)
    vertices, raw = prepared.raw_weights(method="confidence")
    assert len(vertices) > 0.1 * len(target[0])
    np.testing.assert_allclose(raw, expected[vertices], atol=2e-5)
    answer = dense(prepared.solve(method="confidence", small_islands="solved"))
    clamped = np.clip(expected, 0, None)
    np.testing.assert_allclose(answer, clamped / clamped.sum(axis=1, keepdims=True), atol=2e-5)


@pytest.mark.parametrize(
    ("length", "expected"),
    [(0.0, (0.97173357, 0.02468831, 0.50545754, 0.31205834)), (1.0, (0.99807357, 0.00150002, 0.50051188, 0.06838752))],
)
def test_soft_rows_of_a_square(length, expected):
    """Two triangles, four soft rows: worked out by hand."""
    positions = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], float)
    rows, h = np.array([(1, 0), (0, 1), (0.5, 0.5), (0.5, 0.5)]), np.array([0.1, 0.1, 0.1, 1.0])
    confidence = 0.25 * (1 / h**2 + length**2 / h**4)
    found = native.fill(positions, [(0, 1, 2), (1, 3, 2)], [2] * 4, rows, confidence=confidence, length=length)
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-8)
    np.testing.assert_allclose(found.sum(axis=1), 1, atol=1e-12)


def test_split_seams_change_nothing():
    """Every triangle has corners of its own, as in a file with hard edges: vertices that are one get the same bits."""
    source, (cloth, faces) = tubes()
    whole = dense(native_source(*source).transfer(cloth, faces, method="confidence"))
    split = np.arange(faces.size).reshape(-1, 3)
    found = dense(native_source(*source).transfer(cloth[faces.ravel()], split, method="confidence"))
    np.testing.assert_allclose(found, whole[faces.ravel()], atol=1e-6)


def test_softness_is_the_oracles():
    source, target = tubes()
    prepared = native.Inpainting(native_source(*source), *target, method="confidence")
    for softness in (0.35, 1.4):
        vertices, raw = prepared.raw_weights(method="confidence", softness=softness)
        expected = confidence_oracle.transfer(source, target, softness)
        np.testing.assert_allclose(raw, expected[vertices], atol=2e-5)


def test_confidence_is_that_of_the_lengths():
    source, target = tubes()
    prepared = native.Inpainting(native_source(*source), *target, method="confidence")
    extent = confidence_oracle.size(*source[:2])
    h = confidence_oracle.lengths(confidence_oracle.trusted(source, target), extent)
    expected = 1 / (1 + (h / (0.02 * extent)) ** 2)
    found = prepared.confidence(method="confidence")
    np.testing.assert_allclose(found, expected, rtol=1e-4)
    assert np.array_equal(prepared.matched(method="confidence"), found >= 0.5)
    assert np.array_equal(prepared.confidence(method="paper"), prepared.matched(method="paper"))


def test_a_body_onto_itself_is_the_identity():
    (positions, triangles, weights), _ = tubes()
    answer = native_source(positions, triangles, weights).transfer(positions, triangles, method="confidence")
    np.testing.assert_allclose(dense(answer), weights.toarray(), atol=1e-6)


@pytest.mark.parametrize("scale", [0.01, 100.0])
def test_scale_and_rotation_change_nothing(scale):
    source, target = tubes()
    before = dense(native_source(*source).transfer(*target, method="confidence"))
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    move = lambda positions: scale * positions @ turn.T + scale  # noqa: E731
    moved = native_source(move(source[0]), *source[1:])
    after = dense(moved.transfer(move(target[0]), target[1], method="confidence"))
    difference = np.abs(after - before).max(axis=1)
    # f32 positions are rounded otherwise once turned; a near tie may then be another's.
    assert np.percentile(difference, 99) < 1e-4
    assert difference.max() < 5e-3


def test_order_and_threads_change_nothing():
    source, target = tubes()
    prepared = native_source(*source)
    before = prepared.transfer(*target, method="confidence", threads=1)
    again = prepared.transfer(*target, method="confidence", threads=3)
    assert np.array_equal(dense(before), dense(again))
    order = np.random.default_rng(2).permutation(len(target[0]))
    place = np.argsort(order)
    shuffled = prepared.transfer(target[0][order], place[target[1]], method="confidence")
    np.testing.assert_allclose(dense(shuffled), dense(before)[order], atol=1e-6)


def test_a_symmetric_garment_gets_symmetric_rows():
    """Vertices in the middle are equally near to both limbs, and take from both alike."""
    (positions, triangles, weights), _ = tubes()
    half, weights = len(positions) // 2, weights.toarray()
    right = positions[half:]
    positions = np.vstack([right * (-1, 1, 1), right])
    faces = triangles[len(triangles) // 2 :] - half
    triangles = np.vstack([faces[:, ::-1], faces + half])
    weights[:half] = weights[half:][:, [1, 0, 3, 2]]
    x, z = np.meshgrid(np.linspace(-0.25, 0.25, 17), np.linspace(0, 1, 9), indexing="ij")
    cloth = np.round(np.stack([x, np.full(x.shape, -0.125), z], axis=-1).reshape(-1, 3) * 4096) / 4096
    i, j = np.meshgrid(np.arange(16), np.arange(8), indexing="ij")
    a = (9 * i + j).ravel()
    left = (i < 8).ravel()[:, None]
    first = np.where(left, np.stack([a, a + 9, a + 1], 1), np.stack([a, a + 9, a + 10], 1))
    second = np.where(left, np.stack([a + 9, a + 10, a + 1], 1), np.stack([a, a + 10, a + 1], 1))
    mirror = (16 - np.arange(17))[:, None] * 9 + np.arange(9)
    found = dense(
        native_source(positions, triangles, weights).transfer(cloth, np.vstack([first, second]), method="confidence")
    )
    difference = np.abs(found[mirror.ravel()][:, [1, 0, 3, 2]] - found).max(axis=1)
    assert difference.max() < 1e-4
    middle = found.reshape(17, 9, 4)[8]
    np.testing.assert_allclose(middle[:, :2].sum(axis=1) + middle[:, 2:].sum(axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(middle[:, 0] + middle[:, 2], 0.5, atol=1e-4)


@pytest.mark.parametrize("method", ["paper", "confidence"])
@pytest.mark.parametrize("policy", ["bridge", "nearest", "rigid", "skip"])
def test_every_policy_with_both_methods(method, policy):
    source, (cloth, faces) = tubes()
    away = np.array([[0, 0, 3], [0.1, 0, 3], [0, 0.1, 3], [0.1, 0.1, 3.05]])
    positions = np.vstack([cloth, away])
    triangles = np.vstack([faces, len(cloth) + np.array([[0, 1, 2], [1, 3, 2]])])
    answer = native_source(*source).transfer(
        positions, triangles, method=method, island_policy=policy, relative_max_distance=0.05
    )
    assert [island["policy"] for island in answer.report["unmatched_islands"]] == [policy]
    sums = dense(answer).sum(axis=1)
    np.testing.assert_allclose(sums[: len(cloth)], 1, atol=1e-6)
    np.testing.assert_allclose(sums[len(cloth) :], 0 if policy == "skip" else 1, atol=1e-6)


def test_the_mask_decides():
    source, (cloth, faces) = tubes()
    prepared = native.Inpainting(native_source(*source), cloth, faces, method="confidence")
    free = dense(prepared.solve(method="confidence"))
    mask = np.ones(len(cloth), np.uint8)
    forced, inpainted = 200, np.arange(40, 60)
    mask[forced], mask[inpainted] = 2, 0
    steered = dense(prepared.solve(method="confidence", mask=mask))
    np.testing.assert_allclose(steered[forced], closest_row(source, cloth[forced]), atol=1e-6)
    assert np.abs(steered[inpainted] - free[inpainted]).max() > 0.01
    confidence = prepared.confidence(method="confidence", mask=mask)
    assert confidence[forced] == 1
    assert (confidence[inpainted] == 0).all()


def closest_row(source, point):
    """Row of the plain closest point."""
    positions, triangles, weights = source
    shares = confidence_oracle.closest_on_triangles(point, positions[triangles])
    on = np.einsum("tk,tki->ti", shares, positions[triangles])
    nearest = np.linalg.norm(on - point, axis=1).argmin()
    return shares[nearest] @ weights.toarray()[triangles[nearest]]


def small_part(source, gap):
    """A little plate over the middle of the left limb's outside, bent so that its rows differ a little."""
    u, v = np.meshgrid(np.linspace(-0.03, 0.03, 4), np.linspace(0.45, 0.52, 4), indexing="ij")
    outside = -0.12 - np.sqrt(0.08**2 - u**2)
    plate = np.stack([outside - gap, u, v], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(3), np.arange(3), indexing="ij")
    a = (4 * i + j).ravel()
    return plate, np.vstack([np.stack([a, a + 1, a + 4], 1), np.stack([a + 1, a + 5, a + 4], 1)])


@pytest.mark.parametrize("method", ["paper", "confidence"])
def test_small_loose_parts_become_rigid(method):
    source, _ = tubes()
    prepared = native_source(*source)
    loose, on_skin = small_part(source, 0.02), small_part(source, 0.0)
    settings = {"method": method, "relative_max_distance": 1.0, "max_normal_angle": 3.14}
    rows = lambda part, choice: dense(prepared.transfer(*part, small_islands=choice, **settings))  # noqa: E731
    assert np.ptp(rows(loose, "rigid"), axis=0).max() < 1e-6
    assert np.ptp(rows(loose, "solved"), axis=0).max() > 0.01
    assert np.ptp(rows(on_skin, "rigid"), axis=0).max() > 0.01
    by_itself = np.ptp(rows(loose, "auto"), axis=0).max()
    assert (by_itself < 1e-6) == (method == "confidence")


def test_a_garment_far_away_still_gets_rows():
    """There is no threshold that could leave all of it without any."""
    source, (cloth, faces) = tubes()
    answer = native_source(*source).transfer(cloth + np.array([0, 3, 0]), faces, method="confidence")
    assert answer.report["unmatched_islands"] == []
    np.testing.assert_allclose(dense(answer).sum(axis=1), 1, atol=1e-6)


@pytest.mark.parametrize(
    ("setting", "literal"),
    [("method", "MatchMethod"), ("small_islands", "SmallIslands"), ("island_policy", "IslandPolicy")],
)
def test_the_stub_names_every_variant(setting, literal):
    """The refusal lists the core's variants."""
    stub = Path(__file__).resolve().parents[2] / "rust" / "native" / "skinwright_native.pyi"
    (listed,) = re.findall(rf"^{literal} = Literal\[(.*)\]$", stub.read_text(), re.MULTILINE)
    source, target = tubes()
    with pytest.raises(native.SkinwrightError) as refused:
        native_source(*source).transfer(*target, **{setting: "none of them"})
    assert str(refused.value).endswith("must be one of " + listed.replace('"', ""))


def test_unknown_names_are_refused():
    source, target = tubes()
    prepared = native_source(*source)
    with pytest.raises(native.SkinwrightError, match='method is "nearest", but must be one of paper, confidence'):
        prepared.transfer(*target, method="nearest")
    with pytest.raises(native.SkinwrightError, match="softness"):
        prepared.transfer(*target, method="confidence", softness=0.0)
