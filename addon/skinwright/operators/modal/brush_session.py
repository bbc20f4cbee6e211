"""What runs beside Blender's brushes, apart from the operator that feeds it events: it can outlive one."""

from dataclasses import dataclass

import bpy
from bpy.types import Context, Event, Object

from ... import jobs
from ...scene import identity


@dataclass(frozen=True)
class Message:
    """A sentence for the artist; `level` as Operator.report takes it."""

    level: str
    text: str


class BrushSession:
    """A kind of session. Any method may raise; `ending.end` sees to it that the others are called all the same."""

    # What the artist reads, and the name of the session's undo steps.
    label = ""
    # The operator's bl_idname.
    operator = ""
    # Object.mode of the brushes, and the context's modes in which the session goes on.
    mode = ""
    modes: frozenset[str] = frozenset()
    # The property of Object.skinwright that tells a state within the session from those before and after it.
    flag = ""
    keys = "Enter: keep   Esc: restore"

    def __init__(self, obj: Object) -> None:
        self.object = identity.of(obj)
        self.mode_before = obj.mode
        # KEEP or CANCEL, by a button of the panel.
        self.asked = ""
        self.news = ""
        # Its operator is gone, and another may take over.
        self.orphaned = False

    def target(self) -> Object | None:
        """The object that the brushes work on."""
        return self.object.find()

    def set_flag(self, value: bool) -> None:
        """Tell undo and files whether a session runs."""
        obj = self.target()
        if obj:
            setattr(obj.skinwright, self.flag, value)
            _mark_mesh(obj, value)

    def enter(self, context: Context) -> None:
        """Write what the session begins with, and go to the mode of its brushes."""
        raise NotImplementedError

    def problem(self, obj: Object) -> str:
        """Why the session cannot go on, or nothing."""
        return ""

    def changed_elsewhere(self, obj: Object) -> bool:
        """Whether something else has changed the mesh such that only Blender's own undo leads back."""
        return False

    def watch(self, context: Context, event: Event, held: bool) -> None:
        """Look for strokes; `held` says that another operator holds the input."""
        raise NotImplementedError

    def step(self, context: Context, back: bool) -> bool:
        """Undo or redo by the session's own history; False leaves the key to Blender."""
        return False

    def blender_stepped(self, context: Context, back: bool, brushing: bool) -> None:
        """Blender has undone or redone a step; `brushing`: before and after it the object was under the brush."""

    def settle(self, context: Context) -> None:
        """Take in a stroke that has just ended."""

    @property
    def has_work(self) -> bool:
        """Whether ending without keeping would lose anything."""
        raise NotImplementedError

    def keep(self, context: Context) -> list[Message]:
        """Leave the object as the session has made it."""
        raise NotImplementedError

    def restore(self) -> None:
        """Leave the object as it was before the session. Raises SceneError if its vertices are no longer the same."""
        raise NotImplementedError

    def tidy(self) -> None:
        """Before a file is saved: leave in the object what `keep` would leave."""

    def resume(self) -> None:
        """The file has been saved, and the session goes on."""

    def forget(self) -> None:
        """Nothing shows the session any more. Touches nothing of Blender's: the file may be another by now."""

    def release(self, context: Context) -> None:
        """Give up whatever else the session holds: jobs, overlays."""


# The session that runs; one at a time, whatever its kind.
current: BrushSession | None = None
# The last one that has ended, for undo steps older than Blender remembers.
ended: BrushSession | None = None

FLAGS = ("sculpting", "painting")
# A property of the mesh within a session. Blender's undo leaves a mesh as it is in memory, with all that has been
# written since, if its two steps hold the same of it.
_OF_MESH = "skinwright_session"
# The objects of all sessions in this file, by Blender's number. A copy made during one, and what comes from another
# file, may bear a mark as well, which means nothing.
_begun: set[int] = set()


def refusal() -> str:
    """Why nothing else may write weights now, or nothing: it would pull the ground from under a session, or under work
    that goes on in another window."""
    if jobs.running:
        return "Other work goes on: wait for its end, or stop it with Esc in its window"
    if current is None or current.orphaned:
        return ""
    return f"{current.label} runs on {current.object.name}: keep or cancel it first"


def begin(session: BrushSession) -> None:
    """The session runs from now on; its object has no mark yet."""
    global current
    unmark(marked())
    _begun.add(session.object.uid)
    current = session


def end(session: BrushSession) -> None:
    """No session runs, and what undo leads to belongs to the one that ran last."""
    global current, ended
    current, ended = None, session


def forget() -> None:
    """Another file: none of its objects has been in a session."""
    global current, ended
    current = ended = None
    _begun.clear()


def marked() -> list[Object]:
    """The objects with a session's mark, whether or not it means anything."""
    return [obj for obj in bpy.data.objects if any(getattr(obj.skinwright, flag) for flag in FLAGS)]


def flagged() -> list[Object]:
    """The objects in a state within a session."""
    return [obj for obj in marked() if obj.session_uid in _begun]


def unmark(objects: list[Object]) -> None:
    """Take the marks away."""
    for obj in objects:
        for flag in FLAGS:
            if getattr(obj.skinwright, flag):
                setattr(obj.skinwright, flag, False)
        _mark_mesh(obj, False)


def _mark_mesh(obj: Object, value: bool) -> None:
    if value:
        obj.data[_OF_MESH] = True
    elif obj.data and _OF_MESH in obj.data:
        del obj.data[_OF_MESH]
