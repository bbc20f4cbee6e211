"""Desparsification against brute force: plain loops, and one Dijkstra search a bone by SciPy."""

import glb
import numpy as np
import pytest
import scipy.sparse as sp
import skinwright_native as native
from scipy.sparse.csgraph import dijkstra


def hops(parents: np.ndarray) -> np.ndarray:
    """(B, B) edges between bones of the hierarchy, infinite between trees."""
    bones = len(parents)
    child = np.flatnonzero(parents >= 0)
    tree = sp.coo_matrix((np.ones(len(child)), (child, parents[child])), shape=(bones, bones))
    return dijkstra(tree, directed=False, unweighted=True)


def hop_order(rows: np.ndarray, parents: np.ndarray) -> list[np.ndarray]:
    """For each vertex all bones, best score first."""
    proximity = 0.5 ** hops(parents)
    order = []
    for row in rows:
        score = np.zeros(len(parents))
        for bone in np.flatnonzero(row):
            score += row[bone] * proximity[bone]
        order.append(np.argsort(-score, kind="stable"))
    return order


def surface_order(rows: np.ndarray, positions: np.ndarray, triangles: np.ndarray, segments: np.ndarray) -> list:
    """For each vertex all bones, nearest region first, then nearest segment."""
    positions = positions.astype(float)
    edges = np.unique(np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    edges = edges[edges[:, 0] != edges[:, 1]]
    squares = (positions[edges[:, 0]] - positions[edges[:, 1]]) ** 2
    lengths = np.sqrt(squares[:, 0] + squares[:, 1] + squares[:, 2])
    mesh = sp.coo_matrix((lengths, edges.T.astype(np.int32)), shape=(len(positions),) * 2).tocsr()
    distance = np.full(rows.shape, np.inf)
    for bone in range(rows.shape[1]):
        region = np.flatnonzero(rows[:, bone])
        if len(region):
            distance[:, bone] = dijkstra(mesh, directed=False, indices=region, min_only=True)
    heads, along = segments[:, 0].astype(float), (segments[:, 1] - segments[:, 0]).astype(float)
    to_head = positions[:, None] - heads
    share = np.clip((to_head * along).sum(-1) / np.maximum((along**2).sum(-1), 1e-300), 0, 1)
    to_bone = np.linalg.norm(to_head - share[..., None] * along, axis=-1)
    return [np.lexsort((to_bone[i], distance[i])) for i in range(len(rows))]


def keep(row: np.ndarray, n: int, locked: np.ndarray) -> dict[int, np.float32]:
    """What one vertex keeps: everything locked, then the largest, scaled to what the locked ones leave of 1."""
    influences = sorted(np.flatnonzero(row > 0).tolist(), key=lambda bone: (not locked[bone], -row[bone], bone))
    held = [bone for bone in influences if locked[bone]]
    free = influences[len(held) : max(n, len(held))]
    scale = (1 - sum(float(row[bone]) for bone in held)) / max(sum(float(row[bone]) for bone in free), 1e-300)
    return {bone: row[bone] for bone in held} | {bone: np.float32(row[bone] * scale) for bone in free}


def brute_force(weights: np.ndarray, n: int, locked: np.ndarray, rank) -> list[dict[int, float]]:
    """For each vertex its members and their weights; `rank` orders all bones for each vertex from what is kept."""
    kept = [keep(row, n, locked) for row in weights.astype(float)]
    rows = np.zeros(weights.shape)
    for row, influences in zip(rows, kept, strict=True):
        row[list(influences)] = list(influences.values())
    for influences, order in zip(kept, rank(rows), strict=True):
        new = [bone for bone in order.tolist() if bone not in influences and not locked[bone]]
        influences.update(dict.fromkeys(new[: max(0, n - len(influences))], 0.0))
    return kept


def random_sheet(rng: np.random.Generator, bones: int = 15):
    """A shaken sheet in two pieces, bones strewn over it, one to five influences a vertex near its bones."""
    side = 24
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    positions = np.column_stack([x.ravel(), y.ravel(), np.zeros(side**2)]) + rng.uniform(-0.3, 0.3, (side**2, 3))
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    quads = np.stack([corner, corner + 1, corner + side + 1, corner + side], axis=1)
    triangles = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    triangles = triangles[~((triangles % side).max(axis=1) == 17)]
    segments = rng.uniform(0, side, (bones, 2, 3)) * [1, 1, 0.1]
    parents = np.array([-1, -1] + [int(rng.integers(0, b)) for b in range(2, bones)])
    far = np.linalg.norm(positions[:, None] - segments.mean(axis=1), axis=-1)
    near = np.argsort(far, axis=1)
    weights = np.zeros((len(positions), bones), np.float32)
    for i, count in enumerate(rng.integers(0, 6, len(positions))):
        weights[i, near[i, :count]] = rng.dirichlet(np.ones(count)) if count else 0
    return positions.astype(np.float32), triangles, segments.astype(np.float32), parents, weights


def members(weights: native.Weights) -> list[dict[int, float]]:
    """For each vertex its members and their weights."""
    rows = [slice(*ends) for ends in zip(weights.indptr[:-1], weights.indptr[1:], strict=True)]
    return [dict(zip(weights.bones[r].tolist(), weights.values[r].tolist(), strict=True)) for r in rows]


def assert_equal(found: list[dict[int, float]], expected: list[dict[int, float]]) -> None:
    """The same members everywhere, the same weights but for float32."""
    assert [sorted(row) for row in found] == [sorted(row) for row in expected]
    for row, reference in zip(found, expected, strict=True):
        assert max((abs(row[bone] - reference[bone]) for bone in row), default=0) < 1e-6


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("n", [1, 4, 8])
def test_equals_brute_force(seed, n):
    rng = np.random.default_rng(seed)
    positions, triangles, segments, parents, weights = random_sheet(rng)
    locked = rng.random(len(parents)) < (0.2 if seed % 2 else 0)
    sparse = native.Weights.from_dense(weights)
    hop = native.desparsify(sparse, parents, n=n, method="hop", locked=locked)
    assert_equal(members(hop), brute_force(weights, n, locked, lambda rows: hop_order(rows, parents)))
    surface = native.desparsify(
        sparse, parents, n=n, positions=positions, triangles=triangles, bone_segments=segments, locked=locked
    )
    rank = lambda rows: surface_order(np.where(locked, 0, rows), positions, triangles, segments)  # noqa: E731
    assert_equal(members(surface), brute_force(weights, n, locked, rank))


def test_equals_brute_force_on_a_character():
    (body,) = glb.read_meshes(glb.data_folder() / "mh_male" / "body.glb")
    weights = body.weights.toarray().astype(np.float32)
    rng = np.random.default_rng(0)
    bones = weights.shape[1]
    heads = np.stack([positions_of(body, weights, bone, rng) for bone in range(bones)])
    segments = np.stack([heads, heads + 0.05], axis=1).astype(np.float32)
    found = native.desparsify(
        native.Weights.from_dense(weights),
        np.arange(bones) - 1,
        positions=body.positions,
        triangles=body.triangles,
        bone_segments=segments,
    )
    rank = lambda rows: surface_order(rows, body.positions, body.triangles, segments)  # noqa: E731
    expected = brute_force(weights, 4, np.zeros(bones, bool), rank)
    assert_equal(members(found), expected)
    assert all(len(row) == 4 for row in members(found))


def positions_of(body: glb.SkinnedMesh, weights: np.ndarray, bone: int, rng: np.random.Generator) -> np.ndarray:
    """The middle of the bone's region, or anywhere if it has none."""
    region = weights[:, bone] > 0
    return body.positions[region].mean(axis=0) if region.any() else rng.uniform(-1, 1, 3)


def test_posing_does_not_change_when_nothing_is_dropped():
    rng = np.random.default_rng(5)
    positions, triangles, segments, parents, weights = random_sheet(rng)
    weights *= 0.25  # not normalised: Blender divides by the sum
    pose = np.tile(np.eye(4), (len(parents), 1, 1))
    pose[:, :3] += rng.normal(size=(len(parents), 3, 4))
    sparse = native.Weights.from_dense(weights)
    more = native.desparsify(sparse, parents, n=6, positions=positions, triangles=triangles, bone_segments=segments)
    before, after = (native.linear_blend(positions, w, pose) for w in (sparse, more))
    np.testing.assert_allclose(after, before, atol=1e-4)


def test_refuses_what_does_not_fit():
    weights = native.Weights.from_dense(np.eye(3))
    with pytest.raises(native.InvalidParameter, match='method is "nearest", but must be one of hop, surface'):
        native.desparsify(weights, [-1, 0, 1], method="nearest")
    with pytest.raises(native.InvalidParameter, match="needs positions, triangles and bone_segments"):
        native.desparsify(weights, [-1, 0, 1])
    with pytest.raises(native.InvalidParameter, match="n is 0"):
        native.desparsify(weights, [-1, 0, 1], method="hop", n=0)
    with pytest.raises(native.InvalidParameter, match="bone_parents has 2 entries where 3 are needed"):
        native.desparsify(weights, [-1, 0], method="hop")
    surface = {"positions": np.eye(3), "triangles": [[0, 1, 2]], "bone_segments": np.zeros((3, 2, 3))}
    with pytest.raises(native.InvalidParameter, match=r"bone_segments must have shape \(B, 2, 3\)"):
        native.desparsify(weights, [-1, 0, 1], **(surface | {"bone_segments": np.zeros((3, 3, 2))}))
    with pytest.raises(native.InvalidMesh, match="the rest mesh has a position that is not finite at vertex 0"):
        native.desparsify(weights, [-1, 0, 1], **(surface | {"positions": np.full((3, 3), np.nan)}))
    assert len(native.desparsify(weights, [-1, 0, 1], **surface)) == 3
