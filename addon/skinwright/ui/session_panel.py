"""The panel of the session that runs, above all others: the ways to end it, and what it has come to."""

import bpy
from bpy.types import Context, Panel, UILayout

from ..match.painting import BRUSH_WEIGHTS, brush_value
from ..registration import registration
from ..sculpt import session as sculpt_session
from ..sculpt.session import ADVICE, POOR, SculptSession
from .panel import Tab
from .result_panel import paragraph


class SKINWRIGHT_PT_session(Tab, Panel):
    """Shown only while weights are sculpted or the mask is painted."""

    bl_label = "Session"
    # Blender takes numbers below 0 for 0.
    bl_order = 0

    @classmethod
    def poll(cls, _context: Context) -> bool:
        """The buttons know."""
        return bpy.ops.skinwright.end_sculpt_weights.poll() or bpy.ops.skinwright.end_match_mask.poll()

    def draw_header(self, _context: Context) -> None:
        """Which of the two."""
        self.layout.label(icon="SCULPTMODE_HLT" if sculpt_session.current else "BRUSH_DATA")

    def draw(self, context: Context) -> None:
        """Buttons first."""
        if sculpt_session.current:
            _draw_sculpting(self.layout, context, sculpt_session.current)
        else:
            _draw_painting(self.layout, context)


def _draw_sculpting(layout: UILayout, context: Context, session: SculptSession) -> None:
    _draw_ends(layout, "skinwright.end_sculpt_weights")
    column = layout.column(align=True)
    strokes, poses = (
        f"{count} {what}{'s' * (count != 1)}"
        for count, what in ((session.stroke_count, "stroke"), (session.pose_count, "pose"))
    )
    column.label(text=f"{session.target_name}: {strokes}, {poses}")
    if session.reachability is None:
        return
    column.progress(factor=max(session.reachability, 0), text=f"{session.reachability:.0%} of the sculpt reached")
    if session.reachability < POOR:
        paragraph(column, context, ADVICE, "INFO")


def _draw_painting(layout: UILayout, context: Context) -> None:
    _draw_ends(layout, "skinwright.end_match_mask")
    row = layout.row(align=True)
    painted = brush_value(context)
    for value in BRUSH_WEIGHTS:
        text = {"INPAINT": "Inpaint", "AUTOMATIC": "Auto", "MATCH": "Match"}[value]
        row.operator("skinwright.mask_brush", text=text, depress=painted == value).value = value
    if not painted:
        layout.label(text="The brush paints another value", icon="ERROR")
    layout.prop(context.scene.skinwright.overlay, "live")


def _draw_ends(layout: UILayout, operator: str) -> None:
    row = layout.row(align=True)
    row.scale_y = 1.3
    row.operator(operator, text="Keep", icon="CHECKMARK").keep = True
    row.operator(operator, text="Cancel", icon="X").keep = False


register, unregister = registration(SKINWRIGHT_PT_session)
