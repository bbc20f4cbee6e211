"""Base of the operators that run beside Blender's brushes. No exception leaves them or leaves a session behind."""

import bpy
from bpy.types import Context, Event, Object, Operator

from ...errors import Refused, internal
from ...scene import changes
from ...stored import keeping
from . import brush_session, ending, held_input, keep_alive, status, timers
from .brush_session import BrushSession, Message
from .ending import Ending, remember

_KEYS = {"RET": "KEEP", "NUMPAD_ENTER": "KEEP", "ESC": "CANCEL"}


class SessionOperator(Operator):
    """Translates events for a `BrushSession`, which `make` begins. Everything else is the brushes' and the view's."""

    _session: BrushSession

    def make(self, context: Context) -> BrushSession:
        """The session, with nothing written yet. Raises SceneError or NativeError."""
        raise NotImplementedError

    def invoke(self, context: Context, _event: Event) -> set[str]:
        """Begin, or take over a session whose operator has gone with its window."""
        session = brush_session.current
        if session is None:
            session = self._begun(context)
            if session is None:
                return {"CANCELLED"}
        session.orphaned = False
        self._session = session
        self._undone, self._redone, self._mode = changes.undone, changes.redone, session.mode
        self._timer = timers.start(context, timers.BRUSH_SECONDS)
        context.window_manager.modal_handler_add(self)
        keep_alive.start()
        _show(context, session)
        return {"RUNNING_MODAL"}

    def _begun(self, context: Context) -> BrushSession | None:
        try:
            session = self.make(context)
            keeping.keep_before([session.target()], session.label)
        except Refused as error:
            self._tell([Message("ERROR", str(error))])
            return None
        brush_session.begin(session)
        try:
            # The way back from the session leads to this step, the one below is where its strokes begin.
            bpy.ops.ed.undo_push(message=f"Before {session.label}")
            session.set_flag(True)
            session.enter(context)
        except BaseException as error:
            self._tell(ending.end(context, session, Ending.BROKEN, f"{session.label} cannot begin: {_reason(error)}"))
            return None
        bpy.ops.ed.undo_push(message=session.label)
        return session

    def modal(self, context: Context, event: Event) -> set[str]:
        """Feed the session, and end it in order if that fails."""
        session = self._session
        if brush_session.current is not session:
            timers.stop(self._timer)  # it has been ended from elsewhere
            return {"CANCELLED"}
        try:
            result = self._handle(context, event)
        except BaseException as error:
            internal(error)  # its traceback belongs on the console
            problem = f"{session.label} has ended because of an error ({type(error).__name__}: {error})"
            result = self._end(context, Ending.BROKEN, problem)
        return result

    def _handle(self, context: Context, event: Event) -> set[str]:
        session = self._session
        obj = session.target()
        if obj is None:
            return self._end(context, Ending.ASIDE, f"{session.object.name} is gone: {session.label} has ended")
        if self._blender_stepped(context, obj):
            return self._end(context, Ending.UNDONE, f"Undo has gone back to before {session.label}, which has ended")
        why = _aside(context, session) or session.problem(obj)
        if why:
            return self._end(context, Ending.ASIDE, f"{why}: {session.label} has ended, its work is kept")
        held = held_input.by_another(context, type(self))
        asked = session.asked or self._key(context, event, held)
        if asked in ("KEEP", "CANCEL"):
            return self._end(context, Ending[asked])
        if asked and not session.changed_elsewhere(obj) and session.step(context, asked == "UNDO"):
            _show(context, session)
            return {"RUNNING_MODAL"}
        if _is_under_the_brush(context, session):
            news = session.news
            session.watch(context, event, held)
            if session.news != news:
                _show(context, session)
        self._mode = obj.mode
        return {"PASS_THROUGH"}

    def _key(self, context: Context, event: Event, held: bool) -> str:
        """KEEP, CANCEL, UNDO, REDO or nothing."""
        session = self._session
        if event.value != "PRESS" or held or not _is_under_the_brush(context, session):
            return ""
        undo = event.type == "Z" and (event.ctrl or event.oskey) and not event.alt
        asked = ("REDO" if event.shift else "UNDO") if undo else _KEYS.get(event.type, "")
        return "" if asked and held_input.is_elsewhere(context, event) else asked

    def _blender_stepped(self, context: Context, obj: Object) -> bool:
        """Tell the session what Blender has undone or redone; whether that leads out of it."""
        undone, redone = changes.undone - self._undone, changes.redone - self._redone
        if not undone and not redone:
            return False
        self._undone, self._redone = changes.undone, changes.redone
        session = self._session
        if not getattr(obj.skinwright, session.flag):
            return True
        brushing = self._mode == obj.mode == session.mode
        for back, count in ((True, undone), (False, redone)):
            for _ in range(count):
                session.blender_stepped(context, back, brushing)
        _show(context, session)
        return False

    def _end(self, context: Context, how: Ending, why: str = "") -> set[str]:
        """In every case a new undo step: the last one is within the session."""
        timers.stop(self._timer)
        self._tell(ending.end(context, self._session, how, why))
        return {"FINISHED"}

    def _tell(self, messages: list[Message]) -> None:
        remember(self.bl_label, messages)
        for message in messages:
            self.report({message.level}, message.text)

    def cancel(self, context: Context) -> None:
        """Called by Blender when it loads a file, quits, closes the window or disables the add-on."""
        timers.stop(self._timer)
        if brush_session.current is self._session:
            keep_alive.orphan(self._session)


def is_orphaned() -> bool:
    """Whether a session waits for an operator."""
    return brush_session.current is not None and brush_session.current.orphaned


def shut_down(operator: str) -> None:
    """The operator's class goes: end its session first."""
    session = brush_session.current
    if session and session.operator == operator:
        remember(session.label, ending.end(bpy.context, session, Ending.ASIDE))


def _is_under_the_brush(context: Context, session: BrushSession) -> bool:
    return context.object is not None and context.object == session.target() and context.object.mode == session.mode


def _aside(context: Context, session: BrushSession) -> str:
    """How the artist has left the session, or nothing."""
    active = context.object
    if context.mode not in session.modes:
        return f"{session.object.name} is in another mode"
    if active and active != session.target() and active.mode == session.mode:
        return f"{active.name} is under the brush now"
    return ""


def _reason(error: BaseException) -> str:
    return str(error) if isinstance(error, Refused) else internal(error)


def _show(context: Context, session: BrushSession) -> None:
    status.show(context, f"{session.label}   {session.keys}   {session.news}")
