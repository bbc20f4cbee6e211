"""The Mesh Cache modifier that plays a baked action after the armature."""

from pathlib import Path

import bpy

from . import modifiers
from .error import SceneError

NAME = "Refined Cache"
# Of an object: the file that was baked for it last.
_BAKED = "skinwright_refined_cache"


def check(obj: bpy.types.Object) -> None:
    """Raise SceneError where a cache of the mesh's own vertices cannot be played."""
    if obj.library or obj.data.library:
        raise SceneError(f"{obj.name} is linked from another file: make it local before a modifier is added")
    render = bpy.context.scene.render
    if render.frame_map_old != render.frame_map_new:
        raise SceneError(
            f"the scene stretches time from {render.frame_map_old} to {render.frame_map_new} frames, and a cache would "
            "be stretched once more: make both numbers of Time Stretching equal first"
        )
    before = next((i for i, m in enumerate(obj.modifiers) if m.type == "ARMATURE"), 0)
    used = [m for m in list(obj.modifiers)[:before] if m.show_viewport or m.show_render]
    changing = [m.name for m in used if not modifiers.keeps_vertices(m) and m.type not in ("NODES", "TRIANGULATE")]
    if changing:
        raise SceneError(
            f"{obj.name} has {changing[0]} before its armature, which changes the vertices: apply it first"
        )


def check_file(obj: bpy.types.Object, path: Path) -> None:
    """Raise SceneError for a file that another object plays."""
    for other in bpy.data.objects:
        if other != obj and any(m.type == "MESH_CACHE" and _is(m.filepath, path) for m in other.modifiers):
            raise SceneError(f"{path} is played by {other.name}: give the cache of {obj.name} another name")


def is_own(obj: bpy.types.Object, path: Path) -> bool:
    """Whether this file was baked for `obj`, so that baking again may replace it."""
    return _is(obj.get(_BAKED, ""), path)


def _is(stored: str, path: Path) -> bool:
    return bool(stored) and Path(bpy.path.abspath(stored)).resolve() == path.resolve()


def play(obj: bpy.types.Object, path: Path, kind: str, first: int) -> None:
    """Add or update the modifier, right after the armature; what comes later still applies."""
    modifier = obj.modifiers.get(NAME) or obj.modifiers.new(NAME, "MESH_CACHE")
    modifier.cache_format = kind.upper()
    modifier.filepath = obj[_BAKED] = str(path)
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
