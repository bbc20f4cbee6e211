"""Blender's undo treats a session as one step.

Every stroke leaves one of Blender's own steps, which hold what a brush has moved and not what the session has made of
it. States within a session carry a flag on their object, and when undo or redo arrives at one without a session, it
goes on in the same direction until it is outside. So nothing else that the artist has done meanwhile is lost, as it
would be if the steps were taken back when the session ends.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

import bpy
from bpy.app.handlers import persistent, redo_post, undo_post

from ...scene import modes
from . import brush_session

# Beyond Blender's own limit of 256.
_MOST_STEPS = 300

_going_on = False
_back = True


class _Step(Protocol):
    """bpy.ops.ed.undo or redo."""

    def poll(self) -> bool:
        """Whether it can run now."""

    def __call__(self) -> set[str]:
        """Run it."""


@persistent
def _after_undo(*_arguments: object) -> None:
    _arrived(True)


@persistent
def _after_redo(*_arguments: object) -> None:
    _arrived(False)


def _arrived(back: bool) -> None:
    """Not from within Blender's own step: the timer comes when that is over."""
    global _back
    if _going_on or brush_session.current or not brush_session.flagged():
        return
    _back = back
    if not bpy.app.timers.is_registered(_go_on):
        bpy.app.timers.register(_go_on, first_interval=0.0)


def _go_on() -> None:
    """Leave the states within a session; should no step lead out, restore the object from what the session kept."""
    window = next(iter(bpy.context.window_manager.windows), None)
    if window is None or brush_session.current:
        return
    with bpy.context.temp_override(window=window, screen=window.screen), _no_handlers():
        step = bpy.ops.ed.undo if _back else bpy.ops.ed.redo
        if not _until_outside(step) and not _until_outside(bpy.ops.ed.undo):
            _restore()


def position() -> int | None:
    """Where Blender's undo stands, which Blender tells since 5.3."""
    stack = getattr(bpy.context.window_manager, "undo_stack", None)
    return stack.active_index if stack else None


def leave_session() -> None:
    """Undo until before the session that has just ended. Raises RuntimeError if Blender remembers no such state."""
    with _no_handlers():
        if not _until_outside(bpy.ops.ed.undo):
            raise RuntimeError("Blender no longer remembers the state before the session")


@contextmanager
def _no_handlers() -> Iterator[None]:
    """What is undone here is not followed up."""
    global _going_on
    _going_on = True
    try:
        yield
    finally:
        _going_on = False


def _until_outside(step: _Step) -> bool:
    for _ in range(_MOST_STEPS):
        if not brush_session.flagged():
            return True
        if not step.poll() or step() != {"FINISHED"}:
            return False
    return False


def _restore() -> None:
    """Blender no longer remembers the state before the session."""
    session = brush_session.ended
    for obj in brush_session.flagged():
        if session and session.target() == obj:
            session.restore()
        brush_session.unmark([obj])
        if obj.mode in ("SCULPT", "WEIGHT_PAINT"):
            modes.go_to(obj, "OBJECT")


def register() -> None:
    """Listen to undo and redo."""
    undo_post.append(_after_undo)
    redo_post.append(_after_redo)


def unregister() -> None:
    """Stop."""
    undo_post.remove(_after_undo)
    redo_post.remove(_after_redo)
    if bpy.app.timers.is_registered(_go_on):
        bpy.app.timers.unregister(_go_on)
