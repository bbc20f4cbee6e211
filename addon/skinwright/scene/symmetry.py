"""Which vertex is opposite to which, across the middle of a character."""

import numpy as np
from mathutils import Matrix
from mathutils.kdtree import KDTree
from numpy.typing import NDArray

from .mesh import transformed

# Of the diagonal.
_TOLERANCE = 1e-4


def opposite_vertices(positions: NDArray[np.float32], plane: Matrix) -> NDArray[np.int64]:
    """(V,) the vertex at the mirrored place, -1 where there is none; `plane` takes the YZ plane to the mirror.

    Vertices at one place count as one, so that being opposite goes both ways.
    """
    world = np.array(plane)
    mirrored = transformed(positions, world @ np.diag([-1.0, 1, 1, 1]) @ np.linalg.inv(world))
    _, first, same = np.unique(positions, axis=0, return_index=True, return_inverse=True)
    tree = KDTree(len(first))
    for vertex in first.tolist():
        tree.insert(positions[vertex].tolist(), vertex)
    tree.balance()
    size = float(np.linalg.norm(np.ptp(positions, axis=0)))
    opposite = np.full(len(positions), -1, np.int64)
    for vertex in first.tolist():
        _, other, distance = tree.find(mirrored[vertex].tolist())
        if other is not None and distance <= _TOLERANCE * size:
            opposite[vertex] = other
    paired = first[(opposite[first] >= 0) & (opposite[opposite[first]] == first)]
    found = np.full(len(positions), -1, np.int64)
    found[paired] = opposite[paired]
    return found[first[same.reshape(-1)]]
