"""Event timers of modal operators; when the add-on is disabled those that still run are taken away."""

import bpy
from bpy.types import Context, Timer

_running: list[Timer] = []


def start(context: Context, seconds: float) -> Timer:
    """A timer in the context's window."""
    timer = context.window_manager.event_timer_add(seconds, window=context.window)
    _running.append(timer)
    return timer


def stop(timer: Timer) -> None:
    """Harmless for one that has been taken away already."""
    if timer in _running:
        _running.remove(timer)
        bpy.context.window_manager.event_timer_remove(timer)


def register() -> None:
    """Nothing runs yet."""


def unregister() -> None:
    """Stop all; Blender ends the operators when their classes go."""
    while _running:
        stop(_running[-1])
