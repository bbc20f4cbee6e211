"""The Python face of the transfer: fixtures with known answers, shapes, dtypes, errors, threads, jobs."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import oracle
import pytest
import skinwright_native as native

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
SQUARE_TRIANGLES = np.array([[0, 1, 2], [1, 2, 3]], np.uint32)


def grid(n: int, height=lambda x, y: 0 * x) -> tuple[np.ndarray, np.ndarray]:
    """A unit sheet of (n + 1)^2 jittered vertices."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    jitter = np.random.default_rng(3).uniform(-0.2 / n, 0.2 / n, (2, *x.shape))
    x, y = x + jitter[0], y + jitter[1]
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    quads = np.stack([corner, corner + 1, corner + n + 2, corner + n + 1], axis=1)
    triangles = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return np.stack([x.ravel(), y.ravel(), height(x, y).ravel()], axis=1).astype(np.float32), triangles.astype(
        np.uint32
    )


def sliding_weights(positions: np.ndarray, bones: int) -> np.ndarray:
    """Dense rows that slide from the first bone to the last along x."""
    at = np.clip(positions[:, 0], 0, 1)[:, None] * (bones - 1)
    return np.maximum(0, 1 - np.abs(at - np.arange(bones))).astype(np.float32) + np.float32(1e-6)


@pytest.fixture(scope="module")
def sheet():
    """A flat source, and a target that leaves it on one side."""
    positions, triangles = grid(20)
    target, target_triangles = grid(24, lambda x, y: np.where(x > 0.5, (x - 0.5) * 1.5, 0.01))
    return (positions, triangles, native.Weights.from_dense(sliding_weights(positions, 5))), (target, target_triangles)


@pytest.mark.parametrize(
    ("length", "scale", "expected"),
    [
        (1.0, 1, [1 / 28, 27 / 28]),
        (np.sqrt(2), 1, [1 / 52, 51 / 52]),
        (1.0, 100, [0.24985009, 0.75014991]),
    ],
)
def test_two_triangles_with_known_answers(length, scale, expected):
    weights = native.Weights.from_dense([[1, 0], [0, 1], [0.5, 0.5], [0.9, 0.1]])
    source = native.Source(SQUARE * scale, SQUARE_TRIANGLES, weights)
    prepared = native.Inpainting(source, SQUARE * scale, SQUARE_TRIANGLES)
    vertices, values = prepared.raw_weights(mask=[2, 2, 2, 0], smoothness_length=length)
    assert vertices.tolist() == [3]
    np.testing.assert_allclose(values, [expected], atol=1e-8)
    result = prepared.solve(mask=[2, 2, 2, 0], smoothness_length=length)
    np.testing.assert_allclose(result.weights.to_dense()[:3], [[1, 0], [0, 1], [0.5, 0.5]], atol=1e-7)


def test_shapes_and_dtypes(sheet):
    (positions, triangles, weights), (target, target_triangles) = sheet
    result = native.transfer_weights(positions, triangles, weights, target, target_triangles)
    count = len(target)
    for array, dtype in [(result.matched, bool), (result.distance, np.float32), (result.angle, np.float32)]:
        assert array.shape == (count,) and array.dtype == dtype
        assert not array.flags.writeable
    assert result.weights.indptr.dtype == result.weights.bones.dtype == np.uint32
    assert result.weights.values.dtype == np.float32
    assert len(result.weights) == count and result.weights.n_bones == 5
    assert result.weights.indptr.shape == (count + 1,)
    np.testing.assert_allclose(result.weights.to_dense().sum(axis=1), 1, atol=1e-6)
    report = result.report
    assert report["vertices"] == count and report["matched"] == result.matched.sum()
    assert report["inpainted"] == (~result.matched).sum() > 0
    assert report["raw_minimum"] == result.raw_minimum < 0.01
    stages = ["laplacian", "match", "assemble", "factor", "solve", "inpaint", "smooth", "islands and limit"]
    assert list(report["seconds"]) == stages


def test_any_array_like_is_taken(sheet):
    (positions, triangles, weights), (target, target_triangles) = sheet
    expected = native.transfer_weights(positions, triangles, weights, target, target_triangles)
    strided = np.asfortranarray(target.astype(np.float64))
    other = native.transfer_weights(
        positions.tolist(), triangles.astype(np.int64), weights, strided, target_triangles.tolist()
    )
    np.testing.assert_array_equal(expected.weights.values, other.weights.values)


def test_weights_round_trip():
    dense = np.random.default_rng(0).random((7, 4), np.float32) * (np.random.default_rng(1).random((7, 4)) > 0.5)
    weights = native.Weights.from_dense(dense)
    np.testing.assert_array_equal(weights.to_dense(), dense.astype(np.float32))
    again = native.Weights(weights.indptr, weights.bones, weights.values, weights.n_bones)
    np.testing.assert_array_equal(again.to_dense(), weights.to_dense())
    zero_kept = native.Weights([0, 2], [0, 1], [1.0, 0.0], 2)
    assert zero_kept.values.tolist() == [1.0, 0.0]


@pytest.mark.parametrize("policy", ["bridge", "nearest", "rigid", "skip"])
def test_islands_without_a_match(sheet, policy):
    source, (target, triangles) = sheet
    button = np.array([[0.2, 0.5, 3.0], [0.3, 0.5, 3.0], [0.2, 0.6, 3.0]], np.float32)
    target = np.vstack([target, button])
    triangles = np.vstack([triangles, np.arange(len(target) - 3, len(target))])
    result = native.transfer_weights(*source, target, triangles, island_policy=policy)
    island = {"first_vertex": len(target) - 3, "vertices": 3, "policy": policy}
    assert result.report["unmatched_islands"] == [island]
    rows = result.weights.to_dense()[-3:]
    np.testing.assert_allclose(rows.sum(axis=1), 0 if policy == "skip" else 1, atol=1e-6)
    assert (policy == "nearest") == (np.abs(rows - rows[0]).max() > 1e-3)


def test_smoothing_equals_the_plain_loop(sheet):
    source, (target, triangles) = sheet
    before = native.transfer_weights(*source, target, triangles, max_distance=0.05)
    after = native.transfer_weights(*source, target, triangles, max_distance=0.05, smoothing_iterations=4)
    neighbours = [set() for _ in target]
    for a, b, c in triangles.tolist():
        neighbours[a] |= {b, c}
        neighbours[b] |= {a, c}
        neighbours[c] |= {a, b}
    reach = np.where(before.matched, np.inf, 0.0)
    for _ in range(len(target)):
        shorter = reach.copy()
        for i, around in enumerate(neighbours):
            for j in around:
                length = reach[j] + np.linalg.norm(target[i].astype(float) - target[j].astype(float))
                shorter[i] = min(shorter[i], length if length <= 0.05 else np.inf)
        if (shorter == reach).all():
            break
        reach = shorter
    expected = before.weights.to_dense().astype(float)
    for _ in range(4):
        means = np.array([expected[list(around)].mean(axis=0) for around in neighbours])
        expected = np.where(np.isfinite(reach)[:, None], 0.8 * expected + 0.2 * means, expected)
    assert 0 < np.isfinite(reach).sum() < len(target)
    np.testing.assert_allclose(after.weights.to_dense(), expected, atol=2e-6)


def test_mollified_triangles_equal_the_oracle(sheet):
    (positions, triangles, _), (target, target_triangles) = sheet
    target = target.copy()
    for corners in target_triangles[5:400:31]:
        target[corners[2]] = (target[corners[0]] + target[corners[1]]) / 2
    target[100:104] = target[100]
    dense = sliding_weights(positions, 5)
    source = native.Source(positions, triangles, native.Weights.from_dense(dense))
    prepared = native.Inpainting(source, target, target_triangles)
    matched = prepared.matched()
    reference = (positions.astype(float), triangles.astype(np.int64), oracle.sp.csr_matrix(dense.astype(float)))
    rows = oracle.match(reference, (target.astype(float), target_triangles.astype(np.int64))).rows
    for length in (0.0, 0.1):
        unknown, expected = oracle.inpaint(
            target.astype(float), target_triangles.astype(np.int64), matched, rows, length
        )
        vertices, values = prepared.raw_weights(smoothness_length=length, mask=np.where(matched, 2, 0))
        assert np.array_equal(vertices, unknown) and len(unknown) > 100
        assert np.abs(values - expected).max() <= 1e-6


def test_prepared_objects_equal_the_function(sheet):
    source_arrays, target = sheet
    source = native.Source(*source_arrays)
    prepared = native.Inpainting(source, *target)
    for settings in ({}, {"max_influences": 2}, {"smoothing_iterations": 3}, {"max_distance": 0.1}):
        expected = native.transfer_weights(*source_arrays, *target, **settings)
        for result in (
            source.transfer(*target, **settings),
            prepared.solve(**settings),
            prepared.start(**settings).result(),
        ):
            np.testing.assert_array_equal(result.weights.values, expected.weights.values)
            np.testing.assert_array_equal(result.weights.bones, expected.weights.bones)
        np.testing.assert_array_equal(prepared.matched(**settings), expected.matched)
    assert prepared.solve(max_distance=0.1, max_influences=3).report["factored_blocks"] == 0


def test_closest_points_equal_libigl(sheet):
    (positions, triangles, weights), _ = sheet
    queries = np.random.default_rng(5).uniform(-0.5, 1.5, (500, 3)).astype(np.float32)
    source = native.Source(positions, triangles, weights)
    triangle, barycentric, distance = source.closest_points(queries)
    squared, _, closest = oracle.igl.point_mesh_squared_distance(
        queries.astype(float), positions.astype(float), triangles.astype(np.int64)
    )
    np.testing.assert_allclose(distance**2, squared, atol=1e-12)
    corners = positions[triangles[triangle]].astype(float)
    np.testing.assert_allclose((corners * barycentric[:, :, None]).sum(axis=1), closest, atol=1e-6)


def test_absolute_lengths_win(sheet):
    source, target = sheet
    report = native.transfer_weights(
        *source,
        *target,
        max_distance=0.123,
        relative_max_distance=9,
        smoothness_length=0.5,
        relative_smoothness_length=9,
    ).report
    assert report["max_distance"] == 0.123 and report["smoothness_length"] == 0.5


def test_same_bits_with_any_number_of_threads(sheet):
    source, target = sheet
    results = [native.transfer_weights(*source, *target, threads=n, smoothing_iterations=2) for n in (1, 2, 3)]
    for result in results[1:]:
        np.testing.assert_array_equal(result.weights.values, results[0].weights.values)


def test_a_job_reports_finishes_and_cancels(sheet):
    source, _ = sheet
    prepared = native.Inpainting(native.Source(*source), *grid(200, lambda x, y: 0.5 * x))
    job = prepared.start(smoothing_iterations=5)
    while not job.done:
        assert 0 <= job.progress <= 1
        time.sleep(0.01)
    assert job.progress == 1 and job.result() is job.result()

    prepared = native.Inpainting(native.Source(*source), *grid(200, lambda x, y: 0.5 * x))
    cancelled = prepared.start()
    cancelled.cancel()
    with pytest.raises(native.Cancelled):
        cancelled.result()
    np.testing.assert_array_equal(
        prepared.start(smoothing_iterations=5).result().weights.values, job.result().weights.values
    )


def test_errors_are_typed_and_say_what_to_do(sheet):
    (positions, triangles, weights), (target, target_triangles) = sheet

    def run(error, match, **changes):
        arrays = {
            "source_positions": positions,
            "source_triangles": triangles,
            "source_weights": weights,
            "target_positions": target,
            "target_triangles": target_triangles,
        }
        assert issubclass(error, (native.SkinwrightError, TypeError))
        with pytest.raises(error, match=match):
            native.transfer_weights(**(arrays | changes))

    assert issubclass(native.SkinwrightError, ValueError)
    run(
        native.NothingMatched,
        r"distance now in force, 0\.0\d+; the smallest .* is 10\.",
        target_positions=target + np.float32([0, 0, 10]),
    )
    run(native.NothingMatched, "no distance would help", mask=np.zeros(len(target)))
    not_finite = target.copy()
    not_finite[9, 1] = np.inf
    run(native.InvalidMesh, "target mesh .* vertex 9", target_positions=not_finite)
    run(
        native.InvalidMesh,
        "triangle 1 of the source mesh names vertex 70000",
        source_triangles=[[0, 1, 2], [0, 1, 70000]],
    )
    run(native.InvalidMesh, "target mesh has no triangles", target_triangles=np.zeros((0, 3)))
    run(
        native.InvalidMesh,
        "source mesh",
        source_positions=np.zeros((0, 3)),
        source_weights=native.Weights([0], [], [], 5),
    )
    run(native.InvalidParameter, r"shape \(N, 3\), not", target_positions=target[:, :2])
    run(
        native.InvalidParameter,
        "source weights has 4 entries where",
        source_weights=native.Weights.from_dense(np.eye(4)),
    )
    run(native.InvalidParameter, "mask has 3 entries", mask=[0, 1, 2])
    run(native.InvalidParameter, "mask is 7 at vertex 0", mask=np.full(len(target), 7))
    run(native.InvalidParameter, "max_distance is -1", max_distance=-1.0)
    run(native.InvalidParameter, "max_distance is NaN", max_distance=float("nan"))
    run(native.InvalidParameter, "island_policy .* bridge, nearest, rigid, skip", island_policy="float")
    run(TypeError, "no setting named", max_distanse=1.0)
    with pytest.raises(native.InvalidWeights, match="not finite"):
        native.Weights.from_dense([[np.nan]])
    with pytest.raises(native.InvalidWeights, match="bone 5 is out of range"):
        native.Weights([0, 1], [5], [1.0], 2)
    with pytest.raises(native.InvalidWeights, match="do not fit"):
        native.Weights([0, 2], [0], [1.0], 2)
    with pytest.raises(native.InvalidWeights, match="negative"):
        native.Source(positions, triangles, native.Weights.from_dense(-weights.to_dense()))


def test_the_stub_is_true():
    types_only = Path(__file__).resolve().parents[2] / "rust" / "native" / "stubtest_allowlist.txt"
    command = [sys.executable, "-m", "mypy.stubtest", "skinwright_native", "--ignore-missing-stub"]
    command += ["--allowlist", str(types_only), "--ignore-unused-allowlist"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    if "No module named" in done.stderr:
        pytest.skip("mypy is not installed")
    assert done.returncode == 0, done.stdout + done.stderr
