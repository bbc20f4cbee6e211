"""Paint Match Mask: Blender's brushes on the mask, the weights following every stroke."""

import bpy
from bpy.props import BoolProperty
from bpy.types import Context, Event, Operator

from ... import native, preferences
from ...match import session as match_session
from ...match.painting import MaskPainting
from ...scene.error import SceneError
from ...transfer.params import TransferParams
from ..modal import held_input, timers
from .preview import refusal, target


class SKINWRIGHT_OT_paint_match_mask(Operator):
    """Runs beside the brushes. It sees no release of the mouse, so a timer looks whether a stroke has ended."""

    bl_idname = "skinwright.paint_match_mask"
    bl_label = "Paint Match Mask"
    bl_description = "Paint where to inpaint (0), match automatically (0.5) or force a match (1); the weights follow"
    bl_options = {"REGISTER", "UNDO"}

    painting: MaskPainting | None = None
    asked_to_end = ""

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Not twice at once."""
        reason = "The mask is being painted" if cls.painting else refusal(context)
        cls.poll_message_set(reason)
        return not reason

    def invoke(self, context: Context, _event: Event) -> set[str]:
        """Begin; without a window there is nothing to paint with."""
        try:
            painting = MaskPainting(context, target(context), _params(context))
        except (SceneError, native.NativeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        cls = SKINWRIGHT_OT_paint_match_mask
        self._painting = cls.painting = painting
        cls.asked_to_end = ""
        match_session.current = painting.session
        # Else undoing the first stroke would also undo that painting has begun.
        bpy.ops.ed.undo_push(message=self.bl_label)
        self._timer = timers.start(context, timers.BRUSH_SECONDS)
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set("Paint the match mask   Enter: keep   Esc: weights as they were")
        return {"RUNNING_MODAL"}

    def modal(self, context: Context, event: Event) -> set[str]:
        """Everything but Enter and Esc is the brushes' and the view's."""
        cls = SKINWRIGHT_OT_paint_match_mask
        if context.mode != "PAINT_WEIGHT" or self._painting.session.target() != context.object:
            return self._end(context, keep=True)
        pressed = event.type if event.value == "PRESS" else ""
        if pressed == "ESC" or cls.asked_to_end == "CANCEL":
            return self._end(context, keep=False)
        if pressed in ("RET", "NUMPAD_ENTER") or cls.asked_to_end == "KEEP":
            return self._end(context, keep=True)
        held = held_input.by_another(context, cls)
        if held or event.value == "PRESS":
            self._painting.expect_stroke()
        elif event.type == "TIMER":
            self._tick(context)
        return {"PASS_THROUGH"}

    def _tick(self, context: Context) -> None:
        if self._painting.tick(_params(context), context.scene.skinwright.overlay.live):
            for area in context.screen.areas:
                if area.type == "VIEW_3D":
                    area.tag_redraw()

    def _end(self, context: Context, keep: bool) -> set[str]:
        self.cancel(context)
        if keep:
            self._painting.finish(context)
        else:
            self._painting.cancel(context)
        self.report({"INFO"}, "Mask and weights kept" if keep else "All weights are as they were")
        # An undo step in both cases: the last one is a stroke, whose weights are no longer there.
        return {"FINISHED"}

    def cancel(self, context: Context) -> None:
        """Also called by Blender, when it loads a file or quits: then there is nothing to restore."""
        SKINWRIGHT_OT_paint_match_mask.painting = None
        timers.stop(self._timer)
        if context.workspace:
            context.workspace.status_text_set(None)


class SKINWRIGHT_OT_end_match_mask(Operator):
    """The panel's buttons for Enter and Esc."""

    bl_idname = "skinwright.end_match_mask"
    bl_label = "End Mask Painting"
    bl_description = "Stop painting the match mask"
    bl_options = {"INTERNAL"}

    keep: BoolProperty(name="Keep", description="Keep mask and weights, or bring back those before", default=True)

    @classmethod
    def poll(cls, _context: Context) -> bool:
        """While the mask is painted."""
        return SKINWRIGHT_OT_paint_match_mask.painting is not None

    def execute(self, _context: Context) -> set[str]:
        """The painting operator ends itself."""
        SKINWRIGHT_OT_paint_match_mask.asked_to_end = "KEEP" if self.keep else "CANCEL"
        return {"FINISHED"}


def _params(context: Context) -> TransferParams:
    return context.scene.skinwright.transfer.to_params(preferences.threads(context))


CLASSES = (SKINWRIGHT_OT_paint_match_mask, SKINWRIGHT_OT_end_match_mask)


def register() -> None:
    """Register the operators."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Unregister them; painting that goes on is ended by Blender and keeps what it has."""
    SKINWRIGHT_OT_paint_match_mask.painting = None
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
