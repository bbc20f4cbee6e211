"""How an object is deformed now, against its shape at rest; local space of the object."""

import bpy
import numpy as np
from numpy.typing import NDArray

from . import mesh as scene_mesh


def shown(
    obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph
) -> tuple[NDArray[np.float32], NDArray[np.float32], bool]:
    """Positions and normals (V, 3) as drawn now, and whether they are: if not, those at rest.

    At rest they are where modifiers change the number of vertices. Nothing is evaluated: this may be called in drawing.
    """
    evaluated = obj.evaluated_get(depsgraph).data
    fits = len(evaluated.vertices) == len(obj.data.vertices)
    mesh = evaluated if fits else obj.data
    positions = scene_mesh.positions(mesh)
    normals = np.empty_like(positions)
    mesh.vertex_normals.foreach_get("vector", normals.ravel())
    return positions, normals, fits


def stretch(edge: NDArray[np.int32], rest: NDArray[np.float32], now: NDArray[np.float32]) -> NDArray[np.float32]:
    """(V,) base-2 logarithm of length now over length at rest, of each vertex' edge where it is farthest from 0."""
    before, after = (np.linalg.norm(x[edge[:, 0]] - x[edge[:, 1]], axis=1) for x in (rest, now))
    smallest = 1e-9 * max(float(before.max(initial=0)), 1e-30)
    ratio = np.log2(np.maximum(after, smallest) / np.maximum(before, smallest))
    most, least = np.zeros(len(rest), np.float32), np.zeros(len(rest), np.float32)
    for side in edge.T:
        np.maximum.at(most, side, ratio)
        np.minimum.at(least, side, ratio)
    return np.where(most >= -least, most, least)
