"""Long work as a generator that yields native jobs: waited for at once, or polled so that Blender's window lives on."""

import sys
import time
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import bpy

from . import native

T = TypeVar("T")
# Each job that is yielded is answered with its result.
Jobs = Generator["Work", Any, T]

# What the panel shows the progress of.
running: "Runner | None" = None

_QUIET_SECONDS = 1.0


class Work(Protocol):
    """What `Runner` waits for: native.Job, Step, or whatever else has these."""

    @property
    def progress(self) -> float:
        """The share that is done."""

    @property
    def done(self) -> bool:
        """Whether `result` returns at once."""

    def cancel(self) -> None:
        """Ask it to stop."""

    def wait(self, seconds: float) -> None:
        """Return at its end, or after so many seconds."""

    def result(self) -> Any:
        """The answer; waits for it."""


@dataclass(frozen=True)
class Step:
    """A pause in Python's own work, yielded in place of a job: the window lives on, and Esc can stop it here."""

    progress: float
    done: bool = True

    def cancel(self) -> None:
        """There is nothing going on."""

    def wait(self, seconds: float) -> None:
        """There is nothing to wait for."""

    def result(self) -> None:
        """There is nothing to answer."""


class Runner:
    """Work under way; `result` is there once `done`. Poll it from one place."""

    def __init__(self, steps: Jobs[Any]) -> None:
        self._steps = steps
        self._job: Work | None = None
        self.done = False
        self.result: Any = None
        self._advance(lambda: next(steps))

    @property
    def progress(self) -> float:
        """The share of the present job that is done."""
        return self._job.progress if self._job else 1.0

    def poll(self) -> bool:
        """Take a step if the present job has ended; gives whether all is done. Raises what the steps raise."""
        if self._job and self._job.done:
            self._answer(self._job)
        return self.done

    def wait(self, seconds: float) -> None:
        """Give the present job this long to end."""
        if self._job:
            self._job.wait(seconds)

    def cancel(self) -> None:
        """Stop without the steps that are left."""
        if self._job:
            self._job.cancel()
        self._steps.close()
        self.done = True

    def _answer(self, job: Work) -> None:
        try:
            answer = job.result()
        except native.NativeError as error:
            sentence = error  # the steps may go on without it
            self._advance(lambda: self._steps.throw(sentence))
            return
        self._advance(lambda: self._steps.send(answer))

    def _advance(self, step: Callable[[], Work]) -> None:
        try:
            self._job = step()
        except StopIteration as end:
            self._job, self.done, self.result = None, True, end.value


def wait(steps: Jobs[T]) -> T:
    """Do all steps before returning; without a window the progress of long work goes to stderr."""
    runner = Runner(steps)
    watch = _print_progress() if bpy.app.background else None
    while not runner.poll():
        runner.wait(0.1)
        if watch:
            watch(runner.progress)
    return runner.result


def _print_progress() -> Callable[[float], None]:
    """A watch that writes to stderr, once a tenth and not for short work."""
    start, last = time.perf_counter(), [-1]

    def watch(progress: float) -> None:
        tenth = int(progress * 10)
        if time.perf_counter() - start > _QUIET_SECONDS and tenth != last[0]:
            last[0] = tenth
            print(f"Skinwright: {tenth * 10} %", file=sys.stderr, flush=True)

    return watch
