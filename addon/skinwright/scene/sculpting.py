"""What a sculpt cannot be turned into weights on, and why."""

import bpy

from . import armature as scene_armature
from .error import SceneError


def check(obj: bpy.types.Object) -> bpy.types.Object:
    """The armature that deforms `obj`. Raises SceneError where weights would not do what the sculpt shows."""
    if obj.type != "MESH" or not obj.data.vertices:
        raise SceneError(f"{obj.name} is no mesh with vertices: make the skinned mesh the active object")
    check_editable(obj)
    _check_sculpt_mode(obj)
    modifier = _armature_modifier(obj)
    _check_modifier(obj, modifier)
    _check_bones(obj, modifier.object)
    _check_shape_keys(obj)
    return modifier.object


def check_editable(obj: bpy.types.Object) -> None:
    """Raise SceneError for linked data: what is written there is lost on reload."""
    for data in (obj, obj.data):
        if not data.is_editable:
            origin = data.library.filepath if data.library else "another file"
            raise SceneError(f"{obj.name} is linked from {origin}: make it local or a library override with its mesh")


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


def _armature_modifier(obj: bpy.types.Object) -> bpy.types.ArmatureModifier:
    found = [m for m in obj.modifiers if m.type == "ARMATURE" and m.object]
    if not found:
        raise SceneError(f"{obj.name} has no Armature modifier, so no weights to sculpt: give it one")
    shown = [m for m in found if m.show_viewport]
    if not shown:
        raise SceneError(f"The Armature modifier {found[0].name} of {obj.name} is hidden: show it in the viewport")
    if len(shown) > 1:
        raise SceneError(f"{obj.name} is deformed by {len(shown)} Armature modifiers: hide all but one")
    return shown[0]


def _check_modifier(obj: bpy.types.Object, modifier: bpy.types.ArmatureModifier) -> None:
    name = f"The Armature modifier {modifier.name} of {obj.name}"
    if modifier.use_deform_preserve_volume:
        raise SceneError(
            f"{name} preserves volume: it turns vertices about bones instead of mixing positions, so weights "
            "that reach a sculpt cannot be computed exactly; turn Preserve Volume off"
        )
    if not modifier.use_vertex_groups or modifier.use_bone_envelopes:
        raise SceneError(f"{name} binds by bone envelopes, which weights do not rule: bind to Vertex Groups alone")
    if modifier.vertex_group:
        raise SceneError(f"{name} acts through the group {modifier.vertex_group} only: clear it for the time being")
    for other in obj.modifiers:
        if other == modifier:
            return
        if other.show_viewport:
            raise SceneError(
                f"The modifier {other.name} of {obj.name} changes the shape before the armature moves it: "
                "apply it, hide it or move it below the Armature modifier"
            )


def _check_bones(obj: bpy.types.Object, armature: bpy.types.Object) -> None:
    deforming = scene_armature.deform_bones(armature)
    groups = [group.name for group in obj.vertex_groups if group.name in deforming]
    if not groups:
        raise SceneError(f"{obj.name} has no vertex group of a deform bone of {armature.name}: bind it first")
    for bone in (armature.data.bones[name] for name in groups):
        if bone.bbone_segments > 1:
            raise SceneError(f"Bone {bone.name} of {armature.name} bends: set its Bendy Bones Segments to 1")
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
    if obj.active_shape_key != keys.reference_key:
        raise SceneError(
            f"The shape key {obj.active_shape_key.name} of {obj.name} is active, so a sculpt would go into it: "
            f"make {keys.reference_key.name} the active one"
        )
    mixed = [key.name for key in keys.key_blocks[1:] if not key.mute and key.value != 0]
    if mixed:
        raise SceneError(f"The shape key {mixed[0]} of {obj.name} changes its shape at rest: set it to 0 or mute it")
