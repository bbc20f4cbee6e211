"""Armatures: which one deforms a mesh, its bones, and attaching one."""

from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Quaternion
from numpy.typing import NDArray


def modifiers(obj: bpy.types.Object) -> list[bpy.types.ArmatureModifier]:
    """The Armature modifiers that name an armature, the enabled ones first."""
    found = [m for m in obj.modifiers if m.type == "ARMATURE" and m.object]
    return sorted(found, key=lambda m: not m.show_viewport)


def find(obj: bpy.types.Object) -> bpy.types.Object | None:
    """The armature that deforms `obj`: by its first enabled modifier, or by armature parenting."""
    found = modifiers(obj)
    if found:
        return found[0].object
    if obj.parent and obj.parent.type == "ARMATURE" and obj.parent_type == "ARMATURE":
        return obj.parent
    return None


def deform_bones(armature: bpy.types.Object) -> set[str]:
    """Names of the bones that deform."""
    return {bone.name for bone in armature.data.bones if bone.use_deform}


def selected_bones(armature: bpy.types.Object) -> set[str]:
    """Names of the selected bones. The flag moved from the bone to the pose bone in Blender 5.0."""
    if bpy.app.version >= (5, 0, 0):
        return {bone.name for bone in armature.pose.bones if bone.select}
    return {bone.name for bone in armature.data.bones if bone.select}


def is_posed(armature: bpy.types.Object) -> bool:
    """Whether any bone is away from its rest pose."""
    if armature.data.pose_position == "REST":
        return False
    return any(not bone.matrix_basis.is_identity for bone in armature.pose.bones)


def attach(obj: bpy.types.Object, armature: bpy.types.Object) -> bpy.types.ArmatureModifier:
    """Add an Armature modifier: after mirroring, which needs the rest shape, and before all that builds on the pose."""
    modifier = obj.modifiers.new(armature.name, "ARMATURE")
    modifier.object = armature
    mirrors = [index for index, other in enumerate(obj.modifiers) if other.type == "MIRROR"]
    name = modifier.name
    obj.modifiers.move(len(obj.modifiers) - 1, mirrors[-1] + 1 if mirrors else 0)
    return obj.modifiers[name]


def pose_from_rest(obj: bpy.types.Object, armature: bpy.types.Object, bones: Sequence[str]) -> NDArray[np.float64]:
    """(B, 4, 4) where each bone takes a point of the mesh, in the mesh' own space (spec-sculpt, section 7).

    object_world^-1 armature_world pose rest^-1 armature_world^-1 object_world
    """
    if armature.data.pose_position == "REST":
        return np.tile(np.eye(4), (len(bones), 1, 1))
    armature_from_object = armature.matrix_world.inverted_safe() @ obj.matrix_world
    object_from_armature = armature_from_object.inverted_safe()
    pose = _matrices(armature.pose.bones, "matrix", bones)
    rest = _matrices(armature.data.bones, "matrix_local", bones)
    return np.array(object_from_armature) @ pose @ np.linalg.inv(rest) @ np.array(armature_from_object)


def _matrices(all_bones: bpy.types.bpy_prop_collection, name: str, bones: Sequence[str]) -> NDArray[np.float64]:
    """(B, 4, 4) a matrix of each of these bones: all in one call, as one by one they take five times as long."""
    columns = np.empty((len(all_bones), 4, 4), np.float32)
    all_bones.foreach_get(name, columns.ravel())
    index = {bone: i for i, bone in enumerate(all_bones.keys())}
    return columns[[index[bone] for bone in bones]].transpose(0, 2, 1).astype(np.float64)


def segments(obj: bpy.types.Object, armature: bpy.types.Object, bones: Sequence[str]) -> NDArray[np.float32]:
    """(B, 2, 3) head and tail of each bone at rest, in the mesh' own space."""
    object_from_armature = obj.matrix_world.inverted_safe() @ armature.matrix_world
    ends = [(bone.head_local, bone.tail_local) for bone in (armature.data.bones[name] for name in bones)]
    return np.array([[object_from_armature @ end for end in pair] for pair in ends], np.float32).reshape(-1, 2, 3)


def parents(armature: bpy.types.Object, bones: Sequence[str]) -> NDArray[np.int32]:
    """(B,) the nearest bone above that is in `bones` too, -1 where there is none."""
    index = {name: j for j, name in enumerate(bones)}
    above = (armature.data.bones[name].parent_recursive for name in bones)
    return np.array([next((index[p.name] for p in ps if p.name in index), -1) for ps in above], np.int32)


def local_rotations(armature: bpy.types.Object) -> dict[str, Quaternion]:
    """How each bone is turned against its parent and rest, constraints included."""
    convert = armature.convert_space
    return {
        bone.name: convert(pose_bone=bone, matrix=bone.matrix, from_space="POSE", to_space="LOCAL").to_quaternion()
        for bone in armature.pose.bones
    }
