"""Numbers and indices at the native boundary: in their range, exactly, or refused by a class of our own."""

import inspect
import math
import os
import threading

import numpy as np
import pytest

HUGE = [-1, 1 << 31, 1 << 32, (1 << 32) + 1, 1 << 40, (1 << 63) - 1, 1 << 63, 1 << 64, 10**400, -(10**400)]


@pytest.fixture
def sheets(native):
    """A source of two bones and a target above it, of 36 vertices each; half of the target is out of reach."""
    x, y = np.meshgrid(*[np.linspace(-1, 1, 6)] * 2)
    positions = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1).astype(np.float32)
    first = (np.arange(5)[None] + 6 * np.arange(5)[:, None]).ravel()
    triangles = np.concatenate([np.stack([first, first + 1, first + 7], 1), np.stack([first, first + 7, first + 6], 1)])
    share = (x.ravel() + 1) / 2
    target = positions + np.float32([0, 0, 0.02])
    target[18:, 2] += 1
    return {
        "source_positions": positions,
        "source_triangles": triangles.astype(np.uint32),
        "source_weights": native.Weights.from_dense(np.stack([share, 1 - share], axis=1)),
        "target_positions": target,
        "target_triangles": triangles.astype(np.uint32),
    }


def test_the_library_has_the_ranges_that_are_declared(native, addon, sheets):
    declared = addon.declared.declared(addon.transfer.TransferParams)
    for name, (_, one) in declared.items():
        if not one.native or one.choices or one.most is math.inf:
            continue
        native.transfer_weights(**sheets, **{name: type(one.most)(one.most)})
        beyond = [math.nan, math.inf, one.most * 1.001 + 1, one.least - 1e-3]
        whole = type(declared[name][1].most) is int and "int" in str(declared[name][0])
        for value in HUGE[-2:] + ([one.most + 1, one.least - 1] if whole else beyond):
            if name == "threads" and value == one.most + 1:
                continue  # more than the machine has are as good as all of them
            with pytest.raises((native.InvalidParameter, OverflowError), match=f"{name} is|too large"):
                native.transfer_weights(**sheets, **{name: value})


@pytest.mark.parametrize("value", HUGE)
@pytest.mark.parametrize("name", ["smoothing_iterations", "max_influences"])
def test_whole_numbers_are_exact(native, sheets, name, value):
    with pytest.raises(native.InvalidParameter, match=f"{name} is"):
        native.transfer_weights(**sheets, **{name: value})


@pytest.mark.parametrize("value", [v for v in HUGE if v != -1])
def test_no_more_threads_than_the_machine_has(native, sheets, value):
    """A hundred thousand threads would take minutes to start."""
    if value > 1 << 62 or value < 0:
        with pytest.raises(native.InvalidParameter, match="threads is"):
            native.transfer_weights(**sheets, threads=value)
        return
    before = threading.active_count()
    native.transfer_weights(**sheets, threads=value)
    assert threading.active_count() == before
    if os.path.isdir("/proc/self/task"):
        assert len(os.listdir("/proc/self/task")) < 4 * (os.cpu_count() or 1) + 32


@pytest.mark.parametrize("value", HUGE)
def test_numbers_of_bones_and_members(native, value):
    weights = native.Weights.from_dense(np.full((3, 2), 0.5, np.float32))
    with pytest.raises(native.InvalidParameter, match="n_bones is"):
        native.Weights([0, 1], [0], [1.0], value)
    with pytest.raises(native.InvalidParameter, match="n is"):
        native.desparsify(weights, [-1, 0], n=value, method="hop")
    rest = np.eye(3, dtype=np.float32)
    with pytest.raises(native.InvalidParameter, match="passes is"):
        native.SculptSolver(rest, weights, passes=value)
    solver = native.SculptSolver(rest, weights)
    with pytest.raises(native.InvalidParameter, match="pose is"):
        solver.residuals(pose=value)
    with pytest.raises(native.InvalidParameter, match="rounds is"):
        solver.fit_rest_shape([0], rounds=value)


@pytest.mark.parametrize("bad", [[-1], [1 << 32], [2.5], [math.nan], [math.inf], [1e300], np.array([-1], np.int8)])
def test_indices_never_wrap(native, sheets, bad):
    """-1 is no vertex 4294967295, 4294967296 is no vertex 0, and 2.5 is no vertex 2."""
    weights = native.Weights.from_dense(np.full((3, 2), 0.5, np.float32))
    solver = native.SculptSolver(np.eye(3, dtype=np.float32), weights)
    bad = np.asarray(bad)
    calls = [
        lambda: native.Weights(np.concatenate([[0], bad]), [0], [1.0], 2),
        lambda: native.Weights([0, 1], bad, [1.0], 2),
        lambda: native.transfer_weights(**sheets | {"target_triangles": np.repeat(bad, 3)[None]}),
        lambda: native.transfer_weights(**sheets, mask=np.repeat(bad, 36)),
        lambda: solver.stroke(bad, np.zeros((1, 3))),
        lambda: solver.weights(bad),
    ]
    for call in calls:
        with pytest.raises(native.SkinwrightError):
            call()


def test_whole_numbers_may_come_as_any_type(native):
    for kind in (np.int8, np.uint16, np.int64, np.uint64, np.float32, np.float64):
        weights = native.Weights(np.array([0, 1], kind), np.array([1], kind), [1.0], 2)
        assert weights.bones.tolist() == [1] and weights.bones.dtype == np.uint32
    assert len(native.Weights([0], [], [], 2)) == 0


def test_a_dense_array_too_large_for_memory_is_refused(native):
    weights = native.Weights(np.zeros(1_000_001, np.uint32), [], [], 1 << 20)
    with pytest.raises(MemoryError, match="4194304000000 bytes"):
        weights.to_dense()


def test_no_call_takes_a_number_unchecked(native):
    """Every parameter with a number as default has been looked at here: a new one fails until it has."""
    known = {"threads", "n", "passes", "rounds", "kappa", "alpha", "stiffness", "max_distance", "smoothness_length"}
    known |= {"relative_max_distance", "max_normal_angle", "relative_smoothness_length", "smoothing_iterations"}
    known |= {"smoothing_factor", "max_influences", "softness", "relative_weld_tolerance", "length"}
    # Automatic weights, retargeting and refinement: the next test.
    known |= {"resolution", "normal_length", "max_stretch", "n_pairs", "stretch", "volume", "bind", "energy"}
    found = set()
    for owner in (native, native.Source, native.Inpainting, native.SculptSolver, native.Weights):
        for _, call in inspect.getmembers(owner, callable):
            try:
                parameters = inspect.signature(call).parameters.values()
            except (TypeError, ValueError):
                continue
            found |= {p.name for p in parameters if type(p.default) in (int, float)}
    assert found <= known


BOX = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 3)], np.float32)
SIDES = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4]]
SIDES += [[1, 5, 7], [1, 7, 3]]
SEGMENTS = np.array([[[0.5, 0.5, 0.2], [0.5, 0.5, 1.4]], [[0.5, 0.5, 1.4], [0.5, 0.5, 2.8]]], np.float32)


def automatic(native, **settings):
    return native.automatic_weights(BOX, SIDES, SEGMENTS, [-1, 0], **settings)


def embedding(native, **settings):
    return native.biharmonic_embedding(BOX, SIDES, **settings)


def retargeted(native, **settings):
    weights = native.Weights.from_dense(np.tile(np.float32([1]), (8, 1)))
    character = (np.eye(4)[None], [1.0])
    both = (BOX, SIDES, weights, *character, BOX, SIDES, *character)
    return native.retarget_weights(*both, bone_map=[0], **settings)


def refiner(native, **settings):
    weights = native.Weights.from_dense(np.tile(np.float32([0.5, 0.5]), (8, 1)))
    return native.Refiner(BOX, SIDES, weights, [-1, 0], SEGMENTS, **settings)


@pytest.mark.parametrize("value", [-1, 0.5, 1 << 40, 1 << 70, math.nan, math.inf])
@pytest.mark.parametrize(("call", "name"), [(embedding, "n_pairs"), (retargeted, "n_pairs"), (retargeted, "threads")])
def test_counts_of_the_other_operations(native, call, name, value):
    """Nothing is allocated or started by a number that was not looked at."""
    if name == "threads" and value == 1 << 40:
        pytest.skip("more than the machine has are as good as all of them")
    with pytest.raises((native.InvalidParameter, OverflowError, TypeError)):
        call(native, **{name: value})


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
@pytest.mark.parametrize(
    ("call", "name"),
    [(automatic, name) for name in ("resolution", "stiffness")]
    + [(retargeted, name) for name in ("normal_length", "max_distance", "max_normal_angle", "max_stretch")]
    + [(refiner, name) for name in ("cell", "stretch", "volume", "bind", "energy")],
)
def test_lengths_and_shares_of_the_other_operations(native, call, name, value):
    with pytest.raises(native.InvalidParameter, match=name):
        call(native, **{name: value})


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_numbers_that_are_not_finite_are_no_answer(native, bad):
    """Depths of 0 would say that nothing is wrong."""
    weights, pose = native.Weights.from_dense(np.ones((8, 1), np.float32)), np.eye(4)[None]
    broken = BOX.copy()
    broken[3, 1] = bad
    for body, garment in ((broken, BOX), (BOX, broken)):
        with pytest.raises(native.InvalidMesh, match="not finite at vertex 3"):
            native.penetration(body, SIDES, weights, garment, weights, pose)
    with pytest.raises(native.InvalidMesh, match="not finite at vertex 3"):
        two = native.Weights.from_dense(np.tile(np.float32([0.5, 0.5]), (8, 1)))
        native.Refiner(broken, SIDES, two, [-1, 0], SEGMENTS)
    arguments = {"h": np.eye(3)[None], "g": np.ones((1, 3)), "start": np.full((1, 3), 1 / 3)}
    for name, value in arguments.items():
        with pytest.raises(native.InvalidParameter, match=f"{name} has a number that is not finite"):
            native.simplex_qp(
                **(arguments | {name: np.where(np.arange(value.size).reshape(value.shape) == 2, bad, value)})
            )
