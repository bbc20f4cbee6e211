"""Small things the panel's buttons do: pick the source, show an overlay, dismiss the last result."""

from bpy.props import EnumProperty
from bpy.types import Context, Operator

from .. import reporting
from ..match import session as match_session
from ..registration import registration
from .base import SkinwrightOperator
from .match import preview


class SKINWRIGHT_OT_active_as_source(SkinwrightOperator):
    """The eyedropper, without aiming."""

    bl_idname = "skinwright.active_as_source"
    bl_label = "Active as Source"
    bl_description = "Transfer from the active mesh"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def refusal(cls, context: Context) -> str:
        """A mesh with weights."""
        obj = context.object
        if obj is None or obj.type != "MESH":
            return "Make the body, a mesh with weights, the active object"
        return "" if obj.vertex_groups else f"{obj.name} has no vertex groups, and so no weights to transfer"

    def work(self, context: Context) -> set[str]:
        """Set it."""
        context.scene.skinwright.transfer.source = context.object
        return {"FINISHED"}


class SKINWRIGHT_OT_show_overlay(SkinwrightOperator):
    """The property alone would show nothing of a match that has not been prepared."""

    bl_idname = "skinwright.show_overlay"
    bl_label = "Show Overlay"
    bl_description = "Choose what the colours over the mesh show; Match prepares the active mesh first"
    bl_options = {"INTERNAL"}

    kind: EnumProperty(
        name="Overlay",
        description="What the colours show",
        items=[(kind, kind.title(), "") for kind in ("NONE", "MATCH", "INFLUENCES", "STRETCH")],
    )

    @classmethod
    def refusal(cls, _context: Context) -> str:
        """Never: why a match cannot be shown depends on the kind."""
        return ""

    def work(self, context: Context) -> set[str]:
        """Prepare a match where none is on show."""
        if self.kind == "MATCH" and match_session.current_of(context.object) is None:
            why = preview.refusal(context)
            if why:
                self.report({"ERROR"}, why)
                reporting.remember(self.bl_label, why, failed=True)
                return {"CANCELLED"}
            preview.begin(context)
        context.scene.skinwright.overlay.kind = self.kind
        return {"FINISHED"}


class SKINWRIGHT_OT_forget_result(Operator):
    """The panel's cross."""

    bl_idname = "skinwright.forget_result"
    bl_label = "Dismiss"
    bl_description = "Hide the last result"
    bl_options = {"INTERNAL"}

    def execute(self, _context: Context) -> set[str]:
        """Until the next."""
        reporting.forget()
        return {"FINISHED"}


register, unregister = registration(
    SKINWRIGHT_OT_active_as_source, SKINWRIGHT_OT_show_overlay, SKINWRIGHT_OT_forget_result
)
