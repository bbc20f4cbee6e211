"""Event timers of modal operators; when the add-on is disabled those that still run are taken away."""

import bpy
from bpy.types import Context, Timer

# For what must follow a brush: as long as Blender's main loop sleeps when nothing happens. With a timer that is no
# slower, whatever wakes the loop finds the timer due as well: its event follows the release in one queue, and weights
# are written before Blender evaluates and draws. A timer of 20 ms came after the drawing in 13 strokes of 22.
BRUSH_SECONDS = 0.005

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
