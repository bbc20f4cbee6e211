"""The panel's buttons for what the brush paints into the match mask."""

import bpy
from bpy.props import EnumProperty
from bpy.types import Context, Operator

from ...match.painting import BRUSH_WEIGHTS
from ...scene import brush
from ...scene.error import SceneError


class SKINWRIGHT_OT_mask_brush(Operator):
    """Sets the weight that the brush uses, which with factory settings is not the unified one."""

    bl_idname = "skinwright.mask_brush"
    bl_label = "Mask Brush"
    bl_description = "Choose what the brush paints into the match mask"
    bl_options = {"INTERNAL"}

    value: EnumProperty(
        name="Value",
        description="What the brush paints",
        items=[
            ("INPAINT", "Inpaint", "Not matched, whatever is near"),
            ("AUTOMATIC", "Automatic", "Matched by distance and angle"),
            ("MATCH", "Match", "Matched, however far the source"),
        ],
    )

    @classmethod
    def poll(cls, context: Context) -> bool:
        """In the mode that has such a brush."""
        cls.poll_message_set("Go to Weight Paint mode to choose what the brush paints")
        return context.mode == "PAINT_WEIGHT"

    def execute(self, context: Context) -> set[str]:
        """Set the weight, or say why there is none."""
        try:
            brush.set_weight(context, BRUSH_WEIGHTS[self.value])
        except SceneError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


def register() -> None:
    """Register the operator."""
    bpy.utils.register_class(SKINWRIGHT_OT_mask_brush)


def unregister() -> None:
    """Unregister it."""
    bpy.utils.unregister_class(SKINWRIGHT_OT_mask_brush)
