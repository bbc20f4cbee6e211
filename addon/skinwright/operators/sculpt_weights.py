"""Sculpt Weights: Blender's brushes on a posed character, every stroke becoming weights when it is released.

A modal operator never sees the release that ends a stroke: the brush takes it. So it looks, on a timer, whether
something has changed while no other operator holds the input, and the session looks which vertices have moved.

Undo: each stroke leaves one of Blender's steps, which holds positions only. While the session runs, Ctrl Z is its own.
At the end those steps are taken back before the result is written, so that it is one step; where the artist has left
Sculpt mode to change the pose, that would take the pose back too, and they stay.
"""

import bpy
from bpy.props import BoolProperty
from bpy.types import Context, Event, Object, Operator

from .. import native, preferences, sculpt_session
from ..scene import changes, mesh, sculpting
from ..scene.error import SceneError
from ..sculpt_session import SculptSession

TICK_SECONDS = 0.02
# While posing between strokes, Object and Pose mode belong to the session too.
MODES = {"SCULPT", "OBJECT", "POSE"}
MOST_STEPS = 1000


class SKINWRIGHT_OT_sculpt_weights(Operator):
    """Translates events; the work is the session's."""

    bl_idname = "skinwright.sculpt_weights"
    bl_label = "Sculpt Weights"
    bl_description = "Sculpt the posed mesh; every stroke becomes weights, and the rest shape stays"
    bl_options = {"REGISTER", "UNDO"}

    asked_to_end = ""
    _session: SculptSession

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Cheap, as it runs on every redraw."""
        reason = _refusal(context)
        cls.poll_message_set(reason)
        return not reason

    def invoke(self, context: Context, _event: Event) -> set[str]:
        """Begin, in Sculpt mode; without a window there is nothing to sculpt with."""
        obj, self._mode = context.object, context.object.mode
        try:
            sculpting.check(obj)
            if obj.mode != "SCULPT":
                bpy.ops.object.mode_set(mode="SCULPT")
            _mark(obj)
            self._session = sculpt_session.current = SculptSession(obj, _options(context))
        except (SceneError, native.NativeError) as error:
            if obj.mode != self._mode:
                bpy.ops.object.mode_set(mode=self._mode)
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        SKINWRIGHT_OT_sculpt_weights.asked_to_end = ""
        self._steps_to_undo, self._left = False, False
        self._seen, self._undone = changes.version, changes.undone
        window_manager = context.window_manager
        self._timer = window_manager.event_timer_add(TICK_SECONDS, window=context.window)
        window_manager.modal_handler_add(self)
        _show(context, "sculpt, and the weights follow")
        return {"RUNNING_MODAL"}

    def modal(self, context: Context, event: Event) -> set[str]:
        """Everything but undo, Enter and Esc is the brushes' and the view's."""
        session, obj = self._session, self._session.target()
        if obj is None:
            self.cancel(context)
            self.report({"WARNING"}, f"{session.target_name} or its armature is gone: sculpting has ended")
            return {"CANCELLED"}
        asked = SKINWRIGHT_OT_sculpt_weights.asked_to_end or _asked_by(event, context, obj)
        if asked in ("KEEP", "CANCEL") or context.mode not in MODES:
            return self._end(context, keep=asked != "CANCEL")
        self._left = self._left or context.mode != "SCULPT"
        if context.mode == "SCULPT" and context.object == obj and not _busy(context):
            if asked:
                self._step(context, asked)
                return {"RUNNING_MODAL"}
            if event.value != "PRESS":
                self._look(context)
        return {"PASS_THROUGH"}

    def _look(self, context: Context) -> None:
        """Turn into weights what has moved since the last look."""
        session = self._session
        if self._seen == changes.version:
            return
        self._seen = changes.version
        try:
            if self._undone != changes.undone:
                # Blender's own undo, from its menu: the weights it has brought back are not the session's.
                self._undone = changes.undone
                session.assert_state()
            session.set_strength(context.scene.skinwright.sculpt.kappa)
            outcome = session.stroke()
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
        if done:
            _show(context, f"{session.stroke_count} strokes")
        else:
            _show(context, f"nothing to {asked.lower()}")

    def _end(self, context: Context, keep: bool) -> set[str]:
        session = self._session
        if context.mode == "SCULPT":
            self._look(context)  # a stroke may have ended just now
            if self._steps_to_undo and not self._left:
                _take_back_steps(context, session.target_name)
        self.cancel(context)
        with mesh.object_mode(context):
            obj = session.target()
            if obj:
                obj.skinwright.sculpting = False
                self._keep(session) if keep else session.cancel()
        if not keep:
            self.report({"INFO"}, "Weights and shape are as they were")
        if context.mode == "SCULPT" and self._mode != "SCULPT":
            bpy.ops.object.mode_set(mode=self._mode)
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
        context.window_manager.event_timer_remove(self._timer)
        if context.workspace:
            context.workspace.status_text_set(None)


class SKINWRIGHT_OT_end_sculpt_weights(Operator):
    """The panel's buttons for Enter and Esc."""

    bl_idname = "skinwright.end_sculpt_weights"
    bl_label = "End Sculpting Weights"
    bl_description = "Stop sculpting weights"
    bl_options = {"INTERNAL"}

    keep: BoolProperty(name="Keep", description="Keep the new weights, or bring back those before", default=True)

    @classmethod
    def poll(cls, _context: Context) -> bool:
        """While weights are sculpted."""
        return sculpt_session.current is not None

    def execute(self, _context: Context) -> set[str]:
        """The sculpting operator ends itself."""
        SKINWRIGHT_OT_sculpt_weights.asked_to_end = "KEEP" if self.keep else "CANCEL"
        return {"FINISHED"}


def _asked_by(event: Event, context: Context, obj: Object) -> str:
    """What a key asks for; only in Sculpt mode, as posing has its own undo."""
    if event.value != "PRESS" or context.mode != "SCULPT" or context.object != obj:
        return ""
    if event.type == "Z" and (event.ctrl or event.oskey):
        return "REDO" if event.shift else "UNDO"
    return {"RET": "KEEP", "NUMPAD_ENTER": "KEEP", "ESC": "CANCEL"}.get(event.type, "")


def _mark(obj: Object) -> None:
    """Leave an undo step of the time before, by which the way back to it can be found."""
    obj.skinwright.sculpting = False
    bpy.ops.ed.undo_push(message="Before Sculpting Weights")
    obj.skinwright.sculpting = True
    obj.update_tag()


def _take_back_steps(context: Context, name: str) -> None:
    """Undo the brushes' own steps; the session then writes its state over that of the beginning."""
    for _ in range(MOST_STEPS):
        obj = bpy.data.objects.get(name)
        if obj is None or not obj.skinwright.sculpting or context.mode != "SCULPT" or not bpy.ops.ed.undo.poll():
            return
        bpy.ops.ed.undo()


def _options(context: Context) -> sculpt_session.SculptOptions:
    return context.scene.skinwright.sculpt.to_options(preferences.threads(context))


def _busy(context: Context) -> bool:
    """Whether a brush or another operator holds the input."""
    windows = context.window_manager.windows
    names = {operator.bl_idname for window in windows for operator in window.modal_operators}
    return bool(names - {SKINWRIGHT_OT_sculpt_weights.__name__})


def _show(context: Context, news: str) -> None:
    keys = "Ctrl Z: back   Ctrl Shift Z: again   Enter: keep   Esc: as it was"
    context.workspace.status_text_set(f"Sculpt Weights: {news}   {keys}")
    for area in context.screen.areas:
        if area.type == "VIEW_3D":
            area.tag_redraw()


def _refusal(context: Context) -> str:
    if native.problem():
        return native.problem()
    if sculpt_session.current:
        return "Weights are being sculpted"
    if context.mode not in {"OBJECT", "SCULPT"}:
        return "Go to Object or Sculpt mode to sculpt weights"
    if context.object is None or context.object.type != "MESH":
        return "Make the skinned mesh the active object"
    return ""


CLASSES = (SKINWRIGHT_OT_sculpt_weights, SKINWRIGHT_OT_end_sculpt_weights)


def register() -> None:
    """Register the operators."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Unregister them."""
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
