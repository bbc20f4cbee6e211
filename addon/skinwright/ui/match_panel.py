"""The panel of the match: see it, select by it, paint it; and the overlays."""

import bpy
from bpy.types import Context, Panel

from ..check import shown
from ..match.session import current_of
from .panel import Tab
from .result_panel import paragraph

ROWS_OF_ACTIONS = (
    (("From Match", "FROM_MATCH"), ("Clear", "CLEAR")),
    (("Grow", "GROW"), ("Shrink", "SHRINK")),
    (("Invert", "INVERT"),),
    (("Mirror +X", "MIRROR_POSITIVE"), ("Mirror -X", "MIRROR_NEGATIVE")),
)
OVERLAYS = (
    ("NONE", "None"),
    ("MATCH", "Match"),
    ("INFLUENCES", "Bone Count"),
    ("STRETCH", "Stretch"),
    ("DIFFERENCE", "Difference"),
    ("FAULTS", "Faults"),
)


class SKINWRIGHT_PT_match(Tab, Panel):
    """What would match, and the artist's word on it."""

    bl_label = "Match Mask"
    bl_order = 3

    def draw(self, context: Context) -> None:
        """Painting shows its own buttons."""
        layout = self.layout
        overlay = context.scene.skinwright.overlay
        shown = overlay.kind == "MATCH" and current_of(context.object)
        layout.operator("skinwright.preview_match", icon="HIDE_OFF", depress=bool(shown))
        if not bpy.ops.skinwright.end_match_mask.poll():
            layout.operator("skinwright.paint_match_mask", icon="BRUSH_DATA")
        layout.operator("skinwright.explain_vertex", icon="QUESTION")
        column = layout.column(align=True)
        column.operator("skinwright.select_match", text="Select Unmatched").what = "UNMATCHED"
        column.operator("skinwright.select_match", text="Select Loose Parts").what = "LOOSE"
        column.operator("skinwright.select_match", text="Select Whole Parts").what = "ISLAND"


class SKINWRIGHT_PT_match_edit(Tab, Panel):
    """The mask as a whole."""

    bl_label = "Edit Mask"
    bl_parent_id = "SKINWRIGHT_PT_match"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, _context: Context) -> None:
        """Each button is one action."""
        layout = self.layout
        for actions in ROWS_OF_ACTIONS:
            row = layout.row(align=True)
            for text, action in actions:
                row.operator("skinwright.edit_match_mask", text=text).action = action
        column = layout.column(align=True)
        column.label(text="Selected Vertices")
        for text, value in (("Inpaint", "INPAINT"), ("Automatic", "AUTOMATIC"), ("Force Match", "MATCH")):
            button = column.operator("skinwright.edit_match_mask", text=text)
            button.action, button.value = "FROM_SELECTION", value
        layout.operator("skinwright.store_match")


class SKINWRIGHT_PT_overlay(Tab, Panel):
    """Colours over the mesh."""

    bl_label = "Overlay"
    bl_order = 4
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """Kind and opacity."""
        layout = self.layout
        overlay = context.scene.skinwright.overlay
        grid = layout.grid_flow(row_major=True, columns=2, even_columns=True, align=True)
        for kind, text in OVERLAYS:
            grid.operator("skinwright.show_overlay", text=text, depress=overlay.kind == kind).kind = kind
        if overlay.kind == "MATCH" and current_of(context.object) is None:
            paragraph(layout, context, "The active mesh has no match prepared: press Match", "ERROR")
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
