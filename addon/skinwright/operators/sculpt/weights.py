"""Sculpt Weights: Blender's brushes on a posed character, every stroke becoming weights when it is released.

A modal operator never sees the release that ends a stroke: the brush takes it. So it looks, on a timer, whether
something has changed while no other operator holds the input, and the session looks which vertices have moved.
"""

import bpy
from bpy.types import Context, Event, Operator

from ... import native
from ...scene import mesh
from ...scene.error import SceneError
from ...sculpt import session as sculpt_session
from ...sculpt.session import SculptSession
from ..modal import held_input, timers
from . import begin as sculpt_begin
from . import keys as sculpt_keys
from . import undo as sculpt_undo
from .watch import StrokeWatch

# While posing between strokes, Object and Pose mode belong to the session too.
MODES = {"SCULPT", "OBJECT", "POSE"}


class SKINWRIGHT_OT_sculpt_weights(Operator):
    """Translates events; the work is the session's."""

    bl_idname = "skinwright.sculpt_weights"
    bl_label = "Sculpt Weights"
    bl_description = "Sculpt the posed mesh; every stroke becomes weights, and the rest shape stays"
    bl_options = {"REGISTER", "UNDO"}

    _session: SculptSession
    _watch: StrokeWatch

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Cheap, as it runs on every redraw."""
        reason = sculpt_begin.refusal(context)
        cls.poll_message_set(reason)
        return not reason

    def invoke(self, context: Context, _event: Event) -> set[str]:
        """Begin, in Sculpt mode; without a window there is nothing to sculpt with."""
        self._mode = context.object.mode
        try:
            self._session = sculpt_session.current = sculpt_begin.begin(context)
        except (SceneError, native.NativeError) as error:
            sculpt_begin.go_to(context, self._mode)
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        sculpt_keys.forget()
        self._watch = StrokeWatch(self._session)
        self._steps_to_undo, self._left = False, False
        self._timer = timers.start(context, timers.BRUSH_SECONDS)
        context.window_manager.modal_handler_add(self)
        _show(context, "sculpt, and the weights follow")
        return {"RUNNING_MODAL"}

    def modal(self, context: Context, event: Event) -> set[str]:
        """Everything but undo, Enter and Esc is the brushes' and the view's."""
        session, obj = self._session, self._session.target()
        if obj is None:
            self.cancel(context)
            self.report({"WARNING"}, f"{session.target_name} or its armature is gone: sculpting has ended")
            return {"CANCELLED"}
        asked = sculpt_keys.asked(event, context, obj)
        if asked in ("KEEP", "CANCEL") or context.mode not in MODES:
            return self._end(context, keep=asked != "CANCEL")
        self._left = self._left or context.mode != "SCULPT"
        if context.mode != "SCULPT" or context.object != obj:
            return {"PASS_THROUGH"}
        held = held_input.by_another(context, type(self))
        if asked and not held:
            self._step(context, asked)
            return {"RUNNING_MODAL"}
        if held or event.value == "PRESS":
            self._watch.expect_stroke()
        else:
            self._look(context)
        return {"PASS_THROUGH"}

    def _look(self, context: Context) -> None:
        """Turn into weights what has moved since the last look."""
        try:
            outcome = self._watch.look(context.scene.skinwright.sculpt.kappa)
        except (SceneError, native.NativeError) as error:
            self._steps_to_undo = True
            self.report({"WARNING"}, str(error))
            return
        if outcome:
            self._steps_to_undo = True
            _show(context, f"{outcome.vertices} vertices, {outcome.reachability:.0%} reached")

    def _step(self, context: Context, asked: str) -> None:
        session = self._session
        done = session.undo() if asked == "UNDO" else session.redo()
        _show(context, f"{session.stroke_count} strokes" if done else f"nothing to {asked.lower()}")

    def _end(self, context: Context, keep: bool) -> set[str]:
        session = self._session
        if context.mode == "SCULPT":
            self._look(context)  # a stroke may have ended just now
            if self._steps_to_undo and not self._left:
                sculpt_undo.take_back(context, session.target_name)
        self.cancel(context)
        with mesh.object_mode(context):
            obj = session.target()
            if obj:
                obj.skinwright.sculpting = False
                self._keep(session) if keep else session.cancel()
        if not keep:
            self.report({"INFO"}, "Weights and shape are as they were")
        if context.mode == "SCULPT":
            sculpt_begin.go_to(context, self._mode)
        return {"FINISHED" if keep else "CANCELLED"}

    def _keep(self, session: SculptSession) -> None:
        session.assert_state()
        report = session.commit()
        self.report({"INFO"}, report.sentence())
        for warning in report.warnings:
            self.report({"WARNING"}, warning)

    def cancel(self, context: Context) -> None:
        """Also called by Blender, when it loads a file or quits: then there is nothing to restore."""
        sculpt_session.current = None
        timers.stop(self._timer)
        if context.workspace:
            context.workspace.status_text_set(None)


def _show(context: Context, news: str) -> None:
    keys = "Ctrl Z: back   Ctrl Shift Z: again   Enter: keep   Esc: as it was"
    context.workspace.status_text_set(f"Sculpt Weights: {news}   {keys}")
    # The panel; what has changed in the view Blender sees for itself.
    for region in (region for area in context.screen.areas if area.type == "VIEW_3D" for region in area.regions):
        if region.type == "UI":
            region.tag_redraw()


def register() -> None:
    """Register the operator."""
    bpy.utils.register_class(SKINWRIGHT_OT_sculpt_weights)


def unregister() -> None:
    """Unregister it; a session that goes on is ended by Blender and keeps what it has."""
    sculpt_session.current = None
    bpy.utils.unregister_class(SKINWRIGHT_OT_sculpt_weights)
