"""The Mirror modifiers of a mesh as plain numbers."""

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from . import modifiers


@dataclass(frozen=True)
class Reflection:
    """A mirrored copy is `world` (4, 4) times the world positions; vertices that move less than `merged` are one."""

    world: NDArray[np.float64]
    merged: float


def before_the_pose(obj: bpy.types.Object) -> list[bpy.types.MirrorModifier]:
    """The Mirror modifiers that are on and come before the armature, whose halves the weights are to move."""
    found = []
    for modifier in modifiers.shown(obj):
        if modifier.type == "ARMATURE":
            break
        if modifier.type == "MIRROR":
            found.append(modifier)
    return found


def reflections(obj: bpy.types.Object, matrix: NDArray[np.float64]) -> list[Reflection]:
    """What completes the mesh, whose place in the world is `matrix` (4, 4), in the order in which it is done.

    A modifier that cuts the mesh at its plane completes nothing: the mesh may be whole. Nor does one that leaves the
    groups as they are: its halves are to follow the same bones.
    """
    found = []
    scale = float(np.abs(np.linalg.det(matrix[:3, :3]))) ** (1 / 3)
    for modifier in before_the_pose(obj):
        if any(modifier.use_bisect_axis) or not modifier.use_mirror_vertex_groups:
            continue
        plane = np.array(modifier.mirror_object.matrix_world) if modifier.mirror_object else matrix
        merged = modifier.merge_threshold * scale if modifier.use_mirror_merge else 0.0
        for axis in np.flatnonzero(list(modifier.use_axis)):
            flip = np.eye(4)
            flip[axis, axis] = -1
            found.append(Reflection(plane @ flip @ np.linalg.inv(plane), merged))
    return found
