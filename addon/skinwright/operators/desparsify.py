"""Desparsify Weights: bones to choose from for every vertex of the selected meshes."""

from bpy.types import Context, Object

from .. import preferences
from ..desparsify import desparsify_all
from ..registration import registration
from ..scene import mesh
from ..settings.sculpt import DesparsifySettings
from .base import SkinwrightOperator, refusal_in_mode


class SKINWRIGHT_OT_desparsify(DesparsifySettings, SkinwrightOperator):
    """The operator; all of the work is in the function it calls."""

    bl_idname = "skinwright.desparsify"
    bl_label = "Desparsify Weights"
    bl_description = "Give every vertex the same number of bones to choose from, the new ones with weight 0"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    @classmethod
    def refusal(cls, context: Context) -> str:
        """Modes and targets."""
        found = refusal_in_mode(context, "desparsify weights")
        return found or ("" if _targets(context) else "Select the meshes to desparsify")

    def work(self, context: Context) -> set[str]:
        """All meshes, or none where one is refused."""
        params = self.to_params(preferences.threads(context))
        with mesh.object_mode(context):
            reports = desparsify_all(_targets(context), params, before_write=self.keep_before)
        for report in reports:
            self.report({"INFO"}, report.sentence())
        return {"FINISHED"}


def _targets(context: Context) -> list[Object]:
    """The active mesh first, so that its problem is the first one told; outside Object mode it alone."""
    active = context.active_object
    meshes = [obj for obj in context.selected_objects if obj.type == "MESH" and obj != active]
    first = [active] if active and active.type == "MESH" else []
    return first + meshes if context.mode == "OBJECT" else first


register, unregister = registration(SKINWRIGHT_OT_desparsify)
