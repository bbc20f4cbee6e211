"""How deep posed points lie inside a posed surface, against Blender's own tree of faces."""

import numpy as np
import pytest

native = pytest.importorskip("skinwright_native", reason="needs the native module")
pytest.importorskip("bpy", reason="needs the bpy wheel")
import mathutils  # noqa: E402
from mathutils.bvhtree import BVHTree  # noqa: E402


@pytest.fixture
def meshes():
    """A closed box of many faces between two bones, and points in and around it; both follow the bones alike."""
    rng = np.random.default_rng(0)
    n = 8
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    square = np.concatenate(
        [np.stack([corner, corner + n, corner + n + 1], 1), np.stack([corner, corner + n + 1, corner + 1], 1)]
    )
    faces, positions = [], []
    for axis in range(3):
        for side in (-1, 1):
            flat = grid.reshape(n, n, n, 3)[0].reshape(-1, 3)[:, 1:]
            face = np.insert(flat, axis, side, axis=1)
            winding = square if (side > 0) == (axis != 1) else square[:, ::-1]
            faces.append(winding + sum(map(len, positions)))
            positions.append(face)
    positions = np.concatenate(positions) * [1, 1, 2]
    points = rng.uniform(-1.5, 1.5, (300, 3)) * [1, 1, 2]
    return positions.astype(np.float32), np.concatenate(faces).astype(np.uint32), points.astype(np.float32)


def weights(positions):
    upper = np.clip(positions[:, 2] / 2 + 0.5, 0, 1)
    return np.stack([1 - upper, upper], axis=1).astype(np.float32)


def poses():
    turn = np.eye(4)
    turn[:3, :3] = [[1, 0, 0], [0, np.cos(0.6), -np.sin(0.6)], [0, np.sin(0.6), np.cos(0.6)]]
    lift = np.eye(4)
    lift[:3, 3] = (0.3, 0, 0.5)
    return np.stack([[np.eye(4), np.eye(4)], [np.eye(4), turn], [lift, turn]])


def blended(positions, rows, pose):
    moved = np.einsum("bij,vj->vbi", pose, np.c_[positions, np.ones(len(positions))])[..., :3]
    return np.einsum("vb,vbi->vi", rows / rows.sum(1, keepdims=True), moved)


def depths(meshes, weights_of_points):
    positions, triangles, points = meshes
    return native.penetration(
        positions,
        triangles,
        native.Weights.from_dense(weights(positions)),
        points,
        native.Weights.from_dense(weights_of_points),
        poses().reshape(-1, 4, 4),
    )


def test_depths_are_those_of_blenders_tree(meshes):
    positions, triangles, points = meshes
    found = depths(meshes, weights(points))
    assert found.shape == (3, 300) and found.dtype == np.float32
    for pose, got in zip(poses(), found, strict=True):
        surface, moved = blended(positions, weights(positions), pose), blended(points, weights(points), pose)
        tree = BVHTree.FromPolygons(surface.tolist(), triangles.tolist(), all_triangles=True)
        off = []
        for depth, point in zip(got, moved, strict=True):
            closest, normal, _, distance = tree.find_nearest(point.tolist())
            off.append(abs(depth - max(0.0, normal.dot(closest - mathutils.Vector(point)))))
            assert 0 <= depth <= distance + 1e-4
        # At an edge either of two faces may have been asked, and then they differ in what they call deep.
        assert np.quantile(off, 0.9) < 1e-4 and max(off) < 0.05
    assert (found > 0.2).any() and (found == 0).any()


def test_points_that_follow_the_body_keep_their_depth(meshes):
    """With one bone in all, a pose is a rigid motion."""
    positions, triangles, points = meshes
    one = native.Weights.from_dense(np.ones((len(positions), 1), np.float32))
    follow = native.Weights.from_dense(np.ones((len(points), 1), np.float32))
    rest, turned = native.penetration(positions, triangles, one, points, follow, poses()[[0, 1]][:, 1])
    assert turned == pytest.approx(rest, abs=1e-5)


def test_matrices_that_are_no_whole_poses_are_refused(meshes):
    positions, triangles, points = meshes
    rows = native.Weights.from_dense(weights(positions))
    with pytest.raises(native.InvalidParameter, match="3 matrices are not poses of 2 bones"):
        native.penetration(
            positions,
            triangles,
            rows,
            points,
            native.Weights.from_dense(weights(points)),
            np.tile(np.eye(4), (3, 1, 1)),
        )
