"""Preview Match: see what would match, select it, keep it as attributes. No weight is touched."""

import bpy
from bpy.props import EnumProperty
from bpy.types import Context, Object

from ... import native, preferences
from ...match import session as match_session
from ...match.session import MatchSession
from ...registration import registration
from ...scene import attributes, mesh
from ...scene.error import SceneError
from ...transfer.params import TransferParams
from ..base import SkinwrightOperator


def target(context: Context) -> Object:
    """The active mesh, if it is not the source; else None, which `poll` refuses."""
    obj = context.object
    source = context.scene.skinwright.transfer.source
    return obj if obj and obj.type == "MESH" and obj != source else None


def refusal(context: Context) -> str:
    """Why no match can be looked at now, or nothing."""
    if native.problem():
        return native.problem()
    if context.scene.skinwright.transfer.source is None:
        return "Pick the body to transfer from as Source"
    if target(context) is None:
        return "Make the mesh to transfer to the active object"
    return (
        "" if context.mode in {"OBJECT", "PAINT_WEIGHT"} else "Go to Object or Weight Paint mode to look at the match"
    )


def begin(context: Context) -> MatchSession:
    """Prepare the active mesh and show its match. Raises SceneError or native.NativeError."""
    settings = context.scene.skinwright
    if settings.transfer.source is None:
        raise SceneError("There is no source to match: pick the body to transfer from as Source")
    params = settings.transfer.to_params(preferences.threads(context))
    match_session.current = MatchSession(settings.transfer.source, target(context), params)
    settings.overlay.kind = "MATCH"
    return match_session.current


class _OnMatch(SkinwrightOperator):
    """What works on the match of the active mesh, preparing it where there is none on show."""

    @classmethod
    def refusal(cls, context: Context) -> str:
        """As for every look at the match."""
        return refusal(context)

    def on_match(self, obj: Object, session: MatchSession, params: TransferParams) -> str:
        """Do it, and say what was done."""
        raise NotImplementedError

    def work(self, context: Context) -> set[str]:
        """Work on the match, or say why there is none."""
        obj = target(context)
        session = match_session.current_of(obj) or begin(context)
        params = context.scene.skinwright.transfer.to_params()
        session.read_mask(obj)
        self.report({"INFO"}, self.on_match(obj, session, params))
        return {"FINISHED"}


class SKINWRIGHT_OT_preview_match(_OnMatch):
    """Turns the overlay on, anew for what has changed, and off."""

    bl_idname = "skinwright.preview_match"
    bl_label = "Preview Match"
    bl_description = "Colour the active mesh by what would match and what would be inpainted; weights are not touched"
    bl_options = {"REGISTER"}

    def work(self, context: Context) -> set[str]:
        """On a second press the overlay goes."""
        overlay = context.scene.skinwright.overlay
        if overlay.kind == "MATCH" and match_session.current_of(target(context)):
            overlay.kind, match_session.current = "NONE", None
            return {"FINISHED"}
        match_session.current = None
        return super().work(context)

    def on_match(self, obj: Object, session: MatchSession, params: TransferParams) -> str:
        """Shown by the overlay; here in numbers."""
        counts = session.match(params).counts().tolist()
        matched = counts[0] + counts[2]
        return f"{obj.name}: {matched} of {sum(counts)} vertices match, {counts[4]} are in parts without match"


class SKINWRIGHT_OT_select_match(_OnMatch):
    """Selects in Edit mode, where a selection can be seen and worked with."""

    bl_idname = "skinwright.select_match"
    bl_label = "Select by Match"
    bl_description = "Select vertices of the active mesh by whether they match"
    bl_options = {"REGISTER", "UNDO"}

    what: EnumProperty(
        name="Select",
        description="Which vertices to select",
        items=[
            ("UNMATCHED", "Unmatched", "All that do not match"),
            ("MATCHED", "Matched", "All that match"),
            ("LOOSE", "Loose Parts", "The parts of which no vertex matches"),
            ("ISLAND", "Islands", "The whole of every part that has a selected vertex"),
        ],
    )

    @classmethod
    def refusal(cls, context: Context) -> str:
        """What is hidden has no Edit mode."""
        obj = target(context)
        hidden = obj is not None and not obj.visible_get()
        return refusal(context) or (f"{obj.name} is hidden: show it to select in it" if obj and hidden else "")

    def on_match(self, obj: Object, session: MatchSession, params: TransferParams) -> str:
        """Go to Edit mode with the vertices selected."""
        chosen = session.chosen(self.what, session.match(params), mesh.selected(obj))
        if obj.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        mesh.select(obj, chosen)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_mode(type="VERT")
        return f"{int(chosen.sum())} vertices of {obj.name} selected"


class SKINWRIGHT_OT_store_match(_OnMatch):
    """For Geometry Nodes."""

    bl_idname = "skinwright.store_match"
    bl_label = "Store Match as Attributes"
    bl_description = "Keep matched, distance and angle as named attributes of the active mesh, for Geometry Nodes"
    bl_options = {"REGISTER", "UNDO"}

    def on_match(self, obj: Object, session: MatchSession, params: TransferParams) -> str:
        """Three attributes on vertices."""
        inpainting = session.inpainting
        matched = session.matched(session.match(params))
        attributes.write(obj, "skinwright_matched", matched)
        attributes.write(obj, "skinwright_distance", inpainting.distance)
        attributes.write(obj, "skinwright_angle", inpainting.angle)
        return f"{obj.name}: skinwright_matched, skinwright_distance and skinwright_angle stored"


register, unregister = registration(SKINWRIGHT_OT_preview_match, SKINWRIGHT_OT_select_match, SKINWRIGHT_OT_store_match)
