"""Changing the mode of one object, whichever is active and whichever window asks."""

from collections.abc import Iterator
from contextlib import contextmanager

import bpy


def go_to(obj: bpy.types.Object, mode: str) -> None:
    """Put `obj` into `mode` if it is in another; the active object stays. Raises RuntimeError if Blender refuses.

    So it does for an object in Object mode that is hidden, but out of another mode a hidden object comes.
    """
    if obj.mode == mode:
        return
    with _in_window_of(obj) as layer:
        active = layer.objects.active
        layer.objects.active = obj
        try:
            bpy.ops.object.mode_set(mode=mode)
        finally:
            if active and active != obj:
                layer.objects.active = active


@contextmanager
def _in_window_of(obj: bpy.types.Object) -> Iterator[bpy.types.ViewLayer]:
    """A context in which `obj` can be made active: in the present window if possible, else in one that shows it, else
    in a scene that no window shows."""
    context = bpy.context
    windows = list(context.window_manager.windows)
    if context.window:
        windows.sort(key=lambda window: window != context.window)
    window = next((w for w in windows if obj.name in w.view_layer.objects), None)
    if window:
        with context.temp_override(window=window, screen=window.screen):
            yield window.view_layer
        return
    places = ((scene, layer) for scene in bpy.data.scenes for layer in scene.view_layers)
    scene, layer = next(
        (place for place in places if obj.name in place[1].objects), (context.scene, context.view_layer)
    )
    with context.temp_override(scene=scene, view_layer=layer):
        yield layer
