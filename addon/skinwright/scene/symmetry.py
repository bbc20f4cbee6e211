"""Which vertex mirrors which, across the plane x = 0 of a mesh."""

import bpy
import numpy as np
from mathutils.kdtree import KDTree
from numpy.typing import NDArray

# Of the mesh's diagonal.
_TOLERANCE = 1e-4


def partners(positions: NDArray[np.float32]) -> NDArray[np.int64]:
    """(V,) the vertex at the mirrored place, itself on the plane, -1 if there is none within 1e-4 of the diagonal.

    Partners are mutual: where several vertices lie at one place, the k-th of one side belongs to the k-th of the other.
    """
    n = len(positions)
    found = np.full(n, -1, np.int64)
    if n == 0:
        return found
    tolerance = _TOLERANCE * float(np.linalg.norm(np.ptp(positions, axis=0)))
    tree = KDTree(n)
    for i, position in enumerate(positions.tolist()):
        tree.insert(position, i)
    tree.balance()
    on_plane = np.abs(positions[:, 0]) <= tolerance
    found[on_plane] = np.flatnonzero(on_plane)
    for i in np.flatnonzero(positions[:, 0] > tolerance).tolist():
        x, y, z = positions[i].tolist()
        there = sorted(index for _, index, _ in tree.find_range((-x, y, z), tolerance))
        here = sorted(index for _, index, _ in tree.find_range((x, y, z), tolerance))
        rank = here.index(i)
        if rank < len(there):
            found[i], found[there[rank]] = there[rank], i
    return found


def flipped(names: list[str]) -> NDArray[np.int64] | None:
    """(J,) the name of the other side of each, itself for one in the middle; None if a side is incomplete."""
    index = {name: j for j, name in enumerate(names)}
    pairs = [index.get(bpy.utils.flip_name(name), -1) for name in names]
    return None if -1 in pairs else np.array(pairs, np.int64)
