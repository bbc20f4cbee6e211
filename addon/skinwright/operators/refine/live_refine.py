"""Live Refinement: the preview on and off, kept up with the pose by handlers."""

from collections.abc import Callable

import bpy
from bpy.app.handlers import persistent
from bpy.types import Context

from ... import preferences, reporting
from ...errors import sentence
from ...refine import live
from ...registration import registration
from ...scene import armature
from ...settings.refine import RefineSettings, adopt
from ..base import SkinwrightOperator
from .targets import found, refusal


class SKINWRIGHT_OT_live_refine(RefineSettings, SkinwrightOperator):
    """On, or off if it is on."""

    bl_idname = "skinwright.live_refine"
    bl_label = "Live Refinement"
    bl_description = "Show refined skin while posing and playing, on the active mesh and the selected garments over it"
    bl_options = {"REGISTER"}

    @classmethod
    def refusal(cls, context: Context) -> str:
        """Switching off is always possible."""
        return "" if live.current else refusal(context, "preview refinement")

    def work(self, context: Context) -> set[str]:
        """Toggle."""
        if live.current:
            live.stop()
            return self.tell("Live refinement is off", [])
        adopt(self, context.scene.skinwright.refine, RefineSettings)
        obj = found(context)
        rig = armature.find(obj)
        others = [other for other in context.selected_objects if other.type == "MESH" and other != obj]
        garments = [other for other in others if armature.find(other) == rig]
        live.start(obj, garments, self.to_params(preferences.threads(context)))
        follow = "1 garment follows" if len(garments) == 1 else f"{len(garments)} garments follow"
        return self.tell(f"{obj.name}: live refinement is on, {follow}", [])


_busy = False
# Frames change on another thread then, where nothing may be written.
_rendering = False


@persistent
def _before_rendering(*_arguments: object) -> None:
    global _rendering
    _rendering = True


@persistent
def _after_rendering(*_arguments: object) -> None:
    """The pose on show is that of the frame before; the next change of it is seen."""
    global _rendering
    _rendering = False


@persistent
def _on_change(*_arguments: object) -> None:
    """The pose may have changed. Moving the stand-in makes Blender call this once more, with the same pose."""
    global _busy
    if live.current and not _busy and not _rendering:
        _busy = True
        try:
            _attempt(live.update)
        finally:
            _busy = False


def _attempt(step: Callable[[], object]) -> None:
    """Do it, or end the preview and say why: else every change of the pose would fail again."""
    try:
        step()
    except Exception as error:
        live.stop()
        label = SKINWRIGHT_OT_live_refine.bl_label
        reporting.remember(label, f"The preview has ended: {sentence(label, error)}", failed=True)


@persistent
def _before_saving(*_arguments: object) -> None:
    if live.current:
        live.preview_object.clear()


@persistent
def _on_return(*_arguments: object) -> None:
    """After saving, undo or redo."""
    _attempt(live.restart)


@persistent
def _on_load(*_arguments: object) -> None:
    """Another file: whatever was shown belonged to the old one. A file saved in a crash may hold stand-ins."""
    live.stop()


_HANDLERS = {
    "render_init": _before_rendering,
    "render_complete": _after_rendering,
    "render_cancel": _after_rendering,
    "depsgraph_update_post": _on_change,
    "frame_change_post": _on_change,
    "save_pre": _before_saving,
    "save_post": _on_return,
    "undo_post": _on_return,
    "redo_post": _on_return,
    "load_post": _on_load,
}
_register, _unregister = registration(SKINWRIGHT_OT_live_refine)


def register() -> None:
    """Register the operator and its handlers."""
    _register()
    for name, handler in _HANDLERS.items():
        getattr(bpy.app.handlers, name).append(handler)


def unregister() -> None:
    """Off, and everything away."""
    live.stop()
    for name, handler in _HANDLERS.items():
        getattr(bpy.app.handlers, name).remove(handler)
    _unregister()
