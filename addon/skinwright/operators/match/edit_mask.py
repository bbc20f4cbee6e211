"""Edit Match Mask: fill, grow, shrink, invert, clear, and set from the selection."""

import numpy as np
from bpy.props import EnumProperty
from bpy.types import Context, Object
from numpy.typing import NDArray

from ... import native
from ...match import session as match_session
from ...registration import registration
from ...scene import mask, mesh, object_state
from ..base import SkinwrightOperator
from .preview import begin, refusal, target


class SKINWRIGHT_OT_edit_match_mask(SkinwrightOperator):
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
            ("MIRROR_POSITIVE", "Mirror +X to -X", "Copy the mask from the side of positive X to the other"),
            ("MIRROR_NEGATIVE", "Mirror -X to +X", "Copy the mask from the side of negative X to the other"),
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
    def refusal(cls, context: Context) -> str:
        """In Edit mode too, where the selection is made."""
        return native.problem() if context.mode == "EDIT_MESH" and target(context) else refusal(context)

    def work(self, context: Context) -> set[str]:
        """Change the mask, and make one where there is none; refused means unchanged."""
        obj = target(context)
        with mesh.object_mode(context):
            values = self._changed(context, mask.values(obj, obj.skinwright.mask_group))
            _write(obj, values)
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
        if self.action.startswith("MIRROR"):
            side = 1 if self.action == "MIRROR_POSITIVE" else -1
            return mask.mirrored(values, mesh.rest_positions(obj.data), side)
        return 1 - values if self.action == "INVERT" else mask.cleared(values)

    def _matched(self, context: Context) -> NDArray[np.bool_]:
        session = match_session.current_of(target(context)) or begin(context)
        return session.matched(session.match(context.scene.skinwright.transfer.to_params()))


def _write(obj: Object, values: mask.Values) -> None:
    group = obj.skinwright.mask_group
    try:
        with object_state.all_or_nothing([obj]):
            mask.ensure(obj)
            mask.write(obj, values)
    except BaseException:
        obj.skinwright.mask_group = group
        raise


register, unregister = registration(SKINWRIGHT_OT_edit_match_mask)
