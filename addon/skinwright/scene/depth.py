"""How deep points are inside a surface."""

import numpy as np
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray

from .mesh import Geometry


def inside(points: NDArray[np.float32], surface: Geometry) -> NDArray[np.float32]:
    """(P,) distance below the closest face of the surface, 0 outside; world units."""
    tree = BVHTree.FromPolygons(surface.positions.tolist(), surface.triangles.tolist(), all_triangles=True)
    depth = np.zeros(len(points), np.float32)
    for i, point in enumerate(points.tolist()):
        closest, normal, _, _ = tree.find_nearest(point)
        if closest is not None:
            depth[i] = max(0.0, sum(n * (c - p) for n, c, p in zip(normal, closest, point, strict=True)))
    return depth
