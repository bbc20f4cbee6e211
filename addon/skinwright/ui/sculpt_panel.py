"""The panel of sculpting weights: begin, what is going on, settings."""

import bpy
from bpy.types import Context, Panel

from ..sculpt import session as sculpt_session
from .panel import Tab


class SKINWRIGHT_PT_sculpt(Tab, Panel):
    """One button, and while it runs what the last stroke did."""

    bl_label = "Sculpt Weights"
    bl_order = 5

    def draw(self, context: Context) -> None:
        """While sculpting, the ways to end it."""
        layout = self.layout
        settings = context.scene.skinwright.sculpt
        if sculpt_session.current is None:
            layout.operator("skinwright.sculpt_weights", icon="SCULPTMODE_HLT")
            layout.operator("skinwright.desparsify", icon="GROUP_VERTEX")
        layout.prop(settings, "kappa", slider=True)
        row = layout.row(align=True)
        row.operator("skinwright.step_pose", text="Pose", icon="TRIA_LEFT").step = -1
        row.operator("skinwright.step_pose", text="Pose", icon="TRIA_RIGHT").step = 1
        shown = context.scene.skinwright.overlay.kind == "INFLUENCES"
        button = layout.operator("skinwright.show_overlay", text="Show Bone Counts", icon="OVERLAY", depress=shown)
        button.kind = "NONE" if shown else "INFLUENCES"


class SKINWRIGHT_PT_sculpt_settings(Tab, Panel):
    """What is settled when sculpting begins."""

    bl_label = "Settings"
    bl_parent_id = "SKINWRIGHT_PT_sculpt"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """Not to be changed on the way."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.layout.active = sculpt_session.current is None
        context.scene.skinwright.sculpt.draw_settings(self.layout.column())


CLASSES = (SKINWRIGHT_PT_sculpt, SKINWRIGHT_PT_sculpt_settings)


def register() -> None:
    """Register the panels, parents first."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Unregister them, children first."""
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
