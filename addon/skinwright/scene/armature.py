"""Armatures: which one deforms a mesh, its bones, and attaching one."""

import math
from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Quaternion
from numpy.typing import NDArray

# Settings of an Armature modifier that decide what weights do.
BINDING = (
    "use_deform_preserve_volume",
    "use_multi_modifier",
    "use_vertex_groups",
    "use_bone_envelopes",
    "vertex_group",
    "invert_vertex_group",
)


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


def rigs(obj: bpy.types.Object) -> list[bpy.types.Object]:
    """The armatures that deform `obj`: by its enabled modifiers, or by armature parenting."""
    found = [m.object for m in obj.modifiers if m.type == "ARMATURE" and m.object and m.show_viewport]
    parent = obj.parent
    if parent and parent.type == "ARMATURE" and obj.parent_type == "ARMATURE":
        found.append(parent)
    return list(dict.fromkeys(found))


def deformed_meshes(armatures: Sequence[bpy.types.Object]) -> list[bpy.types.Object]:
    """The visible meshes that one of these armatures deforms."""
    objects = list(bpy.context.view_layer.objects)  # asking for visibility may renew the list
    return [o for o in objects if o.type == "MESH" and o.visible_get() and set(rigs(o)) & set(armatures)]


def masking_groups(obj: bpy.types.Object) -> set[str]:
    """The groups that its Armature modifiers are limited to."""
    return {m.vertex_group for m in modifiers(obj) if m.show_viewport and m.vertex_group}


def moving(objects: Sequence[bpy.types.Object]) -> list[bpy.types.Object]:
    """Every armature that moves one of these objects: as deformer, as parent or by a constraint."""
    found: list[bpy.types.Object] = []
    for obj in objects:
        ancestor: bpy.types.Object | None = obj
        while ancestor:
            found += [rig for rig in (*rigs(ancestor), ancestor.parent) if rig]
            found += [target for constraint in ancestor.constraints for target in constraint_targets(constraint)]
            ancestor = ancestor.parent
    return [rig for rig in dict.fromkeys(found) if rig.type == "ARMATURE"]


def envelopes(obj: bpy.types.Object) -> str:
    """What, beside weights, lets bones deform `obj` where they are near: a phrase, or nothing."""
    for modifier in modifiers(obj):
        if modifier.show_viewport and not modifier.use_vertex_groups:
            return f"is bound by bone envelopes and not by groups in the modifier {modifier.name}"
        if modifier.show_viewport and modifier.use_bone_envelopes:
            return f"is bound by bone envelopes too in the modifier {modifier.name}"
    groups = {group.name for group in obj.vertex_groups}
    bones = (bone for rig in rigs(obj) for bone in rig.data.bones if bone.use_deform and bone.name in groups)
    multiplied = [bone.name for bone in bones if bone.use_envelope_multiply]
    return f"follows the bone {multiplied[0]}, whose Envelope Multiply is on" if multiplied else ""


def constraint_targets(constraint: bpy.types.Constraint) -> list[bpy.types.Object]:
    """The objects a constraint that is on follows."""
    if constraint.mute or constraint.influence == 0:
        return []
    several = [target.target for target in constraint.targets] if constraint.type == "ARMATURE" else []
    return [target for target in (*several, getattr(constraint, "target", None)) if target]


def is_posed(armature: bpy.types.Object) -> bool:
    """Whether any bone is away from its rest pose by more than importers' rounding, 1e-5 of the armature's size.

    Where constraints, drivers and animation have put the bones counts, not what their channels hold. If the armature
    has deform bones, they alone count.
    """
    data = armature.data
    if data.pose_position == "REST" or not data.bones:
        return False
    names = sorted(deform_bones(armature)) or data.bones.keys()
    pose, rest = _matrices(armature.pose.bones, "matrix", names), _matrices(data.bones, "matrix_local", names)
    length = np.array([data.bones[name].length for name in names])
    heads = rest[:, :3, 3]
    size = float(np.linalg.norm(np.ptp(heads, axis=0))) + float(length.max())
    # The ends of each bone's axes, as long as the bone is.
    moved = (
        np.abs(pose - rest)[:, :3, :] * np.concatenate([np.tile(length, (3, 1)), np.ones((1, len(names)))]).T[:, None]
    )
    return bool(moved.max() > 1e-5 * size)


def deforms_as_parent(obj: bpy.types.Object) -> bool:
    """Whether the parent of `obj` deforms it without a modifier: an armature, a lattice or a curve."""
    kinds = ("ARMATURE", "LATTICE", "CURVE")
    return bool(obj.parent and obj.parent.type in kinds and obj.parent_type in ("ARMATURE", "LATTICE", "CURVE"))


def follows_any(obj: bpy.types.Object, rigs: Sequence[bpy.types.Object]) -> bool:
    """Whether an armature deforms `obj`, or one of `rigs` would if its modifier were not hidden."""
    deforming = [m.object for m in modifiers(obj) if m.show_viewport or m.object in rigs]
    return bool(deforming) or (obj.parent_type == "ARMATURE" and find(obj) == obj.parent)


def pose_from_rest(obj: bpy.types.Object, armature: bpy.types.Object, bones: Sequence[str]) -> NDArray[np.float64]:
    """(B, 4, 4) where each bone takes a point of the mesh, in the mesh's own space.

    object_world^-1 armature_world pose rest^-1 armature_world^-1 object_world
    """
    if armature.data.pose_position == "REST":
        return np.tile(np.eye(4), (len(bones), 1, 1))
    armature_from_object = armature.matrix_world.inverted_safe() @ obj.matrix_world
    object_from_armature = armature_from_object.inverted_safe()
    pose = _matrices(armature.pose.bones, "matrix", bones)
    rest = _matrices(armature.data.bones, "matrix_local", bones)
    return np.array(object_from_armature) @ pose @ np.linalg.inv(rest) @ np.array(armature_from_object)


def world_pose(rigs: Sequence[bpy.types.Object], bones: Sequence[str]) -> NDArray[np.float64]:
    """(B, 4, 4) where each bone takes a point of the world that it carries, as the armatures are posed now."""
    found = np.tile(np.eye(4), (len(bones), 1, 1))
    for rig in reversed(rigs):
        known = [column for column, name in enumerate(bones) if name in rig.data.bones]
        names, world = [bones[column] for column in known], np.array(rig.matrix_world)
        pose, rest = _matrices(rig.pose.bones, "matrix", names), _matrices(rig.data.bones, "matrix_local", names)
        found[known] = world @ pose @ np.linalg.inv(rest) @ np.linalg.inv(world)
    return found


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


def rotation_limits(armature: bpy.types.Object, bone: str) -> dict[str, tuple[float, float]]:
    """Least and greatest angle (radians) about each of the bone's axes "X", "Y" and "Z" that its limits allow.

    Locks count unless other constraints move the bone: then they keep hands off it, and do not say how it turns.
    """
    pose = armature.pose.bones[bone]
    active = [constraint for constraint in pose.constraints if not constraint.mute]
    limiting = [c for c in active if c.type == "LIMIT_ROTATION" and c.owner_space == "LOCAL"]
    limits = {}
    for k, axis in enumerate("XYZ"):
        letter = axis.lower()
        ranges = [(-math.pi, math.pi)]
        if len(active) == len(limiting) and (pose.lock_rotation[k] or getattr(pose, f"lock_ik_{letter}")):
            ranges.append((0.0, 0.0))
        if getattr(pose, f"use_ik_limit_{letter}"):
            ranges.append((getattr(pose, f"ik_min_{letter}"), getattr(pose, f"ik_max_{letter}")))
        limited = [c for c in limiting if getattr(c, f"use_limit_{letter}")]
        ranges += [(getattr(c, f"min_{letter}"), getattr(c, f"max_{letter}")) for c in limited]
        limits[axis] = max(low for low, _ in ranges), min(high for _, high in ranges)
    return limits
