"""Armatures: which one deforms a mesh, its bones, and attaching one."""

import bpy


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


def attach(obj: bpy.types.Object, armature: bpy.types.Object) -> None:
    """Add an Armature modifier: after mirroring, which needs the rest shape, and before all that builds on the pose."""
    modifier = obj.modifiers.new(armature.name, "ARMATURE")
    modifier.object = armature
    mirrors = [index for index, other in enumerate(obj.modifiers) if other.type == "MIRROR"]
    obj.modifiers.move(len(obj.modifiers) - 1, mirrors[-1] + 1 if mirrors else 0)
