"""What a sculpt cannot be turned into weights on, and why."""

import bpy
import numpy as np
from numpy.typing import NDArray

from . import armature as scene_armature
from . import editable, mesh, vertex_groups
from .error import SceneError

# These leave every vertex where it is.
_KEEPS_SHAPE = {"WEIGHTED_NORMAL", "NORMAL_EDIT", "UV_PROJECT", "UV_WARP"}
_CHANGES_WEIGHTS = {"VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY", "DATA_TRANSFER"}
_NEARLY = 1e-3


def check(obj: bpy.types.Object) -> bpy.types.Object:
    """The armature that deforms `obj`. Raises SceneError where weights would not do what the sculpt shows."""
    if obj.type != "MESH" or not obj.data.vertices:
        raise SceneError(f"{obj.name} is no mesh with vertices: make the skinned mesh the active object")
    editable.check(obj)
    _check_sculpt_mode(obj)
    rig = _armature(obj)
    mesh.check_world(obj, rig)
    for modifier in _acting(obj):
        _check_modifier(obj, modifier)
    _check_before(obj)
    _check_bones(obj, rig)
    _check_shape_keys(obj)
    if not ruled(obj).any():
        raise SceneError(
            f"No vertex of {obj.name} is moved by exactly one Armature modifier in full: nothing to sculpt"
        )
    return rig


def ruled(obj: bpy.types.Object) -> NDArray[np.bool_]:
    """(V,) the vertices that exactly one Armature modifier moves, in full; others do not follow weights alone."""
    acting = _acting(obj)
    if len(acting) < 2 and not any(modifier.vertex_group for modifier in acting):
        return np.ones(len(obj.data.vertices), bool)
    influence = np.array([_influence(obj, modifier) for modifier in acting])
    return ((influence > 1 - _NEARLY).sum(axis=0) == 1) & ((influence > _NEARLY).sum(axis=0) == 1)


def _influence(obj: bpy.types.Object, modifier: bpy.types.ArmatureModifier) -> NDArray[np.float32]:
    """(V,) how far a modifier acts; a group that the object lacks limits nothing."""
    if modifier.vertex_group not in obj.vertex_groups:
        return np.ones(len(obj.data.vertices), np.float32)
    weights = vertex_groups.values(obj, modifier.vertex_group)
    return 1 - weights if modifier.invert_vertex_group else weights


def _acting(obj: bpy.types.Object) -> list[bpy.types.ArmatureModifier]:
    return [modifier for modifier in scene_armature.modifiers(obj) if modifier.show_viewport]


def _check_sculpt_mode(obj: bpy.types.Object) -> None:
    if obj.mode == "EDIT":
        raise SceneError(f"{obj.name} is in Edit mode: leave it first")
    if obj.use_dynamic_topology_sculpting:
        raise SceneError(f"Dyntopo is on for {obj.name} and changes its vertices: turn it off")
    multires = [m.name for m in obj.modifiers if m.type == "MULTIRES"]
    if multires:
        raise SceneError(
            f"{obj.name} has the Multiresolution modifier {multires[0]}, which keeps sculpts to itself: "
            "apply or remove it"
        )


def _armature(obj: bpy.types.Object) -> bpy.types.Object:
    """By modifiers, or by armature parenting."""
    found, acting = scene_armature.modifiers(obj), _acting(obj)
    if found and not acting:
        raise SceneError(f"The Armature modifier {found[0].name} of {obj.name} is hidden: show it in the viewport")
    rigs = {modifier.object for modifier in acting}
    if len(rigs) > 1:
        names = " and ".join(sorted(rig.name for rig in rigs))
        raise SceneError(f"{obj.name} is deformed by {names} at once: hide all Armature modifiers but those of one")
    if acting and scene_armature.deforms_as_parent(obj):
        raise SceneError(
            f"{obj.name} is deformed by {obj.parent.name} too, as its child: set the parent's type to Object"
        )
    rig = scene_armature.find(obj)
    if rig is None:
        raise SceneError(f"{obj.name} has no Armature modifier, so no weights to sculpt: give it one")
    return rig


def _check_modifier(obj: bpy.types.Object, modifier: bpy.types.ArmatureModifier) -> None:
    name = f"The Armature modifier {modifier.name} of {obj.name}"
    if not modifier.use_vertex_groups or modifier.use_bone_envelopes:
        raise SceneError(f"{name} binds by bone envelopes, which weights do not rule: bind to Vertex Groups alone")
    if modifier.use_multi_modifier:
        raise SceneError(f"{name} is mixed with the one before it: turn Multi Modifier off")


def _check_before(obj: bpy.types.Object) -> None:
    """What stands before the first Armature modifier; a Mirror is hidden for the time (switched.py)."""
    for other in obj.modifiers:
        if other.type == "ARMATURE":
            return
        if not other.show_viewport or other.type in _KEEPS_SHAPE or other.type == "MIRROR":
            continue
        if other.type not in _CHANGES_WEIGHTS:
            raise SceneError(
                f"The modifier {other.name} of {obj.name} changes the shape before the armature moves it: "
                "apply it, or hide it while you sculpt"
            )
        if other.type != "DATA_TRANSFER" or _transfers_groups(other):
            raise SceneError(
                f"The modifier {other.name} of {obj.name} changes the weights before the armature uses them: "
                "apply it or hide it"
            )


def _transfers_groups(modifier: bpy.types.DataTransferModifier) -> bool:
    return modifier.use_vert_data and "VGROUP_WEIGHTS" in modifier.data_types_verts


def _check_bones(obj: bpy.types.Object, armature: bpy.types.Object) -> None:
    deforming = scene_armature.deform_bones(armature)
    groups = [group.name for group in obj.vertex_groups if group.name in deforming]
    if not groups:
        raise SceneError(f"{obj.name} has no vertex group of a deform bone of {armature.name}: bind it first")
    for bone in (armature.data.bones[name] for name in groups):
        if bone.use_envelope_multiply:
            raise SceneError(
                f"Bone {bone.name} of {armature.name} multiplies weights by its envelope: turn Envelope Multiply off"
            )


def _check_shape_keys(obj: bpy.types.Object) -> None:
    keys = obj.data.shape_keys
    if not keys:
        return
    if not keys.use_relative:
        raise SceneError(f"{obj.name} has absolute shape keys: make them relative")
