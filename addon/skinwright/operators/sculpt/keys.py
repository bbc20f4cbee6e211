"""The panel's buttons for Enter and Esc."""

import bpy
from bpy.props import BoolProperty
from bpy.types import Context, Operator

from ..modal import brush_session
from .brushes import SculptBrushes


class SKINWRIGHT_OT_end_sculpt_weights(Operator):
    """The panel's buttons for Enter and Esc."""

    bl_idname = "skinwright.end_sculpt_weights"
    bl_label = "End Sculpting Weights"
    bl_description = "Stop sculpting weights; undo brings back what Cancel takes away"
    bl_options = {"INTERNAL"}

    keep: BoolProperty(name="Keep", description="Keep the new weights, or bring back those before", default=True)

    @classmethod
    def poll(cls, _context: Context) -> bool:
        """While weights are sculpted."""
        return isinstance(brush_session.current, SculptBrushes)

    def execute(self, _context: Context) -> set[str]:
        """The sculpting operator ends itself."""
        session = brush_session.current
        assert session is not None  # `poll` has seen it
        session.asked = "KEEP" if self.keep else "CANCEL"
        return {"FINISHED"}


def register() -> None:
    """Register the operator."""
    bpy.utils.register_class(SKINWRIGHT_OT_end_sculpt_weights)


def unregister() -> None:
    """Unregister it."""
    bpy.utils.unregister_class(SKINWRIGHT_OT_end_sculpt_weights)
