"""What Blender lets be written and then does not keep, and what is written to several objects at once."""

from collections.abc import Iterable

import bpy

from . import mesh
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


def shared(obj: bpy.types.Object, others: Iterable[bpy.types.Object]) -> str:
    """Why weights of `obj` would be those of one of `others` too, or nothing."""
    other = next((other for other in others if other.data == obj.data and other != obj), None)
    return f"{other.name} and {obj.name} share one mesh and so its weights: make it single-user first" if other else ""


def check_separate(targets: Iterable[bpy.types.Object], sources: Iterable[bpy.types.Object] = ()) -> None:
    """Raise SceneError for a target that shares its mesh with another or with a source."""
    targets = list(targets)
    problems = [shared(target, (*sources, *targets)) for target in targets]
    if any(problems):
        raise SceneError(next(filter(None, problems)))


def changes_others(obj: bpy.types.Object) -> str:
    """The warning that weights written to `obj` are those of other objects too, or nothing."""
    others = mesh.other_users(obj)
    return f"{obj.name} shares its mesh with {', '.join(others)}, whose weights changed too" if others else ""


def collection(context: bpy.types.Context) -> bpy.types.Collection:
    """Where new objects go: the active collection, or the scene's where that is of a library and takes nothing in."""
    active = context.collection
    return active if active.is_editable and not active.override_library else context.scene.collection
