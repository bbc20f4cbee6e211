"""No session without its operator: a window that closes hands it on, and a file that is loaded or saved knows none."""

import bpy
from bpy.app.handlers import load_post, load_post_fail, load_pre, persistent, save_post, save_post_fail, save_pre

from ... import reporting
from ...scene import modes
from . import brush_session, ending, held_input, status
from .brush_session import BrushSession
from .ending import Ending

_WATCH_SECONDS = 1.0

# While a file is loaded operators are cancelled, and what they worked on goes with the old file.
_loading = False
# While a file is saved: the session, and whether its object was under the brush.
_saving: tuple[BrushSession, bool] | None = None
# Names of the scenes whose overlay of a match is hidden meanwhile.
_overlays: list[str] = []


def start() -> None:
    """Watch over the session that begins."""
    if not bpy.app.timers.is_registered(_watch):
        bpy.app.timers.register(_watch, first_interval=_WATCH_SECONDS)


def orphan(session: BrushSession) -> None:
    """The operator has been cancelled: after what Blender is about, another takes over."""
    session.orphaned = True
    if _loading:
        _forget()
    elif not bpy.app.timers.is_registered(_hand_on):
        bpy.app.timers.register(_hand_on, first_interval=0.0)


def _watch() -> float | None:
    """Should an operator be gone without a word, that is noticed here."""
    session = brush_session.current
    if session is None:
        return None
    if _class_name(session) not in held_input.running(bpy.context):
        orphan(session)
    return _WATCH_SECONDS


def _hand_on() -> None:
    """Go on in another window; where that fails, end with the work kept."""
    session = brush_session.current
    if session is None or not session.orphaned:
        return
    window = next((window for window in _windows() if _view(window)), None) or next(iter(_windows()), None)
    if window is None:
        return  # Blender quits
    area = _view(window) or window.screen.areas[0]
    with bpy.context.temp_override(window=window, area=area, region=area.regions[-1]):
        operator = getattr(bpy.ops.skinwright, session.operator.split(".")[1])
        try:
            handed_on = session.target() is not None and operator("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
        except RuntimeError:
            handed_on = False
        if not handed_on:
            ending.remember(session.label, ending.end(bpy.context, session, Ending.ASIDE))
            bpy.ops.ed.undo_push(message=session.label)


def _class_name(session: BrushSession) -> str:
    module, name = session.operator.split(".")
    return f"{module.upper()}_OT_{name}"


def _windows() -> list[bpy.types.Window]:
    return list(bpy.context.window_manager.windows)


def _view(window: bpy.types.Window) -> bpy.types.Area | None:
    return next((area for area in window.screen.areas if area.type == "VIEW_3D"), None)


def _forget() -> None:
    if brush_session.current:
        brush_session.current.forget()
    brush_session.forget()


@persistent
def _before_load(*_arguments: object) -> None:
    global _loading
    _loading = True


@persistent
def _after_failed_load(*_arguments: object) -> None:
    global _loading
    _loading = False


@persistent
def _after_load(*_arguments: object) -> None:
    """A file that was saved without being asked, as Blender does when it quits, may come from within a session."""
    global _loading
    _loading = False
    _forget()
    reporting.forget()
    status.clear()
    marked = brush_session.marked()
    if marked:
        text = "The file was saved while weights were sculpted or painted: they are as they were then"
        reporting.remember("Skinwright", text)
    brush_session.unmark(marked)
    for obj in marked:
        if obj.mode in ("SCULPT", "WEIGHT_PAINT"):
            modes.go_to(obj, "OBJECT")
    # The overlay of a match needs what was prepared for it, which no file holds.
    _hide_overlays()
    _overlays.clear()


@persistent
def _before_save(*_arguments: object) -> None:
    """The file is to open outside of the brushes' mode, with the work so far and without a session's marks."""
    global _saving
    _hide_overlays()
    session = brush_session.current
    obj = session.target() if session else None
    if session is None or obj is None:
        return
    under_brush = obj.mode == session.mode
    _saving = session, under_brush
    brush_session.unmark(brush_session.marked())
    session.tidy()
    if under_brush:
        modes.go_to(obj, "OBJECT")


@persistent
def _after_save(*_arguments: object) -> None:
    """Go on as before."""
    global _saving
    _show_overlays()
    saved, _saving = _saving, None
    if saved is None or saved[0] is not brush_session.current:
        return
    session, under_brush = saved
    session.set_flag(True)
    obj = session.target()
    if obj and under_brush:
        modes.go_to(obj, session.mode)
    session.resume()


def _hide_overlays() -> None:
    for scene in bpy.data.scenes:
        if scene.skinwright.overlay.kind == "MATCH":
            _overlays.append(scene.name)
            scene.skinwright.overlay.kind = "NONE"


def _show_overlays() -> None:
    while _overlays:
        scene = bpy.data.scenes.get(_overlays.pop())
        if scene:
            scene.skinwright.overlay.kind = "MATCH"


_HANDLERS = (
    (load_pre, _before_load),
    (load_post, _after_load),
    (load_post_fail, _after_failed_load),
    (save_pre, _before_save),
    (save_post, _after_save),
    (save_post_fail, _after_save),
)


def register() -> None:
    """Listen to loading and saving."""
    for handlers, handler in _HANDLERS:
        handlers.append(handler)


def unregister() -> None:
    """Stop; what runs has been ended by the operators' own unregistering."""
    for handlers, handler in _HANDLERS:
        handlers.remove(handler)
    for timer in (_watch, _hand_on):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)
    _forget()
