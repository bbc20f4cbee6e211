"""Objects that Blender does not evaluate: excluded, disabled in the viewport, in another scene."""

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager

import bpy


def bring_up_to_date(objects: Iterable[bpy.types.Object]) -> None:
    """Let the world matrices and poses of these objects be the present ones.

    An object that Blender does not evaluate keeps those of the last time that it did, which after loading a file is
    never: its matrix is then the unit matrix, whatever its parents, and its bones are at rest.
    """
    layer = bpy.context.view_layer
    layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    stale = [obj for obj in dict.fromkeys(objects) if not obj.evaluated_get(depsgraph).is_evaluated]
    if not stale:
        return
    with ExitStack() as stack:
        for obj in stale:
            stack.enter_context(_shown(obj))
        layer.update()
    # Blender frees the layer's list of objects when next it needs it, which may be while somebody goes through it.
    layer.update()


@contextmanager
def _shown(obj: bpy.types.Object) -> Iterator[None]:
    """Have the object in this scene and enabled for the moment."""
    objects = bpy.context.scene.collection.objects
    is_disabled, is_added = obj.hide_viewport, obj.name not in objects or objects[obj.name] != obj
    if is_added:
        objects.link(obj)
    try:
        obj.hide_viewport = False
        yield
    finally:
        obj.hide_viewport = is_disabled
        if is_added:
            objects.unlink(obj)
