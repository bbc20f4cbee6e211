"""The panel of refinement."""

from bpy.types import Context, Panel, UILayout

from .. import jobs
from ..refine import correctives, live
from ..registration import registration
from .panel import Tab

_SHOWN = 8


class SKINWRIGHT_PT_refine(Tab, Panel):
    """Preview and the two ways to bake."""

    bl_label = "Refine Skin"
    bl_order = 7
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """Buttons, then what was baked."""
        layout = self.layout
        layout.operator("skinwright.live_refine", icon="HIDE_OFF", depress=live.current is not None)
        if jobs.running:
            layout.progress(factor=jobs.running.progress, text=f"{jobs.running.progress:.0%}, Esc stops")
        row = layout.row(align=True)
        row.operator("skinwright.bake_correctives", icon="SHAPEKEY_DATA")
        row.operator("skinwright.remove_correctives", text="", icon="TRASH")
        row = layout.row(align=True)
        row.operator("skinwright.bake_refined_cache", icon="FILE_CACHE")
        row.operator("skinwright.remove_refined_cache", text="", icon="TRASH")
        obj = context.object
        record = correctives.baked(obj) if obj and obj.type == "MESH" else None
        if record:
            _draw_certificates(layout, record["certificates"])


def _draw_certificates(layout: UILayout, certificates: list[dict]) -> None:
    """Each joint's worst pose."""
    worst: dict[str, dict] = {}
    for one in certificates:
        known = worst.get(one["joint"])
        if known is None or one["pairs_before"] > known["pairs_before"]:
            worst[one["joint"]] = one
    column = layout.column(align=True)
    for joint, one in list(worst.items())[:_SHOWN]:
        figures = f"pairs {one['pairs_before']} to {one['pairs_after']}"
        if one["volume_before"] is not None:
            figures += f", volume {one['volume_before']:+.1%} to {one['volume_after']:+.1%}"
        icon = "CHECKMARK" if one["pairs_after"] == 0 else "ERROR"
        column.label(text=f"{joint} {one['direction']} {one['angle']:.0f}°: {figures}", icon=icon)
    if len(worst) > _SHOWN:
        column.label(text=f"and {len(worst) - _SHOWN} more joints")


class SKINWRIGHT_PT_refine_solver(Tab, Panel):
    """The constraints."""

    bl_label = "Solver"
    bl_parent_id = "SKINWRIGHT_PT_refine"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """As declared."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        context.scene.skinwright.refine.draw_solver(self.layout.column())


class SKINWRIGHT_PT_refine_sampling(Tab, Panel):
    """What joints are put through for correctives."""

    bl_label = "Correctives"
    bl_parent_id = "SKINWRIGHT_PT_refine"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """As declared."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        context.scene.skinwright.refine.draw_sampling(self.layout.column())


register, unregister = registration(SKINWRIGHT_PT_refine, SKINWRIGHT_PT_refine_solver, SKINWRIGHT_PT_refine_sampling)
