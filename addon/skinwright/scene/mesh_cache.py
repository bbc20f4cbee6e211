"""The Mesh Cache modifier that plays a baked action after the armature."""

from pathlib import Path

import bpy

from .error import SceneError

NAME = "Refined Cache"


def check(obj: bpy.types.Object) -> None:
    """Raise SceneError where a cache of the mesh's own vertices cannot be played."""
    if obj.library or obj.data.library:
        raise SceneError(f"{obj.name} is linked from another file: make it local before a modifier is added")
    before = next((i for i, m in enumerate(obj.modifiers) if m.type == "ARMATURE"), 0)
    changing = [m.name for m in list(obj.modifiers)[:before] if m.type in {"SUBSURF", "MIRROR", "ARRAY", "BEVEL"}]
    if changing:
        raise SceneError(
            f"{obj.name} has {changing[0]} before its armature, which changes the vertices: apply it first"
        )


def play(obj: bpy.types.Object, path: Path, kind: str, first: int) -> None:
    """Add or update the modifier, right after the armature; what comes later still applies."""
    modifier = obj.modifiers.get(NAME) or obj.modifiers.new(NAME, "MESH_CACHE")
    modifier.cache_format = kind.upper()
    modifier.filepath = str(path)
    modifier.frame_start = float(first)
    modifier.deform_mode, modifier.interpolation = "OVERWRITE", "LINEAR"
    # Blender's own axes: nothing is turned.
    modifier.forward_axis, modifier.up_axis = "POS_Y", "POS_Z"
    armatures = [index for index, other in enumerate(obj.modifiers) if other.type == "ARMATURE"]
    obj.modifiers.move(list(obj.modifiers).index(modifier), armatures[-1] + 1 if armatures else 0)


def remove(obj: bpy.types.Object) -> bool:
    """Take the modifier away; whether there was one."""
    modifier = obj.modifiers.get(NAME)
    if modifier is not None:
        obj.modifiers.remove(modifier)
    return modifier is not None
