"""Many calls of the native library on a thread of Python's own: polled, cancelled between two calls."""

import threading
from collections.abc import Callable, Sequence
from typing import Any


class Solving:
    """Does tasks one after the other, as `jobs.Runner` expects a job: the native module frees the interpreter."""

    def __init__(self, tasks: Sequence[Callable[[], Any]]) -> None:
        self._tasks = tasks
        self._results: list[Any] = []
        self._error: Exception | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _work(self) -> None:
        try:
            for task in self._tasks:
                if self._stop.is_set():
                    return
                self._results.append(task())
        except Exception as error:  # told where the result is asked for
            self._error = error

    @property
    def progress(self) -> float:
        """The share of the tasks that are done."""
        return len(self._results) / max(len(self._tasks), 1)

    @property
    def done(self) -> bool:
        """Whether `result` returns at once."""
        return not self._thread.is_alive()

    def cancel(self) -> None:
        """Stop after the call that is going on."""
        self._stop.set()

    def wait(self, seconds: float) -> None:
        """Return at its end, or after so many seconds."""
        self._thread.join(seconds)

    def result(self) -> list[Any]:
        """What the tasks returned; raises what one of them raised."""
        self._thread.join()
        if self._error:
            raise self._error
        return self._results
