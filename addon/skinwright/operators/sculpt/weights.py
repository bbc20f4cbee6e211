"""Sculpt Weights: Blender's brushes on a posed character, every stroke becoming weights when it is released."""

import bpy
from bpy.types import Context

from ... import native, preferences
from ...scene import sculpting
from ..modal import brush_session, session_operator
from ..modal.session_operator import SessionOperator
from .brushes import SculptBrushes


class SKINWRIGHT_OT_sculpt_weights(SessionOperator):
    """Begins the session; the base feeds it."""

    bl_idname = "skinwright.sculpt_weights"
    bl_label = "Sculpt Weights"
    bl_description = "Sculpt the posed mesh; every stroke becomes weights, and the rest shape stays"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Cheap, as it runs on every redraw."""
        reason = refusal(context)
        cls.poll_message_set(reason)
        return not reason

    def make(self, context: Context) -> SculptBrushes:
        """Without a window there is nothing to sculpt with."""
        sculpting.check(context.object)
        options = context.scene.skinwright.sculpt.to_options(preferences.threads(context))
        return SculptBrushes(context.object, options)


def refusal(context: Context) -> str:
    """Why weights cannot be sculpted now, or nothing."""
    if native.problem() or brush_session.refusal():
        return native.problem() or brush_session.refusal()
    if session_operator.is_orphaned():
        return ""
    if context.mode not in {"OBJECT", "SCULPT"}:
        return "Go to Object or Sculpt mode to sculpt weights"
    if context.object is None or context.object.type != "MESH":
        return "Make the skinned mesh the active object"
    return "" if context.object.visible_get() else f"{context.object.name} is hidden: show it to sculpt it"


def register() -> None:
    """Register the operator."""
    bpy.utils.register_class(SKINWRIGHT_OT_sculpt_weights)


def unregister() -> None:
    """End a session that goes on, then unregister the operator."""
    session_operator.shut_down(SKINWRIGHT_OT_sculpt_weights.bl_idname)
    bpy.utils.unregister_class(SKINWRIGHT_OT_sculpt_weights)
