"""What Blender lets be written and then does not keep: linked data, and the meshes of library overrides."""

import bpy

from .error import SceneError


def problem(obj: bpy.types.Object) -> str:
    """Why what is written to an object and its mesh would be lost when the file is opened again, or nothing."""
    for data in filter(None, (obj, obj.data)):
        if not data.is_editable:
            origin = data.library.filepath if data.library else "another file"
            return f"{obj.name} is linked from {origin}: make it local, or an override whose mesh is local"
    if obj.data and obj.data.override_library:
        return f"The mesh of {obj.name} is a library override, of which files keep no weights: make the mesh local"
    return ""


def check(obj: bpy.types.Object) -> None:
    """Raise SceneError where what is written would be lost."""
    if why := problem(obj):
        raise SceneError(why)
