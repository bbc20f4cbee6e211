"""Filling: known rows -> all rows, against SciPy, against answers known by hand, and against the welded mesh."""

import numpy as np
import oracle
import pytest
import scipy.sparse as sp
import skinwright_native as native
from scipy.sparse.linalg import splu

FREE, FIXED, SOFT = 0, 1, 2
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)


def sheet(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A bent sheet of n x n jittered vertices."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n))
    x, y = x + rng.uniform(-0.2 / n, 0.2 / n, x.shape), y + rng.uniform(-0.2 / n, 0.2 / n, x.shape)
    corner = (np.arange(n - 1)[None] + n * np.arange(n - 1)[:, None]).ravel()
    quads = np.stack([corner, corner + 1, corner + n + 1, corner + n], axis=1)
    triangles = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    positions = np.stack([x.ravel(), y.ravel(), 0.3 * np.sin(5 * x.ravel())], axis=1)
    return positions.astype(np.float32), triangles.astype(np.uint32)


def split(positions: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every triangle by itself; for each new vertex the first one that is the same. The order of vertices is kept."""
    old = triangles.ravel().astype(int)
    order = np.argsort(old, kind="stable")
    place = np.empty(len(old), int)
    place[order] = np.arange(len(old))
    first = np.searchsorted(old[order], old[order])
    return positions[old[order]], place.reshape(-1, 3).astype(np.uint32), first.astype(np.uint32)


def solve(positions, triangles, kinds, rows, confidence, length):
    """The minimiser by SciPy's sparse LU with two steps of refinement."""
    S, mass = oracle.stiffness_and_mass(positions.astype(float), oracle.clean(triangles.astype(np.int64)))
    Q = (S + length**2 * S @ sp.diags(1 / mass) @ S + sp.diags(np.where(kinds == SOFT, confidence, 0))).tocsc()
    unknown, fixed = np.flatnonzero(kinds != FIXED), np.flatnonzero(kinds == FIXED)
    right = np.where(kinds == SOFT, confidence, 0)[unknown, None] * rows[unknown]
    right = right - Q[np.ix_(unknown, fixed)] @ rows[fixed]
    A = Q[np.ix_(unknown, unknown)].tocsc()
    factor = splu(A)
    X = factor.solve(right)
    for _ in range(2):
        X += factor.solve(right - A @ X)
    answer = rows.copy()
    answer[unknown] = X
    return answer


@pytest.mark.parametrize("length", [0.0, 0.05, 1.0])
@pytest.mark.parametrize("shares", [(0, 0, 1), (0.5, 0.2, 0.3), (0.9, 0, 0.1), (0.6, 0.4, 0)], ids=str)
def test_soft_and_fixed_rows_equal_scipy(length, shares):
    positions, triangles = sheet(40)
    rng = np.random.default_rng(1)
    kinds = rng.choice([FREE, FIXED, SOFT], len(positions), p=shares).astype(np.uint8)
    rows = rng.dirichlet([0.3] * 6, len(positions))
    h = rng.uniform(0.01, 0.3, len(positions))
    mass = oracle.stiffness_and_mass(positions.astype(float), triangles.astype(np.int64))[1]
    confidence = mass * (1 / h**2 + length**2 / h**4)
    found = native.fill(positions, triangles, kinds, rows, confidence=confidence, length=length)
    expected = solve(positions, triangles, kinds, rows, confidence, length)
    assert np.abs(found - expected).max() <= 1e-9
    assert np.array_equal(found[kinds == FIXED], rows[kinds == FIXED])
    np.testing.assert_allclose(found.sum(axis=1), 1, atol=1e-9)


@pytest.mark.parametrize(
    ("length", "expected"),
    [
        (0.0, [0.97173357, 0.02468831, 0.50545754, 0.31205834]),
        (1.0, [0.99807357, 0.00150002, 0.50051188, 0.06838752]),
    ],
)
def test_four_soft_vertices_with_known_answers(length, expected):
    rows = np.array([[1, 0], [0, 1], [0.5, 0.5], [0.5, 0.5]])
    h = np.array([0.1, 0.1, 0.1, 1.0])
    confidence = 0.25 * (1 / h**2 + length**2 / h**4)
    triangles = [[0, 1, 2], [1, 3, 2]]
    found = native.fill(SQUARE, triangles, [SOFT] * 4, rows, confidence=confidence, length=length)
    np.testing.assert_allclose(found, np.stack([expected, 1 - np.array(expected)], axis=1), atol=1e-8)


@pytest.mark.parametrize(
    ("length", "scale", "expected"), [(1.0, 1, 1 / 28), (2**0.5, 1, 1 / 52), (1.0, 100, 0.24985009)]
)
def test_one_free_vertex_with_known_answers(length, scale, expected):
    rows = np.array([[1, 0], [0, 1], [0.5, 0.5], [np.pi, 7]])
    found = native.fill(SQUARE * scale, [[0, 1, 2], [1, 2, 3]], [1, 1, 1, 0], rows, length=length)
    np.testing.assert_allclose(found[3], [expected, 1 - expected], atol=1e-8)


def test_any_values_are_filled_not_only_weights():
    """One column whose known values are not all equal, and one where they are."""
    positions, triangles = sheet(12)
    kinds = np.zeros(len(positions), np.uint8)
    kinds[[0, 50, 143]] = FIXED
    rows = np.zeros((len(positions), 1))
    rows[[0, 50, 143], 0] = [-3, 8, 5]
    found = native.fill(positions, triangles, kinds, rows, length=0.1)
    expected = solve(positions, triangles, kinds, rows, np.zeros(len(positions)), 0.1)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    rows[[0, 50, 143], 0] = 7
    assert (native.fill(positions, triangles, kinds, rows, length=0.1) == 7).all()


def test_a_split_mesh_gets_the_bits_of_the_welded_one():
    positions, triangles = sheet(20)
    apart, split_triangles, first = split(positions, triangles)
    rng = np.random.default_rng(2)
    kinds = rng.choice([FREE, FIXED, SOFT], len(positions), p=[0.6, 0.2, 0.2]).astype(np.uint8)
    rows, confidence = rng.random((len(positions), 3)), rng.random(len(positions))
    old = np.unique(first, return_inverse=True)[1].ravel()
    for length in (0.0, 0.1):
        whole = native.fill(positions, triangles, kinds, rows, confidence=confidence, length=length)
        # Confidences of copies add up.
        shared = confidence[old] * (first == np.arange(len(first)))
        found = native.fill(apart, split_triangles, kinds[old], rows[old], confidence=shared, length=length, weld=first)
        assert np.array_equal(found, whole[old])


def test_copies_that_disagree():
    """The first fixed row wins; soft rows count by their confidence."""
    positions = np.vstack([SQUARE, SQUARE[3:]])
    triangles, weld = [[0, 1, 2], [1, 4, 2]], [0, 1, 2, 3, 3]
    rows = np.array([[1.0], [1.0], [1.0], [2.0], [5.0]])
    found = native.fill(positions, triangles, [1, 1, 1, 1, 1], rows, weld=weld)
    assert found[:, 0].tolist() == [1, 1, 1, 2, 2]
    soft = native.fill(positions, triangles, [1, 1, 1, 2, 2], rows, confidence=[0, 0, 0, 1, 2], weld=weld)
    one = native.fill(SQUARE, [[0, 1, 2], [1, 3, 2]], [1, 1, 1, 2], [[1], [1], [1], [4]], confidence=[0, 0, 0, 3])
    np.testing.assert_allclose(soft[:, 0], [*one[:, 0], one[3, 0]], atol=1e-15)


def test_a_double_sided_card_is_solved_as_one_sheet():
    positions, triangles = sheet(10)
    twice = np.vstack([positions, positions])
    both = np.vstack([triangles, triangles[:, ::-1] + np.uint32(len(positions))])
    kinds = np.zeros(len(positions), np.uint8)
    kinds[:20] = FIXED
    rows = np.random.default_rng(3).random((len(positions), 2))
    weld = np.tile(np.arange(len(positions)), 2)
    found = native.fill(twice, both, np.tile(kinds, 2), np.tile(rows, (2, 1)), length=0.1, weld=weld)
    whole = native.fill(positions, triangles, kinds, rows, length=0.1)
    assert np.array_equal(found, np.tile(whole, (2, 1)))


def test_what_nothing_known_reaches_is_nan_and_what_hangs_on_nothing_keeps_its_row():
    positions = np.vstack([SQUARE, SQUARE + 5, [[9, 9, 9], [8, 8, 8]]])
    triangles = [[0, 1, 2], [1, 3, 2], [4, 5, 6], [5, 7, 6]]
    kinds = [1, 0, 0, 0, 0, 0, 0, 0, 2, 0]
    found = native.fill(positions, triangles, kinds, np.arange(10.0)[:, None] + 1, confidence=np.ones(10))
    np.testing.assert_array_equal(found[:, 0], [1, 1, 1, 1] + [np.nan] * 4 + [9, np.nan])


def test_same_bits_with_any_number_of_threads():
    positions, triangles = sheet(60)
    rng = np.random.default_rng(4)
    kinds = rng.choice([FREE, FIXED, SOFT], len(positions), p=[0.8, 0.1, 0.1]).astype(np.uint8)
    arguments = (positions, triangles, kinds, rng.random((len(positions), 5)))
    keywords = {"confidence": rng.random(len(positions)), "length": 0.1}
    results = [native.fill(*arguments, **keywords, threads=n) for n in (1, 2, 3)]
    assert np.array_equal(results[0], results[1]) and np.array_equal(results[0], results[2])


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"kinds": [1, 0]}, "constraints has 2 entries where 4"),
        ({"kinds": [1, 0, 3, 0]}, "kinds is 3 at vertex 2"),
        ({"rows": np.ones((3, 2))}, "rows has 3 entries where 4"),
        ({"rows": np.full((4, 2), np.nan)}, "rows has a value that is not finite at vertex 0"),
        ({"confidence": [-1, -1, -1, -1], "kinds": [1, 2, 2, 2]}, "confidence is -1"),
        ({"length": -1.0}, "length is -1"),
        ({"weld": [0, 1, 2, 9]}, "weld names vertex 9"),
        ({"weld": [0, 1]}, "weld has 2 entries"),
    ],
)
def test_bad_input_is_refused(changes, sentence):
    arguments = {"kinds": [1, 0, 0, 0], "rows": np.ones((4, 2))} | changes
    with pytest.raises(native.SkinwrightError, match=sentence):
        native.fill(SQUARE, [[0, 1, 2], [1, 3, 2]], **arguments)
