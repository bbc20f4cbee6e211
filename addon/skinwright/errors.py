"""What every part of the add-on refuses with, and the sentence for what none of them expected."""

import sys
import traceback


class Refused(ValueError):
    """One sentence for the artist: the object, the problem and the cure. Raised before anything is written."""


def sentence(label: str, error: BaseException) -> str:
    """What the artist reads of an error; `label` names the work that it has stopped."""
    if isinstance(error, Refused):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        return f"{label}: {error.strerror}: {error.filename}" if error.filename else f"{label}: {error.strerror}"
    return f"{label}: {internal(error)}"


def internal(error: BaseException) -> str:
    """The sentence for an error nobody foresaw; its traceback goes to stderr, where a report of the bug needs it."""
    traceback.print_exception(error, file=sys.stderr)
    lines = str(error).strip().splitlines()
    detail = f"{type(error).__name__}: {lines[-1]}" if lines else type(error).__name__
    if isinstance(error, MemoryError):
        return f"There is not enough memory ({detail}); nothing was changed. Close other work or use a smaller mesh"
    return f"Internal error ({detail}); nothing was changed. Please report it with the traceback on the console"
