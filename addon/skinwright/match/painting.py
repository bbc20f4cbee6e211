"""Painting the match mask with the weights following: begin, tick, finish, cancel. No event, no window.

Between `begin` and the end the artist paints with Blender's own brushes; `tick` is called now and then while no stroke
is going on. Objects are found by name each time, as undo replaces them.
"""

import time

import bpy

from .. import jobs, native
from ..scene import brush, changes, mask, vertex_groups, weight_state
from ..scene.error import SceneError
from ..transfer.params import TransferParams
from .session import MatchSession

# A solve this short is waited for: the view would be drawn in between, which takes about as long.
PATIENCE_SECONDS = 0.4

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
        """Show the match and go to Weight Paint mode on the mask. Raises SceneError or native.NativeError."""
        settings = context.scene.skinwright
        self.before = weight_state.capture(target)
        self.mask_group, self.mode, self.overlay = target.skinwright.mask_group, target.mode, settings.overlay.kind
        try:
            group = mask.ensure(target)
            self.session = MatchSession(settings.transfer.source, target, params)
        except (SceneError, native.NativeError):
            self._restore(target)
            raise
        target.vertex_groups.active = target.vertex_groups[group]
        settings.overlay.kind = "MATCH"
        if target.mode != "WEIGHT_PAINT":
            bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
        self.problem = ""
        # When weights were written, and how long after the mask had been seen to have changed.
        self.written_at: list[float] = []
        self.seconds: list[float] = []
        self._runner: jobs.Runner | None = None
        self._asked: tuple = ()
        self._since = 0.0
        self._undone = changes.undone
        self.expect_stroke()

    def expect_stroke(self) -> None:
        """A brush is down or may come down: the mask is to be read before Blender evaluates and counts the change."""
        self._version = -1

    def tick(self, params: TransferParams, live: bool) -> bool:
        """Start, take in, or leave alone the solve; gives whether weights were written."""
        target = self.session.target()
        if target is None:
            return False
        if self._version != changes.version:
            self._version = changes.version
            self.session.read_mask(target)
        if self._undone != changes.undone:
            # Undo has brought back old weights with the old mask.
            self._undone, self._asked, self.session.written = changes.undone, (), None
        asked = (self.session.mask_version, params)
        if live and asked != self._asked:
            self._asked = asked
            self._start(params)
            if self._runner:
                self._runner.wait(PATIENCE_SECONDS)
        return self._take_in(target)

    def _start(self, params: TransferParams) -> None:
        self._stop()
        self.problem, self._since = "", time.perf_counter()
        try:
            self._runner = jobs.Runner(self.session.solve(params))
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
            self._stop()
            self.problem = str(error)
            return False
        except BaseException:
            self._stop()
            raise
        result = self._runner.result
        self._stop()
        self.session.write(target, result)
        self.written_at.append(time.perf_counter())
        self.seconds.append(self.written_at[-1] - self._since)
        return True

    def _stop(self) -> None:
        if self._runner:
            if not self._runner.done:
                self._runner.cancel()
            self._runner, self.session.solving = None, False

    def finish(self, context: bpy.types.Context) -> None:
        """Keep mask and weights; mode, active group and overlay become what they were."""
        self._stop()
        target = self.session.target()
        if target:
            self._leave(context, target)
            vertex_groups.activate(target, self.before.active)

    def cancel(self, context: bpy.types.Context) -> None:
        """The same, with every weight as it was, bit for bit."""
        self._stop()
        target = self.session.target()
        if target:
            self._leave(context, target)
            self._restore(target)

    def _leave(self, context: bpy.types.Context, target: bpy.types.Object) -> None:
        context.scene.skinwright.overlay.kind = self.overlay
        if context.object == target and target.mode != self.mode:
            bpy.ops.object.mode_set(mode=self.mode)

    def _restore(self, target: bpy.types.Object) -> None:
        weight_state.apply(target, self.before)
        target.skinwright.mask_group = self.mask_group
