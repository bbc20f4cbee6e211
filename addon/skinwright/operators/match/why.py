"""Why?: what decides about the active vertex."""

from bpy.types import Context

from ... import reporting
from ...match import explain
from ...match import session as match_session
from ...registration import registration
from ...scene import mesh
from ...scene.error import SceneError
from ..base import SkinwrightOperator
from .preview import begin, refusal, target


class SKINWRIGHT_OT_explain_vertex(SkinwrightOperator):
    """Its closest point is drawn as a line until the button is pressed again with nothing selected."""

    bl_idname = "skinwright.explain_vertex"
    bl_label = "Why?"
    bl_description = "Say of the active or first selected vertex why it matches or not, and which bend harms it most"
    bl_options = {"REGISTER"}

    @classmethod
    def refusal(cls, context: Context) -> str:
        """In Edit mode too, where a vertex is picked."""
        return "" if context.mode == "EDIT_MESH" and target(context) else refusal(context)

    def work(self, context: Context) -> set[str]:
        """Explain, and draw."""
        obj = target(context)
        vertex = mesh.active_vertex(obj)
        if vertex is None:
            explain.current = None
            raise SceneError(f"No vertex of {obj.name} is selected: pick one in Edit mode")
        with mesh.object_mode(context):
            session = match_session.current_of(obj) or begin(context)
            session.read_mask(obj)
            explain.current = explain.explain(obj, session, context.scene.skinwright.transfer.to_params(), vertex)
        found = explain.current
        self.report({"INFO"}, found.sentence())
        details = [f"{name} {weight:.3f}" for name, weight in found.weights[:6]]
        shown = [f"Follows {', '.join(details)}" if details else "Follows no bone"]
        shown += [f"Worst bend: {found.worst}"] if found.worst else []
        reporting.remember(self.bl_label, found.sentence(), facts=shown)
        return {"FINISHED"}


register, unregister = registration(SKINWRIGHT_OT_explain_vertex)
