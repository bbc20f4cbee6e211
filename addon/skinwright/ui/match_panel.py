"""The panel of the match: see it, select by it, paint it; and the overlays."""

import bpy
from bpy.types import Context, Panel, UILayout

from ..check import shown
from ..match.painting import BRUSH_WEIGHTS, brush_value
from ..match.session import current_of
from .panel import Tab


class SKINWRIGHT_PT_match(Tab, Panel):
    """What would match, and the artist's word on it."""

    bl_label = "Match Mask"
    bl_order = 1

    def draw(self, context: Context) -> None:
        """Painting shows its own buttons."""
        layout = self.layout
        overlay = context.scene.skinwright.overlay
        shown = overlay.kind == "MATCH" and current_of(context.object)
        layout.operator("skinwright.preview_match", icon="HIDE_OFF", depress=bool(shown))
        if bpy.ops.skinwright.end_match_mask.poll():
            _draw_painting(layout, context)
        else:
            layout.operator("skinwright.paint_match_mask", icon="BRUSH_DATA")
        row = layout.row(align=True)
        row.label(text="Select")
        row.operator("skinwright.select_match", text="Unmatched").what = "UNMATCHED"
        row.operator("skinwright.select_match", text="Loose").what = "LOOSE"
        row.operator("skinwright.select_match", text="Island").what = "ISLAND"


def _draw_painting(layout: UILayout, context: Context) -> None:
    row = layout.row(align=True)
    row.operator("skinwright.end_match_mask", text="Keep", icon="CHECKMARK").keep = True
    row.operator("skinwright.end_match_mask", text="Cancel", icon="X").keep = False
    row = layout.row(align=True)
    painted = brush_value(context)
    for value in BRUSH_WEIGHTS:
        button = row.operator("skinwright.mask_brush", text=value.title(), depress=painted == value)
        button.value = value
    layout.prop(context.scene.skinwright.overlay, "live")


class SKINWRIGHT_PT_match_edit(Tab, Panel):
    """The mask as a whole."""

    bl_label = "Edit Mask"
    bl_parent_id = "SKINWRIGHT_PT_match"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, _context: Context) -> None:
        """Each button is one action."""
        layout = self.layout
        for actions in (("FROM_MATCH", "CLEAR"), ("GROW", "SHRINK"), ("INVERT",)):
            row = layout.row(align=True)
            for action in actions:
                text = action.replace("_", " ").title()
                row.operator("skinwright.edit_match_mask", text=text).action = action
        row = layout.row(align=True)
        row.label(text="Selected")
        for text, value in (("Inpaint", "INPAINT"), ("Automatic", "AUTOMATIC"), ("Match", "MATCH")):
            button = row.operator("skinwright.edit_match_mask", text=text)
            button.action, button.value = "FROM_SELECTION", value
        layout.operator("skinwright.store_match")


class SKINWRIGHT_PT_overlay(Tab, Panel):
    """Colours over the mesh."""

    bl_label = "Overlay"
    bl_order = 2
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """Kind and opacity."""
        layout = self.layout
        overlay = context.scene.skinwright.overlay
        layout.row().prop(overlay, "kind", expand=True)
        layout.prop(overlay, "opacity", slider=True)


class SKINWRIGHT_PT_check(Tab, Panel):
    """What is wrong with weights."""

    bl_label = "Check"
    bl_order = 9
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """The button, and what it found on the active mesh; its settings are in the redo panel."""
        layout = self.layout
        layout.operator("skinwright.check_weights", icon="CHECKMARK")
        result = shown.of(context.object)
        if result is None:
            return
        column = layout.column(align=True)
        for fault, count in result.counts().items():
            if count:
                column.label(text=f"{count:,} {fault.value}")
        if not any(result.counts().values()):
            column.label(text=f"Nothing wrong in {len(result.poses)} poses")
        if result.worst:
            column.label(text=f"Worst: {result.worst.name}")
            row = layout.row(align=True)
            row.operator("skinwright.show_worst_pose", icon="POSE_HLT")
            row.prop_enum(context.scene.skinwright.overlay, "kind", "FAULTS")


CLASSES = (SKINWRIGHT_PT_match, SKINWRIGHT_PT_match_edit, SKINWRIGHT_PT_overlay, SKINWRIGHT_PT_check)


def register() -> None:
    """Register the panels, parents first."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Unregister them, children first."""
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
