"""Sculpt to weights: the solver against quadprog and enumeration, and the Python face of strokes, memory and undo."""

import itertools

import numpy as np
import pytest
import quadprog
import skinwright_native as native
import thesis

PULL = 0.05
CASES = 13_000  # of each family, 104,000 in all


def problems(family: str, count: int, rng: np.random.Generator, n: int = 4):
    """H, g and starts as strokes make them: d (P, 3, n) and targets (P, 3) over the mesh' size."""
    poses = 3 if family == "three poses" else 1
    scale = {"x1000": 1e3, "x0.001": 1e-3}.get(family, 1.0)
    h = np.tile(PULL**2 * np.eye(n), (count, 1, 1))
    start = rng.dirichlet(np.full(n, 0.5), count)
    if family == "one-hot":
        start = np.eye(n)[rng.integers(0, n, count)]
    for _ in range(poses):
        d, target = scale * rng.normal(size=(count, 3, n)), scale * rng.normal(size=(count, 3))
        if family == "target inside":
            target = np.einsum("pxj,pj->px", d, rng.dirichlet(np.ones(n), count))
        if family == "coincident":
            d = d[:, :, :1] + 1e-7 * d * (np.arange(n) > 1)
        if family == "collinear":
            d = d[:, :, :1] + d[:, :, 1:2] * rng.normal(size=(count, 1, n))
        e = (d - target[..., None]) / scale
        h += np.einsum("pxi,pxj->pij", e, e)
    return h, PULL**2 * start, start


def enumerate_faces(h: np.ndarray, g: np.ndarray) -> np.ndarray:
    """The minimisers by trying every face: the one where the Karush-Kuhn-Tucker conditions hold best."""
    count, n = g.shape
    best, answer = np.full(count, np.inf), np.zeros_like(g)
    for face in itertools.chain.from_iterable(itertools.combinations(range(n), m) for m in range(1, n + 1)):
        face, m = list(face), len(face)
        system = np.ones((count, m + 1, m + 1))
        system[:, :m, :m] = h[:, face][:, :, face]
        system[:, m, m] = 0
        right = np.column_stack([g[:, face], np.ones(count)])
        solution = np.linalg.solve(system, right[..., None])[..., 0]
        w = np.zeros_like(g)
        w[:, face] = solution[:, :m]
        multipliers = (np.einsum("pij,pj->pi", h, w) - g + solution[:, m:]) / PULL**2
        multipliers[:, face] = 0
        violation = np.maximum(-w.min(axis=1), -multipliers.min(axis=1)).clip(0)
        better = violation < best
        best[better], answer[better] = violation[better], w[better]
    return answer


FAMILIES = ["generic", "target inside", "coincident", "collinear", "one-hot", "x1000", "x0.001", "three poses"]


@pytest.mark.parametrize("family", FAMILIES)
def test_the_solver_agrees_with_quadprog_and_enumeration(family):
    h, g, start = problems(family, CASES, np.random.default_rng(7))
    w = native.simplex_qp(h, g, start)
    assert w.min() >= 0
    np.testing.assert_allclose(w.sum(axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(w, enumerate_faces(h, g), rtol=0, atol=1e-9)
    constraints, bounds = np.column_stack([np.ones(4), np.eye(4)]), np.array([1.0, 0, 0, 0, 0])
    peer = np.array([quadprog.solve_qp(h[p], g[p], constraints, bounds, 1)[0] for p in range(CASES)])
    np.testing.assert_allclose(w, peer, rtol=0, atol=1e-9)


@pytest.mark.parametrize("n", [1, 2, 3, 5, 8, 12])
def test_the_solver_agrees_with_quadprog_on_other_sizes(n):
    h, g, start = problems("three poses", 200, np.random.default_rng(n), n)
    constraints, bounds = np.column_stack([np.ones(n), np.eye(n)]), np.r_[1.0, np.zeros(n)]
    peer = np.array([quadprog.solve_qp(h[p], g[p], constraints, bounds, 1)[0] for p in range(len(h))])
    np.testing.assert_allclose(native.simplex_qp(h, g, start), peer, rtol=0, atol=1e-9)


@pytest.mark.parametrize("scale", [0.1, 1.0, 10.0, 100.0])
def test_no_vertex_ends_farther_whatever_the_scale_unlike_in_the_thesis(scale):
    """Each vertex has bones of its own that only shift it, so that d is any point."""
    rng = np.random.default_rng(3)
    count = 2000
    d = scale * rng.normal(size=(count, 3, 4))
    old = rng.dirichlet(np.full(4, 0.5), count).astype(np.float32)
    target = np.einsum("pxj,pj->px", d, old) + 0.2 * scale * rng.normal(size=(count, 3))
    rest = scale * rng.uniform(-1, 1, (count, 3))
    pose = np.tile(np.eye(4), (4 * count, 1, 1))
    pose[:, :3, 3] = (d.transpose(0, 2, 1) - rest[:, None]).reshape(-1, 3)
    indptr, bones = np.arange(0, 4 * count + 1, 4), np.arange(4 * count)
    solver = native.SculptSolver(rest, native.Weights(indptr, bones, old.ravel(), 4 * count))
    solver.add_pose(pose)
    stroke = solver.stroke(np.arange(count), target)

    left = lambda w: np.linalg.norm(np.einsum("pxj,pj->px", d, w) - target, axis=1)  # noqa: E731
    before, after = left(old), left(stroke.weights.values.reshape(count, 4))
    assert (after <= before + 1e-5 * scale).all()
    np.testing.assert_allclose(np.linalg.norm(stroke.residuals, axis=1), after, atol=1e-5 * scale)
    np.testing.assert_allclose(stroke.reachability, 1 - np.linalg.norm(after) / np.linalg.norm(before), atol=1e-5)
    reference = left(np.array([thesis.solve(d[p], target[p], old[p].astype(float)) for p in range(count)]))
    assert after.mean() < reference.mean()
    if scale >= 1:
        assert (reference > before).mean() > 0.1


def character(seed: int = 0, vertices: int = 200, bones: int = 6):
    """Rest positions, weights with four members a vertex, and two poses."""
    rng = np.random.default_rng(seed)
    rest = rng.normal(size=(vertices, 3)).astype(np.float32)
    members = np.sort(np.argsort(rng.random((vertices, bones)), axis=1)[:, :4], axis=1)
    values = rng.dirichlet(np.ones(4), vertices).astype(np.float32)
    weights = native.Weights(np.arange(0, 4 * vertices + 1, 4), members.ravel(), values.ravel(), bones)
    poses = np.tile(np.eye(4), (2, bones, 1, 1))
    poses[:, :, :3] += rng.normal(scale=0.3, size=(2, bones, 3, 4))
    return rest, weights, poses


def test_a_session():
    rest, weights, (pose_a, pose_b) = character()
    goal = character(seed=0)[1]
    goal = native.Weights(goal.indptr, goal.bones, np.roll(goal.values.reshape(-1, 4), 1, axis=1).ravel(), 6)
    solver = native.SculptSolver(rest, weights, kappa=0.002)
    touched = np.arange(20, 120, dtype=np.int64)
    a = solver.add_pose(pose_a)
    stroke_a = solver.stroke(touched, native.linear_blend(rest, goal, pose_a)[touched])
    b = solver.add_pose(pose_b)
    stroke_b = solver.stroke(touched, native.linear_blend(rest, goal, pose_b)[touched])
    assert (a, b, solver.add_pose(pose_a), solver.stroke_count) == (0, 1, 0, 2)
    assert stroke_a.reachability > 0.95 and solver.reachability() == stroke_b.reachability
    assert stroke_b.vertices.dtype == np.uint32 and stroke_b.vertices.tolist() == touched.tolist()
    assert stroke_b.residuals.shape == (100, 3) and len(stroke_b.weights) == 100

    for pose in (pose_a, pose_b):
        start, end, want = (native.linear_blend(rest, w, pose) for w in (weights, solver.weights(), goal))
        assert np.linalg.norm(end - want, axis=1)[touched].mean() < 0.05 * np.linalg.norm(start - want, axis=1).mean()
        np.testing.assert_array_equal(np.delete(end, touched, axis=0), np.delete(start, touched, axis=0))
    np.testing.assert_array_equal(solver.weights(touched).values, stroke_b.weights.values)
    vertices, residuals = solver.residuals(pose=b)
    np.testing.assert_array_equal(vertices, touched)
    np.testing.assert_allclose(residuals, stroke_b.residuals, atol=1e-6)

    assert solver.undo().tolist() == touched.tolist()
    np.testing.assert_array_equal(solver.weights(touched).values, stroke_a.weights.values)
    assert solver.residuals(pose=b)[0].size == 0
    assert solver.undo() is not None and solver.undo() is None
    np.testing.assert_array_equal(solver.weights().values, weights.values)
    assert solver.reachability() is None
    assert solver.redo() is not None and solver.redo() is not None and solver.redo() is None
    np.testing.assert_array_equal(solver.weights(touched).values, stroke_b.weights.values)


def test_a_brush_that_moves_rest_positions():
    """The sculpted position of a vertex is T v', and the rest residual is what a shape key must add (section 4)."""
    rest, weights, (pose, _) = character(1)
    solver = native.SculptSolver(rest, weights)
    solver.add_pose(pose)
    touched = np.arange(50)
    sculpted = rest[touched] + np.random.default_rng(2).normal(scale=0.2, size=(50, 3)).astype(np.float32)
    targets = solver.posed(touched, sculpted)
    moved = rest.copy()
    moved[touched] = sculpted
    np.testing.assert_allclose(targets, native.linear_blend(moved, weights, pose)[touched], atol=1e-6)
    stroke = solver.stroke(touched, targets)
    assert 0 < stroke.reachability < 1
    vertices, offsets = solver.rest_residuals()
    reached = solver.posed(vertices, rest[vertices] + offsets)
    assert np.median(np.linalg.norm(reached - targets, axis=1)) < 1e-5


def test_the_rest_shape_helps_where_weights_cannot():
    rest, weights, poses = character(5)
    solver = native.SculptSolver(rest, weights)
    touched = np.arange(60)
    goals = []
    for pose in poses:
        solver.add_pose(pose)
        bump = np.random.default_rng(6).normal(scale=0.3, size=(60, 3))
        goals.append(native.linear_blend(rest, weights, pose)[touched] + bump)
        solver.stroke(touched, goals[-1])
    offsets, rows = solver.fit_rest_shape(touched, stiffness=0.01)
    assert offsets.shape == (60, 3) and len(rows) == 60

    def left(positions, weights):
        return sum(
            (np.linalg.norm(native.linear_blend(positions, weights, p) - g, axis=1) ** 2).mean()
            for p, g in zip(poses, goals, strict=True)
        )

    assert left(rest[touched] + offsets, rows) < 0.5 * left(rest[touched], solver.weights(touched))
    with pytest.raises(native.InvalidParameter, match="stiffness is 0"):
        solver.fit_rest_shape(touched, stiffness=0)


def test_guards_and_locks():
    rest, weights, (pose_a, pose_b) = character(2)
    goal = native.linear_blend(rest, character(3)[1], pose_a)
    everywhere = np.arange(len(rest))

    def drift(prepare, **options):
        solver = native.SculptSolver(rest, weights, **options)
        prepare(solver)
        solver.add_pose(pose_a)
        solver.stroke(everywhere, goal)
        before, after = (native.linear_blend(rest, w, pose_b) for w in (weights, solver.weights()))
        return np.linalg.norm(after - before), solver.weights().values

    free, _ = drift(lambda solver: None)
    held, _ = drift(lambda solver: solver.guard(pose_b, alpha=0.3))
    forgotten, _ = drift(lambda solver: (solver.guard(pose_b), solver.clear_guards()))
    parents, heads = [-1, 0, 1, 2, 3, 4], np.zeros((6, 3))
    moving, _ = drift(lambda solver: solver.guard_range_of_motion(parents, heads, [1, 3], alpha=5.0))
    assert held < 0.8 * free and forgotten == free and moving != free
    locked = np.arange(6) == 2
    _, values = drift(lambda solver: None, locked=locked)
    is_locked = locked[weights.bones]
    np.testing.assert_array_equal(values[is_locked], weights.values[is_locked])
    assert (values[~is_locked] != weights.values[~is_locked]).any()


def test_refuses_what_it_cannot_use():
    rest, weights, (pose, _) = character(4)
    with pytest.raises(native.InvalidParameter, match="kappa is 0, but it must be more than 0"):
        native.SculptSolver(rest, weights, kappa=0)
    many = native.Weights([0, 13], np.arange(13), np.full(13, 1 / 13), 13)
    with pytest.raises(
        native.InvalidWeights, match="vertex 0 has 13 influences, sculpting takes at most 12: desparsify first"
    ):
        native.SculptSolver(rest[:1], many)
    with pytest.raises(native.InvalidMesh, match="not finite at vertex 0"):
        native.SculptSolver(rest * np.nan, weights)
    solver = native.SculptSolver(rest, weights)
    with pytest.raises(native.SkinwrightError, match="call add_pose first"):
        solver.stroke([0], [[0, 0, 0]])
    with pytest.raises(native.InvalidParameter, match="pose_from_rest has 5 entries where 6 are needed"):
        solver.add_pose(pose[:5])
    solver.add_pose(pose)
    with pytest.raises(native.InvalidParameter, match="pose is 7"):
        solver.stroke([0], [[0, 0, 0]], pose=7)
    with pytest.raises(native.InvalidParameter, match="vertex is 200, but the mesh has no such vertex"):
        solver.stroke([200], [[0, 0, 0]])
    with pytest.raises(native.InvalidParameter, match="vertex is 3, but a stroke may name it only once"):
        solver.stroke([3, 3], np.zeros((2, 3)))
    with pytest.raises(native.InvalidParameter, match="every sculpted position must be finite"):
        solver.stroke([3], [[0, 0, np.inf]])
    with pytest.raises(native.InvalidParameter, match="alpha is 0"):
        solver.guard(pose, alpha=0)
    with pytest.raises(native.InvalidParameter, match="shapes must be"):
        native.simplex_qp(np.zeros((2, 3, 3)), np.zeros((2, 3)), np.zeros((2, 4)))
    np.testing.assert_array_equal(solver.weights().values, weights.values)
    assert solver.undo() is None
