"""Points that lie at one place, or near one another."""

import numpy as np
from mathutils.kdtree import KDTree
from numpy.typing import NDArray

_PRIMES = np.array([73856093, 19349663, 83492791], np.int64)


def coincident(a: NDArray[np.float32], b: NDArray[np.float32], tolerance: float) -> NDArray[np.int64]:
    """For each point of `b` (n, 3) a point of `a` (m, 3) within the tolerance, -1 where there is none."""
    cell = 4 * max(tolerance, 1e-30)
    keys = _keys(a, cell, 0.0)
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    found = np.full(len(b), -1, np.int64)
    for corner in np.ndindex(2, 2, 2) if len(a) else ():
        still = np.flatnonzero(found < 0)
        wanted = _keys(b[still], cell, (2 * np.array(corner) - 1) * tolerance)
        near = order[np.minimum(np.searchsorted(ordered, wanted), len(a) - 1)]
        close = (keys[near] == wanted) & (np.linalg.norm(a[near] - b[still], axis=1) <= tolerance)
        found[still[close]] = near[close]
    return found


def numbers(positions: NDArray[np.float32]) -> NDArray[np.int64]:
    """(V,) the same number for points (V, 3) of equal coordinates, counted from 0."""
    bits = np.ascontiguousarray(positions + np.float32(0)).view(np.uint32).astype(np.int64)  # -0 is 0
    keys = ((bits * _PRIMES) ^ (bits >> 7)).sum(axis=1, dtype=np.int64)
    return np.unique(keys, return_inverse=True)[1].reshape(-1)


def connected(place: NDArray[np.int64], triangles: NDArray[np.uint32]) -> NDArray[np.int64]:
    """(V,) the same number for vertices that triangles (T, 3) connect; `place` (V,) is equal for those at one place."""
    corners = place[triangles.astype(np.int64)]
    label = np.arange(int(place.max(initial=-1)) + 1, dtype=np.int64)
    one, other = corners[:, :2].ravel(), corners[:, 1:].ravel()
    while one.size:
        one, other = label[one], label[other]
        apart = one != other
        one, other = one[apart], other[apart]
        label[np.maximum(one, other)] = np.minimum(one, other)  # of several any will do: the rest follow
        while not np.array_equal(label, following := label[label]):
            label = following
    return label[place]


def first_at_each(positions: NDArray[np.float32], tolerance: float) -> NDArray[np.int64]:
    """(V,) for each point one of those at its place, the same for all of them."""
    near = coincident(positions, positions, tolerance)
    same = near[near]  # what one cell sends on to the next
    return np.minimum(same, np.arange(len(positions), dtype=np.int64))


def _keys(points: NDArray[np.float32], cell: float, shift: float | NDArray[np.float64]) -> NDArray[np.int64]:
    return (np.floor((points.astype(np.float64) + shift) / cell).astype(np.int64) * _PRIMES).sum(axis=1, dtype=np.int64)


def tree(points: NDArray[np.float32]) -> KDTree:
    """For searches among points (n, 3), which keep their numbers."""
    found = KDTree(len(points))
    for number, point in enumerate(points.tolist()):
        found.insert(point, number)
    found.balance()
    return found


def nearest(points: NDArray[np.float32], queries: NDArray[np.float32]) -> NDArray[np.float64]:
    """(n,) how far each query (n, 3) is from the closest of the points (m, 3)."""
    return closest(points, queries)[1]


def closest(points: NDArray[np.float32], queries: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """(n,) the closest of the points (m, 3) to each query (n, 3), and how far it is."""
    near = tree(points)
    found = [near.find(query)[1:] for query in queries.tolist()]
    return np.array([index for index, _ in found], np.int64), np.array([distance for _, distance in found], np.float64)
