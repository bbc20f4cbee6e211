"""Painting the match mask with the weights following: begin, tick, finish, cancel. No event, no window.

Between `begin` and the end the artist paints with Blender's own brushes; `tick` is called now and then while no stroke
is going on. Objects are found by name each time, as undo replaces them.

A stroke on a large target is answered twice: at once with the rows around it, and once the brush has rested with the
solve of the whole, which does not depend on the strokes before.
"""

import time

import bpy

from .. import jobs, native
from ..scene import armature, attaching, brush, changes, mask, vertex_groups, weight_state
from ..scene.error import SceneError
from ..transfer.compute import Result
from ..transfer.params import TransferParams
from .session import MatchSession

# A solve this short is waited for: the view would be drawn in between, which takes about as long.
PATIENCE_SECONDS = 0.4
# How long the brush rests before the whole is solved: the view and the overlay are drawn meanwhile.
REST_SECONDS = 0.3

# What the brush paints into the mask's group.
BRUSH_WEIGHTS = {"INPAINT": 0.0, "AUTOMATIC": 0.5, "MATCH": 1.0}


def brush_value(context: bpy.types.Context) -> str:
    """Which of BRUSH_WEIGHTS the brush paints now, or nothing for another weight or without a brush."""
    weight = brush.weight(context)
    near = (name for name, value in BRUSH_WEIGHTS.items() if weight is not None and abs(weight - value) < 0.01)
    return next(near, "")


class MaskPainting:
    """The weights as they were, and the solve that follows the mask."""

    def __init__(self, context: bpy.types.Context, target: bpy.types.Object, params: TransferParams) -> None:
        """Prepare; nothing is written. Raises SceneError or native.NativeError."""
        settings = context.scene.skinwright
        mask.check(target)
        self.before = weight_state.capture(target)
        self.mask_group, self.overlay = target.skinwright.mask_group, settings.overlay.kind
        self.scene = context.scene.name
        self.session = MatchSession(settings.transfer.source, target, params)
        self.source = settings.transfer.source.name if params.add_armature else ""
        self.problem = ""
        # When weights were written, and how long after the mask had been seen to have changed.
        self.written_at: list[float] = []
        self.seconds: list[float] = []
        self._runner: jobs.Runner | None = None
        self._asked: tuple = ()
        self._since = 0.0
        # What the rows written last are solved with, if only those around a stroke are.
        self.unsettled: TransferParams | None = None
        self.settled_at = 0.0
        self._settling = False
        self._params = params
        self._modifiers: list[str] = []
        self.expect_stroke()

    def open(self, context: bpy.types.Context) -> None:
        """Show the match, and make the mask the group that is painted."""
        target = self.session.target()
        assert target is not None  # the session has just been made for it
        group = mask.ensure(target)
        target.vertex_groups.active = target.vertex_groups[group]
        context.scene.skinwright.overlay.kind = "MATCH"
        source = bpy.data.objects.get(self.source)
        if source and armature.find(source) and armature.find(target) is None:
            # Else the artist would see no weight at work.
            self._modifiers = attaching.attach(target, source)

    @property
    def armature_added(self) -> bool:
        """Whether the target had no armature and now has the source's."""
        return bool(self._modifiers)

    def expect_stroke(self) -> None:
        """A brush is down or may come down: the mask is to be read before Blender evaluates and counts the change."""
        self._version = -1
        if self._settling:
            # The stroke is not to wait for it.
            self._stop()

    def undone(self) -> None:
        """Undo has brought back old weights with the old mask."""
        self._asked, self.session.written = (), None

    def tick(self, params: TransferParams, live: bool) -> bool:
        """Start, take in, or leave alone the solve; gives whether weights were written."""
        target = self.session.target()
        if target is None:
            return False
        if self._version != changes.version:
            self._version = changes.version
            self.session.read_mask(target)
        asked = (self.session.mask_version, params)
        if live and asked != self._asked:
            self._asked = asked
            self._start(params, near=True)
            if self._runner:
                self._runner.wait(PATIENCE_SECONDS)
        elif self.unsettled and self._runner is None and time.perf_counter() > self.written_at[-1] + REST_SECONDS:
            self._start(self.unsettled, near=False)
            self._settling = self._runner is not None
        return self._take_in(target)

    def _start(self, params: TransferParams, near: bool) -> None:
        self._stop()
        self.problem, self._since, self._params = "", time.perf_counter(), params
        try:
            self._runner = jobs.Runner(self.session.solve(params, near))
            self.session.solving = True
        except native.NativeError as error:
            self.problem = str(error)

    def _take_in(self, target: bpy.types.Object) -> bool:
        if self._runner is None:
            return False
        try:
            if not self._runner.poll():
                return False
        except native.NativeError as error:
            if self._settling:
                self.unsettled = None
            self._stop()
            self.problem = str(error)
            return False
        except BaseException:
            self._stop()
            raise
        result, was_settling = self._runner.result, self._settling
        self._stop()
        self._write(target, result)
        if not was_settling:
            self.written_at.append(time.perf_counter())
            self.seconds.append(self.written_at[-1] - self._since)
        return True

    def _write(self, target: bpy.types.Object, result: Result) -> None:
        self.session.write(target, result)
        self.unsettled = None if result.report["solved_near"] is None else self._params
        if self.unsettled is None:
            self.settled_at = time.perf_counter()

    def settle(self) -> None:
        """Solve the whole now if only the rows around a stroke have been solved."""
        target = self.session.target()
        if target is None or self.unsettled is None:
            return
        self._stop()
        try:
            self._write(target, jobs.wait(self.session.solve(self.unsettled)))
        except native.NativeError as error:
            self.problem, self.unsettled = str(error), None

    def _stop(self) -> None:
        if self._runner:
            if not self._runner.done:
                self._runner.cancel()
            self._runner, self.session.solving, self._settling = None, False, False

    def stop(self) -> None:
        """Leave the solve that is going on; what it would have written is not."""
        self._stop()

    def finish(self) -> None:
        """Keep mask and weights; the active group becomes what it was."""
        self._stop()
        self.settle()
        target = self.session.target()
        if target:
            vertex_groups.activate(target, self.before.active)

    def restore(self) -> None:
        """Every weight, the mask and the modifiers as they were, bit for bit. Raises SceneError for another mesh."""
        self._stop()
        target = self.session.target()
        if target is None:
            raise SceneError(f"{self.session.target_name} has another number of vertices than before")
        weight_state.apply(target, self.before)
        target.skinwright.mask_group = self.mask_group
        for name in self._modifiers:
            if name in target.modifiers:
                target.modifiers.remove(target.modifiers[name])

    def close(self) -> None:
        """The overlay becomes what it was."""
        self._stop()
        scene = bpy.data.scenes.get(self.scene)
        if scene:
            scene.skinwright.overlay.kind = self.overlay
