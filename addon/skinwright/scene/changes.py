"""Counts what happens to objects, so that others can tell by a number whether to look again."""

import bpy
from bpy.app.handlers import depsgraph_update_post, persistent, redo_post, undo_post

# How often an object, its data or its pose has changed; how often something was undone, and redone.
version = 0
undone = 0
redone = 0


@persistent
def _on_update(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    global version
    if any(
        isinstance(update.id, bpy.types.Object | bpy.types.Mesh | bpy.types.Armature) for update in depsgraph.updates
    ):
        version += 1


@persistent
def _on_undo(*_arguments: object) -> None:
    global version, undone
    version += 1
    undone += 1


@persistent
def _on_redo(*_arguments: object) -> None:
    global version, redone
    version += 1
    redone += 1


_HANDLERS = ((depsgraph_update_post, _on_update), (undo_post, _on_undo), (redo_post, _on_redo))


def register() -> None:
    """Start counting."""
    for handlers, handler in _HANDLERS:
        handlers.append(handler)


def unregister() -> None:
    """Stop."""
    for handlers, handler in _HANDLERS:
        handlers.remove(handler)
