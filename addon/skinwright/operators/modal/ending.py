"""The order in which a session ends, whatever has happened: each part is tried, and what fails is said."""

from collections.abc import Callable
from enum import Enum
from typing import Any

import bpy
from bpy.types import Context

from ... import reporting
from ...errors import Refused, internal
from ...scene import mesh, modes
from . import brush_session, status, undo
from .brush_session import BrushSession, Message


class Ending(Enum):
    """Why a session ends."""

    KEEP = "KEEP"
    CANCEL = "CANCEL"
    # The artist has gone elsewhere or something stands in the way: kept, and out of the brushes' mode.
    ASIDE = "ASIDE"
    # Blender's undo has gone back to before the session.
    UNDONE = "UNDONE"
    # An exception that nobody expected.
    BROKEN = "BROKEN"


class _Attempts:
    """Runs parts of an ending one after the other; an exception ends only its own part."""

    def __init__(self) -> None:
        self.messages: list[Message] = []

    def run(self, part: Callable[..., Any], *arguments: Any, otherwise: str) -> bool:
        try:
            result = part(*arguments)
        except (Refused, RuntimeError) as error:
            self.messages.append(Message("WARNING", f"{otherwise}: {error}"))
            return False
        except BaseException as error:
            # A panic of the native module is no Exception.
            self.messages.append(Message("ERROR", f"{otherwise}: {internal(error)}"))
            return False
        if isinstance(result, list):
            self.messages += result
        return True


def end(context: Context, session: BrushSession, ending: Ending, why: str = "") -> list[Message]:
    """End the session, and say what became of its work. Never raises; afterwards nothing of it runs."""
    attempts = _Attempts()
    if why:
        attempts.messages.append(Message("ERROR" if ending is Ending.BROKEN else "WARNING", why))
    brush_session.end(session)
    obj = session.target()
    if obj and ending is not Ending.UNDONE:
        attempts.run(_write, context, session, ending, attempts, otherwise=f"{obj.name} could not be restored")
    session.forget()
    attempts.run(session.release, context, otherwise=f"{session.label} left something behind")
    attempts.run(_unmark, otherwise=f"{session.label} left a mark")
    attempts.run(_leave, session, ending, otherwise="The mode is as it was")
    status.clear()
    return attempts.messages


def _write(context: Context, session: BrushSession, ending: Ending, attempts: _Attempts) -> None:
    name = session.object.name
    if ending is not Ending.BROKEN:
        attempts.run(session.settle, context, otherwise=f"The last stroke on {name} is lost")
    # The brushes' own steps hold nothing but what a brush has moved: from a step within the session that holds all,
    # undo leads through them with the session's flag on the object.
    attempts.run(_push, session.label, otherwise=f"Undo of {session.label} takes several steps")
    if ending in (Ending.KEEP, Ending.CANCEL) and session.changed_elsewhere(session.target()):
        attempts.run(_back_to_the_mesh, name, otherwise=f"The vertices of {name} are not those that were sculpted")
    with mesh.object_mode(context):
        if ending is Ending.CANCEL:
            _cancel(context, session, attempts)
        elif not attempts.run(session.keep, context, otherwise=f"The work on {name} could not be kept"):
            restored = attempts.run(session.restore, otherwise=f"{name} stays as it is")
            if restored:
                attempts.messages.append(Message("WARNING", f"{name} is as it was before {session.label}"))


def _back_to_the_mesh(name: str) -> list[Message]:
    """To before the session, as only Blender's undo knows the mesh from before it was remeshed."""
    undo.leave_session()
    return [Message("WARNING", f"{name} had other vertices: all that was done since the session began is undone")]


def _push(message: str) -> None:
    bpy.ops.ed.undo_push(message=message)


def _cancel(context: Context, session: BrushSession, attempts: _Attempts) -> None:
    """Back to before the session; one undo step brings its work back."""
    name = session.object.name
    undoable = session.has_work and attempts.run(_step_of_work, context, session, otherwise=f"No undo step for {name}")
    if not attempts.run(session.restore, otherwise=f"{name} stays as it is"):
        return
    text = f"{name} is as it was before {session.label}"
    attempts.messages.append(Message("INFO", f"{text}; undo brings the work back" if undoable else text))


def _step_of_work(context: Context, session: BrushSession) -> None:
    session.keep(context)
    session.set_flag(False)
    modes.go_to(session.target(), session.mode_before)
    _push(session.label)


def _unmark() -> None:
    """Also the copies that were made of the object meanwhile."""
    brush_session.unmark(brush_session.marked())


def _leave(session: BrushSession, ending: Ending) -> None:
    obj = session.target()
    if obj and obj.mode == session.mode:
        planned = ending in (Ending.KEEP, Ending.CANCEL)
        modes.go_to(obj, session.mode_before if planned else "OBJECT")


def remember(label: str, messages: list[Message]) -> None:
    """For the panel: the last sentence that is not a warning is the result."""
    results = [message for message in messages if message.level != "WARNING"] or messages[:1]
    if results:
        warnings = [message.text for message in messages if message is not results[-1]]
        reporting.remember(label, results[-1].text, warnings, failed=results[-1].level == "ERROR")
