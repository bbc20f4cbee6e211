"""Vertices at one place, as a UV seam or flat shading leaves them in an imported mesh: they are sculpted as one."""

import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows

# Of the mesh's diagonal.
_TOLERANCE = 1e-6
_SAME_WEIGHT = 1e-5


class Copies:
    """`leader` (V,) is the first of the vertices that rest at one place and have the same weights."""

    def __init__(self, positions: NDArray[np.float32], rows: Rows) -> None:
        """`positions` (V, 3) at rest, `rows` their weights."""
        self.leader = _leaders(positions, rows)
        self._order = np.argsort(self.leader, kind="stable")
        self._count = np.bincount(self.leader, minlength=len(positions))
        self._start = np.cumsum(self._count, dtype=np.int64) - self._count
        self._any = bool((self._count > 1).any())

    def join(self, vertices: NDArray, positions: NDArray) -> tuple[NDArray, NDArray]:
        """`vertices` (n,) with their copies, and where they go: copies to the mean of the positions given for them."""
        if not self._any:
            return vertices, positions
        leaders, inverse = np.unique(self.leader[vertices], return_inverse=True)
        given = np.bincount(inverse, minlength=len(leaders))
        sums = [np.bincount(inverse, positions[:, axis], len(leaders)) for axis in range(3)]
        mean = (np.stack(sums, axis=1) / given[:, None]).astype(np.float32)
        count = self._count[leaders]
        within = np.arange(count.sum(), dtype=np.int64) - np.repeat(np.cumsum(count, dtype=np.int64) - count, count)
        members = self._order[np.repeat(self._start[leaders], count) + within]
        order = np.argsort(members, kind="stable")
        return members[order].astype(np.uint32), np.repeat(mean, count, axis=0)[order]


def _leaders(positions: NDArray[np.float32], rows: Rows) -> NDArray[np.int64]:
    size = float(np.linalg.norm(np.ptp(positions, axis=0))) if len(positions) else 0.0
    cell = np.round(positions.astype(np.float64) / max(size * _TOLERANCE, 1e-30)).astype(np.int64)
    _, first, place = np.unique(cell, axis=0, return_index=True, return_inverse=True)
    leader = first[place.reshape(-1)].astype(np.int64)
    copies = np.flatnonzero(leader != np.arange(len(leader), dtype=np.int64))
    differ = copies[~_same(rows, copies, leader[copies])]
    leader[differ] = differ
    return leader


def _same(rows: Rows, a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(n,) whether rows a[k] and b[k] are alike."""
    first, second = csr.take_rows(rows, a), csr.take_rows(rows, b)
    counts = np.diff(first.indptr)
    same = counts == np.diff(second.indptr)
    first, second = (csr.take_rows(side, np.flatnonzero(same)) for side in (first, second))
    differs = (first.bones != second.bones) | (np.abs(first.values - second.values) > _SAME_WEIGHT)
    kept = np.flatnonzero(same)
    same[kept[csr.entry_vertices(first)[differs]]] = False
    return same
