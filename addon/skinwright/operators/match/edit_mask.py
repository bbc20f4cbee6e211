"""Edit Match Mask: fill, grow, shrink, invert, clear, and set from the selection."""

import bpy
import numpy as np
from bpy.props import EnumProperty
from bpy.types import Context, Operator
from numpy.typing import NDArray

from ...match import session as match_session
from ... import native
from ...scene import mask, mesh
from ...scene.error import SceneError
from .preview import begin, refusal, target


class SKINWRIGHT_OT_edit_match_mask(Operator):
    """Works on the whole mask at once, without a brush."""

    bl_idname = "skinwright.edit_match_mask"
    bl_label = "Edit Match Mask"
    bl_description = "Change the match mask of the active mesh as a whole"
    bl_options = {"REGISTER", "UNDO"}

    action: EnumProperty(
        name="Action",
        description="What to do with the mask",
        items=[
            ("CLEAR", "Clear", "Let every vertex match automatically"),
            ("FROM_MATCH", "From Match", "Force what matches now to match, and the rest to be inpainted"),
            ("GROW", "Grow", "Inpaint one ring of vertices more"),
            ("SHRINK", "Shrink", "Inpaint one ring of vertices less; they match automatically"),
            ("INVERT", "Invert", "Swap inpaint and force match"),
            ("FROM_SELECTION", "From Selection", "Set the value for the selected vertices"),
        ],
    )
    value: EnumProperty(
        name="Value",
        description="What the selected vertices become",
        items=[
            ("INPAINT", "Inpaint", "Not matched, whatever is near"),
            ("AUTOMATIC", "Automatic", "Matched by distance and angle"),
            ("MATCH", "Force Match", "Matched, however far the source"),
        ],
    )

    @classmethod
    def poll(cls, context: Context) -> bool:
        """In Edit mode too, where the selection is made."""
        reason = "" if context.mode == "EDIT_MESH" and target(context) else refusal(context)
        cls.poll_message_set(reason)
        return not reason

    def execute(self, context: Context) -> set[str]:
        """Change the mask, and make one where there is none."""
        obj = target(context)
        try:
            with mesh.object_mode(context):
                values = self._changed(context, mask.values(obj, mask.ensure(obj)))
                mask.write(obj, values)
        except (SceneError, native.NativeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        counts = mask.counts(values)
        self.report({"INFO"}, f"{obj.name}: {counts[0]} vertices inpaint, {counts[2]} are forced to match")
        return {"FINISHED"}

    def _changed(self, context: Context, values: mask.Values) -> mask.Values:
        obj = target(context)
        if self.action == "FROM_MATCH":
            return mask.from_match(self._matched(context))
        if self.action == "FROM_SELECTION":
            value = {"INPAINT": 0.0, "AUTOMATIC": 0.5, "MATCH": 1.0}[self.value]
            return mask.with_value(values, mesh.selected(obj), value)
        if self.action in ("GROW", "SHRINK"):
            return (mask.grow if self.action == "GROW" else mask.shrink)(values, mesh.edges(obj))
        return 1 - values if self.action == "INVERT" else mask.cleared(values)

    def _matched(self, context: Context) -> NDArray[np.bool_]:
        session = match_session.current_of(target(context)) or begin(context)
        return session.matched(session.match(context.scene.skinwright.transfer.to_params()))


def register() -> None:
    """Register the operator."""
    bpy.utils.register_class(SKINWRIGHT_OT_edit_match_mask)


def unregister() -> None:
    """Unregister it."""
    bpy.utils.unregister_class(SKINWRIGHT_OT_edit_match_mask)
