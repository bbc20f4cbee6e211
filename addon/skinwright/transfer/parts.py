"""What belongs together: meshes whose borders lie on each other. Numpy on world positions."""

from collections.abc import Callable, Sequence
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows
from ..scene.faces import Quads
from ..scene.mesh import Geometry
from ..scene.places import coincident, numbers

# Of the diagonal; single precision leaves that much where objects have places of their own.
_TOLERANCE = 1e-6
# Two or three points touch by chance.
_FEWEST = 3


def groups(geometries: Sequence[Geometry]) -> list[list[int]]:
    """The numbers of geometries that continue one another, directly or by others; each once."""
    root = list(range(len(geometries)))
    border_of = cache(lambda number: border(geometries[number]))
    for a, b in combinations(range(len(geometries)), 2):
        if _root(root, a) != _root(root, b) and _continue(geometries, border_of, a, b):
            root[_root(root, b)] = _root(root, a)
    found: dict[int, list[int]] = {}
    for number in range(len(geometries)):
        found.setdefault(_root(root, number), []).append(number)
    return list(found.values())


def _root(root: list[int], number: int) -> int:
    while root[number] != number:
        number = root[number]
    return number


def _continue(geometries: Sequence[Geometry], border_of: Callable[[int], NDArray[np.bool_]], a: int, b: int) -> bool:
    """Whether two share border points and hardly any others: a copy of the same surface does not continue it."""
    one, other = geometries[a], geometries[b]
    (low_a, high_a), (low_b, high_b) = one.bounds, other.bounds
    tolerance = _tolerance(one, other)
    if (np.maximum(low_a - high_b, low_b - high_a) > tolerance).any():
        return False
    twin = coincident(one.positions, other.positions, tolerance)
    shared = twin >= 0
    if shared.sum() < _FEWEST:
        return False
    both = shared & border_of(b) & border_of(a)[twin]
    return int(both.sum()) >= _FEWEST and int((shared & ~both).sum()) <= 0.1 * both.sum()


def _tolerance(a: Geometry, b: Geometry) -> float:
    diagonal = float(np.linalg.norm(np.maximum(a.size, b.size)))
    farthest = max(float(np.abs(corner).max()) for geometry in (a, b) for corner in geometry.bounds)
    return max(_TOLERANCE * diagonal, 4e-7 * farthest)


def border(geometry: Geometry) -> NDArray[np.bool_]:
    """(V,) the vertices on edges of one face only, once vertices at one place are counted as one."""
    same = numbers(geometry.positions)
    corners = same[geometry.triangles.astype(np.int64)]
    edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    keys, count = np.unique(edges[:, 0] * np.int64(len(same)) + edges[:, 1], return_counts=True)
    single = keys[count == 1]
    marked = np.zeros(int(same.max(initial=0)) + 1, bool)
    marked[single // len(same)] = marked[single % len(same)] = True
    return marked[same]


def united(geometries: Sequence[Geometry]) -> Geometry:
    """One geometry of them all, one after the other."""
    if len(geometries) == 1:
        return geometries[0]
    starts = np.cumsum([0, *(len(geometry.positions) for geometry in geometries)], dtype=np.int64)
    placed = list(zip(geometries, starts, strict=False))
    counts = np.cumsum([0, *(len(geometry.triangles) for geometry in geometries)], dtype=np.int64)
    quads = [geometry.quads for geometry in geometries]
    return Geometry(
        np.concatenate([geometry.positions for geometry in geometries]),
        np.concatenate([geometry.triangles + np.uint32(start) for geometry, start in placed]),
        np.concatenate([geometry.wires + np.uint32(start) for geometry, start in placed]),
        Quads(
            np.concatenate([each.corners + np.uint32(start) for each, start in zip(quads, starts, strict=False)]),
            np.concatenate([each.first + count for each, count in zip(quads, counts, strict=False)]),
        ),
    )


def united_rows(rows: Sequence[Rows]) -> Rows:
    """One set of rows, one after the other; their columns are the same."""
    if len(rows) == 1:
        return rows[0]
    counts = np.concatenate([np.diff(each.indptr) for each in rows])
    indptr = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]).astype(np.uint32)
    bones, values = (np.concatenate([getattr(each, name) for each in rows]) for name in ("bones", "values"))
    return csr.Rows(indptr, bones, values)
