"""Work that may take seconds: on Rust's threads, with a progress bar, and Esc stops it with nothing written."""

from typing import Any

from bpy.types import Context, Event, Operator

from ... import jobs, reporting
from ...errors import Refused, sentence
from . import status, timers

TICK_SECONDS = 0.05


class LongWork(Operator):
    """Base of an operator: `begin` starts the work, `complete` gets what it gave."""

    def complete(self, context: Context, result: Any) -> set[str]:
        """Say what was done."""
        raise NotImplementedError

    def begin(self, context: Context, steps: jobs.Jobs[Any]) -> set[str]:
        """Start; what is done by then is completed at once."""
        try:
            runner = jobs.Runner(steps)
        except Refused as error:
            return self._failed(error)
        if runner.done:
            return self.complete(context, runner.result)
        self._runner = jobs.running = runner
        self._timer = timers.start(context, TICK_SECONDS)
        context.window_manager.modal_handler_add(self)
        _show(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: Context, event: Event) -> set[str]:
        """Everything but Esc waits: the scene must not change between reading and writing."""
        runner = self._runner
        if event.type == "ESC" and event.value == "PRESS":
            self.cancel(context)
            self.report({"INFO"}, "Stopped; nothing was written")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        try:
            runner.poll()
            _show(context)
            if not runner.done:
                return {"RUNNING_MODAL"}
            self._end(context)
            return self.complete(context, runner.result)
        except BaseException as error:
            # Also a panic of the native module. Else the timer would come back to it for ever.
            self._end(context)
            return self._failed(error)

    def _failed(self, error: BaseException) -> set[str]:
        text = sentence(self.bl_label, error)
        if isinstance(error, ReferenceError):
            text = f"{self.bl_label}: an object was deleted while it worked, so nothing was written"
        reporting.remember(self.bl_label, text, failed=True)
        self.report({"ERROR"}, text)
        return {"CANCELLED"}

    def cancel(self, context: Context) -> None:
        """Also called by Blender, when it loads a file or quits."""
        self._runner.cancel()
        self._end(context)

    def _end(self, context: Context) -> None:
        jobs.running = None
        timers.stop(self._timer)
        _show(context)


def _show(context: Context) -> None:
    runner = jobs.running
    if runner:
        status.show(context, f"Skinwright: {runner.progress:.0%}   Esc: stop, nothing is written")
    else:
        status.clear()


def register() -> None:
    """Nothing runs yet."""


def unregister() -> None:
    """The operators' classes are gone, and Blender has not told those that worked."""
    if jobs.running:
        jobs.running.cancel()
        jobs.running = None
        status.clear()
