"""Which way the faces of a mesh look: outward, unless it is inside out."""

import numpy as np
from numpy.typing import NDArray

from . import places

# A part whose faces look one way rather than all around is a patch, and has no inside: the most of its area that its
# sum of normals may be.
_MOST_ONE_SIDED = 0.5
# Flatter ones enclose nothing, in volume per area^1.5.
_LEAST_VOLUME = 1e-3
# Parts that are looked at as what others may lie in, the largest.
_MOST_AROUND = 100


def outward(positions: NDArray[np.float32], triangles: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """The triangles (T, 3) of points (V, 3), turned over in the parts that are inside out.

    Parts are what triangles connect, over seams too. One that lies within another, such as a lining or a mouth, looks
    the way it looks: it is turned only along with the other.
    """
    if not len(triangles):
        return triangles
    label = places.connected(places.numbers(positions), triangles)[triangles[:, 0]]
    part = np.unique(label, return_inverse=True)[1].reshape(-1)
    turned = _turned(positions, triangles, part)
    if not turned.any():
        return triangles
    return np.where(turned[part][:, None], triangles[:, ::-1], triangles)


def _turned(
    positions: NDArray[np.float32], triangles: NDArray[np.uint32], part: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """(P,) whether a part is to be turned over, the largest first."""
    is_inside_out = _inside_out(positions, triangles, part)
    turned = np.zeros(len(is_inside_out), bool)
    if not is_inside_out.any():
        return turned
    low, high = _bounds(positions[triangles], part)
    order = np.argsort(-np.linalg.norm(high - low, axis=1), kind="stable")
    for rank, number in enumerate(order.tolist()):
        around = order[: min(rank, _MOST_AROUND)]
        holds = ((low[around] <= low[number]) & (high[around] >= high[number])).all(axis=1)
        outer = around[holds]
        turned[number] = turned[outer[-1]] if outer.size else is_inside_out[number]
    return turned


def _inside_out(
    positions: NDArray[np.float32], triangles: NDArray[np.uint32], part: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """(P,) whether the part encloses a negative volume, seen from the middle of its faces."""
    corners = positions[triangles].astype(np.float64)
    a, b, c = corners.transpose(1, 0, 2)
    normals, n = np.cross(b - a, c - a) / 2, int(part.max()) + 1
    sizes = np.linalg.norm(normals, axis=1)
    area = np.maximum(np.bincount(part, sizes, n), 1e-300)
    middle = _sums((a + b + c) / 3 * sizes[:, None], part, n) / area[:, None]
    volume = np.bincount(part, np.einsum("ti,ti->t", (a + b + c) / 3 - middle[part], normals) / 3, n)
    one_sided = np.linalg.norm(_sums(normals, part, n), axis=1) / area
    return (volume < -_LEAST_VOLUME * area**1.5) & (one_sided < _MOST_ONE_SIDED)


def _sums(values: NDArray[np.float64], part: NDArray[np.int64], n: int) -> NDArray[np.float64]:
    """(P, 3) of the rows (T, 3) of each part."""
    return np.stack([np.bincount(part, column, n) for column in values.T], axis=1)


def _bounds(corners: NDArray[np.float32], part: NDArray[np.int64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Lowest and highest coordinates (P, 3) of each part, whose triangles are `corners` (T, 3, 3)."""
    order = np.argsort(part, kind="stable")
    starts = np.flatnonzero(np.diff(part[order], prepend=-1))
    ordered = corners[order]
    return np.minimum.reduceat(ordered.min(axis=1), starts), np.maximum.reduceat(ordered.max(axis=1), starts)
