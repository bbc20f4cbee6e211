"""Collapsed spots: a garment with one is solved, like the garment without it."""

import time

import numpy as np
import pytest
import skinwright_native as native
from test_weld import body

N = 60


def garment(n: int = N) -> tuple[np.ndarray, np.ndarray]:
    """A grid, two thirds of which leave the body."""
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n))
    positions = np.stack([x.ravel(), y.ravel(), np.where(x > 0.35, 0.3, 0.01).ravel()], axis=1)
    first = (np.arange(n - 1)[None] + n * np.arange(n - 1)[:, None]).ravel()
    return positions, np.vstack(
        [np.stack([first, first + 1, first + n + 1], 1), np.stack([first, first + n + 1, first + n], 1)]
    )


def flat_body() -> native.Source:
    positions, triangles, weights = body()
    positions[:, 2] = 0
    return native.Source(positions, triangles, weights)


GRID = np.arange(N * N).reshape(N, N)


def flattened(rows: int, columns: int, at: tuple[int, int], squeeze: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A patch squeezed onto a line, its vertices apart from each other along it."""
    positions, _triangles = garment()
    patch = GRID[at[0] : at[0] + rows, at[1] : at[1] + columns].ravel()
    # A slope, so that vertices of one column do not become one.
    positions[patch, 0] += 0.3 / N * (positions[patch, 1] - positions[patch, 1].mean()) * N / rows
    centre = positions[patch].mean(axis=0)
    positions[patch, 1] = centre[1] + squeeze * (positions[patch, 1] - centre[1])
    positions[patch, 2] = centre[2]
    return positions.astype(np.float32), patch


@pytest.mark.parametrize("size", [(2, 2), (3, 3), (4, 4), (10, 3), (6, 6)], ids=str)
@pytest.mark.parametrize("weld", [1e-6, 0.0])
@pytest.mark.parametrize("squeeze", [0.0, 1e-5, 1e-3])
def test_a_patch_on_a_line_refuses_nothing(size, weld, squeeze):
    source, triangles = flat_body(), garment()[1]
    whole = source.transfer(garment()[0], triangles, max_distance=0.05).weights.to_dense()
    rng = np.random.default_rng(size[0])
    for _ in range(4):
        at = (int(rng.integers(1, N - 1 - size[0])), int(rng.integers(26, N - 2 - size[1])))
        positions, patch = flattened(*size, at, squeeze)
        found = source.transfer(positions, triangles, max_distance=0.05, relative_weld_tolerance=weld)
        rows = found.weights.to_dense()
        np.testing.assert_allclose(rows.sum(axis=1), 1, atol=1e-6)
        far = np.linalg.norm(garment()[0][:, :2] - garment()[0][patch, :2].mean(axis=0), axis=1) > 0.25
        assert np.abs(rows - whole).max() < 0.05 and np.abs(rows - whole)[far].max() < 0.01


@pytest.mark.parametrize("loops", [1, 2, 3])
@pytest.mark.parametrize("weld", [1e-6, 0.0])
def test_edge_loops_merged_onto_the_next(loops, weld):
    source = flat_body()
    positions, triangles = garment()
    positions[GRID[20 : 20 + loops]] = positions[GRID[20 + loops]]
    rows = source.transfer(positions, triangles, max_distance=0.05, relative_weld_tolerance=weld).weights.to_dense()
    # The repaired mesh: the loops are one.
    keep = np.ones(N * N, bool)
    keep[GRID[20 : 20 + loops].ravel()] = False
    new = np.cumsum(keep) - 1
    new[GRID[20 : 20 + loops]] = new[GRID[20 + loops]]
    faces = new[triangles]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    expected = source.transfer(positions[keep], faces, max_distance=0.05).weights.to_dense()
    assert np.abs(rows - expected[new]).max() < (1e-6 if weld else 0.01)


@pytest.mark.parametrize(
    "shape", ["ribbon 1:1000", "strip of 30,000 quads", "tiny patch", "needles", "all on a line", "all at a point"]
)
def test_odd_shapes_are_answered(shape):
    source = flat_body()
    positions, triangles = garment()
    if shape == "ribbon 1:1000":
        positions[:, 1] *= 1e-3
    elif shape == "strip of 30,000 quads":
        x = np.linspace(0, 1, 30_000)
        side = np.stack([x, 0 * x + 0.5, np.where(x < 0.2, 0.01, 0.5)], axis=1)
        positions = np.vstack([side, side + np.array([0, 1 / 30_000, 0])])
        f = np.arange(29_999)
        triangles = np.vstack([np.stack([f, f + 1, f + 30_001], 1), np.stack([f, f + 30_001, f + 30_000], 1)])
    elif shape in ("tiny patch", "needles"):
        patch = GRID[20:32, 30:42].ravel()
        axes = slice(0, 3) if shape == "tiny patch" else slice(1, 2)
        centre = positions[patch].mean(axis=0)
        positions[patch, axes] = (centre + (positions[patch] - centre) * 1e-4)[:, axes]
    elif shape == "all on a line":
        positions[:, 1] = 0.5
    else:
        positions[:] = [0.5, 0.5, 0.01]
    for weld in (1e-6, 0.0):
        result = source.transfer(positions, triangles, max_distance=0.05, relative_weld_tolerance=weld)
        np.testing.assert_allclose(result.weights.to_dense().sum(axis=1), 1, atol=1e-6)


def test_cancel_is_heard_inside_a_factorisation():
    """Random triangles are no surface: their factor is one dense front."""
    source = flat_body()
    rng = np.random.default_rng(0)
    positions = rng.random((4000, 3))
    triangles = rng.integers(0, 4000, (8000, 3))
    prepared = native.Inpainting(source, positions, triangles)
    job = prepared.start(mask=(rng.random(4000) < 0.2).astype(np.uint8) * 2)
    time.sleep(0.3)
    start = time.perf_counter()
    job.cancel()
    try:
        job.result()
    except native.Cancelled:
        waited = time.perf_counter() - start
        # Generous for a busy machine; the factorisation takes seconds.
        assert waited < 2
