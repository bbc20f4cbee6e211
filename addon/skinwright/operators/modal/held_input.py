"""Whose the input is: no operator sees the release that ends a stroke, but all see which operators are running."""

import bpy
from bpy.types import Context, Event, Operator

_JOBS = ("RENDER", "OBJECT_BAKE")


def by_another(context: Context, operator: type[Operator]) -> bool:
    """Whether an operator other than this one holds the input, in any window."""
    return bool(running(context) - {operator.__name__})


def running(context: Context) -> set[str]:
    """Class names of the operators that take events, in any window. Blender lists None for one whose class has gone."""
    windows = context.window_manager.windows
    return {one.bl_idname for window in windows for one in window.modal_operators if one}


def is_elsewhere(context: Context, event: Event) -> bool:
    """Whether a key is meant for something else: playback or a job, which Esc stops, or another editor."""
    if any(window.screen.is_animation_playing for window in context.window_manager.windows):
        return True
    if any(bpy.app.is_job_running(job) for job in _JOBS):
        return True
    return not any(_contains(area, event) for area in context.screen.areas if area.type == "VIEW_3D")


def _contains(area: bpy.types.Area, event: Event) -> bool:
    return 0 <= event.mouse_x - area.x < area.width and 0 <= event.mouse_y - area.y < area.height
