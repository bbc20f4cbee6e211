"""The Mirror modifiers of a mesh as plain numbers."""

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from . import armature, modifiers, sides


@dataclass(frozen=True)
class Reflection:
    """A mirrored copy is `world` (4, 4) times the world positions; vertices that move less than `merged` are one.

    `flips` if the copy's groups are those of the other side; `name` is the modifier's.
    """

    world: NDArray[np.float64]
    merged: float
    flips: bool
    name: str


def before_the_pose(obj: bpy.types.Object) -> list[bpy.types.MirrorModifier]:
    """The Mirror modifiers before the armature, on in the viewport or in renders: weights are to move their halves."""
    posed = _of_the_pose(obj)
    return [m for m in modifiers.used(obj) if m.type == "MIRROR" and m not in posed]


def after_the_pose(obj: bpy.types.Object) -> list[bpy.types.MirrorModifier]:
    """The Mirror modifiers that come after an armature, in the viewport or in renders: they mirror its pose."""
    return [m for m in _of_the_pose(obj) if m.show_viewport or m.show_render]


def warning(
    obj: bpy.types.Object,
    matrix: NDArray[np.float64],
    positions: NDArray[np.float32],
    rig: bpy.types.Object | None,
    opposite: dict[str, str],
) -> str:
    """Why a half that a Mirror modifier adds will not follow the bones of its side, or nothing.

    Half a mesh gets the other half's weights by the groups' names.
    """
    posed = after_the_pose(obj)
    if posed:
        return (
            f"The modifier {posed[0].name} of {obj.name} comes after the armature, so that the half it makes mirrors "
            "the pose of the other: move it above the Armature modifier and try again"
        )
    wrong = [found for found in reflections(obj, matrix, positions) if not is_right(found, rig, opposite)]
    if not wrong:
        return ""
    named = wrong[0].name
    if not wrong[0].flips:
        return f"Vertex Groups is off in the modifier {named} of {obj.name}: both sides will follow the bones of one"
    if sides.exchanged(rig, opposite, wrong[0].world) is False:
        return (
            f"The modifier {named} of {obj.name} exchanges left and right in a copy that lies on the same side: "
            "apply it and try again"
        )
    name = sides.unflippable(opposite)
    return (
        f"The modifier {named} of {obj.name} cannot tell that {opposite[name]} mirrors {name}, "
        "so both sides will follow the bones of one: apply it and try again, or rename the bones"
    )


def _of_the_pose(obj: bpy.types.Object) -> list[bpy.types.MirrorModifier]:
    """Those after the first armature. One that deforms as a parent comes before all modifiers."""
    is_posed = armature.deforms_as_parent(obj) and obj.parent.type == "ARMATURE"
    found = []
    for modifier in obj.modifiers:
        is_posed = is_posed or (modifier.type == "ARMATURE" and bool(modifier.object) and modifier.show_viewport)
        if is_posed and modifier.type == "MIRROR":
            found.append(modifier)
    return found


def reflections(obj: bpy.types.Object, matrix: NDArray[np.float64], positions: NDArray[np.float32]) -> list[Reflection]:
    """What completes the mesh, whose place in the world is `matrix` (4, 4) and whose vertices lie at `positions` (V, 3)
    there, in the order in which it is done.

    A modifier that cuts the mesh at its plane completes nothing if there is something to be cut off.
    """
    found = []
    scale = float(np.abs(np.linalg.det(matrix[:3, :3]))) ** (1 / 3)
    for modifier in before_the_pose(obj):
        plane = np.array(modifier.mirror_object.matrix_world) if modifier.mirror_object else matrix
        merged = modifier.merge_threshold * scale if modifier.use_mirror_merge else 0.0
        for axis in np.flatnonzero(list(modifier.use_axis)).tolist():
            if _cuts_off(modifier, axis, plane, positions, merged):
                continue
            flip = np.eye(4)
            flip[axis, axis] = -1
            world = plane @ flip @ np.linalg.inv(plane)
            found.append(Reflection(world, merged, modifier.use_mirror_vertex_groups, modifier.name))
    return found


def _cuts_off(
    modifier: bpy.types.MirrorModifier,
    axis: int,
    plane: NDArray[np.float64],
    positions: NDArray[np.float32],
    merged: float,
) -> bool:
    """Whether the modifier throws away what lies on the other side of the plane, and there is something."""
    if not modifier.use_bisect_axis[axis]:
        return False
    inverse = np.linalg.inv(plane)
    side = positions @ inverse[axis, :3] + inverse[axis, 3]
    side = -side if modifier.use_bisect_flip_axis[axis] else side
    scale = float(np.abs(np.linalg.det(plane[:3, :3]))) ** (1 / 3)
    return bool(side.min(initial=0) < -(modifier.bisect_threshold + merged / scale + 1e-6))


def is_right(reflection: Reflection, rig: bpy.types.Object | None, opposite: dict[str, str]) -> bool:
    """Whether the copy's groups are those of the side it lies on; `opposite` has the other side's bone of each."""
    if reflection.flips and sides.unflippable(opposite):
        return False
    exchanged = sides.exchanged(rig, opposite, reflection.world)
    if exchanged is None:  # then only names can tell
        return reflection.flips or all(name == other for name, other in opposite.items())
    return exchanged == reflection.flips
