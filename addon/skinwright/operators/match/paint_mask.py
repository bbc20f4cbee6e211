"""Paint Match Mask: Blender's brushes on the mask, the weights following every stroke."""

import bpy
from bpy.props import BoolProperty
from bpy.types import Context, Operator

from ..modal import brush_session, session_operator
from ..modal.session_operator import SessionOperator
from .mask_brushes import MaskBrushes
from .preview import refusal, target


class SKINWRIGHT_OT_paint_match_mask(SessionOperator):
    """Begins the session; the base feeds it."""

    bl_idname = "skinwright.paint_match_mask"
    bl_label = "Paint Match Mask"
    bl_description = "Paint where to inpaint (0), match automatically (0.5) or force a match (1); the weights follow"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Not beside another session."""
        reason = brush_session.refusal() or ("" if session_operator.is_orphaned() else _refusal(context))
        cls.poll_message_set(reason)
        return not reason

    def make(self, context: Context) -> MaskBrushes:
        """Without a window there is nothing to paint with."""
        return MaskBrushes(context, target(context))


def _refusal(context: Context) -> str:
    """As for every look at the match; and no brush reaches what is hidden."""
    obj = target(context)
    hidden = obj is not None and not obj.visible_get()
    return refusal(context) or (f"{obj.name} is hidden: show it to paint its mask" if obj and hidden else "")


class SKINWRIGHT_OT_end_match_mask(Operator):
    """The panel's buttons for Enter and Esc."""

    bl_idname = "skinwright.end_match_mask"
    bl_label = "End Mask Painting"
    bl_description = "Stop painting the match mask; undo brings back what Cancel takes away"
    bl_options = {"INTERNAL"}

    keep: BoolProperty(name="Keep", description="Keep mask and weights, or bring back those before", default=True)

    @classmethod
    def poll(cls, _context: Context) -> bool:
        """While the mask is painted."""
        return isinstance(brush_session.current, MaskBrushes)

    def execute(self, _context: Context) -> set[str]:
        """The painting operator ends itself."""
        session = brush_session.current
        assert session is not None  # `poll` has seen it
        session.asked = "KEEP" if self.keep else "CANCEL"
        return {"FINISHED"}


CLASSES = (SKINWRIGHT_OT_paint_match_mask, SKINWRIGHT_OT_end_match_mask)


def register() -> None:
    """Register the operators."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """End painting that goes on, then unregister the operators."""
    session_operator.shut_down(SKINWRIGHT_OT_paint_match_mask.bl_idname)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
