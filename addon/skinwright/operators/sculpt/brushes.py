"""A sculpt session beside Blender's brushes.

A modal operator never sees the release that ends a stroke: the brush takes it. So it looks, on a timer, whether
something has changed while no other operator holds the input, and the session looks which vertices have moved.
"""

from bpy.types import Context, Event, Object

from ...errors import Refused
from ...scene import changes, modes
from ...sculpt import session as sculpt_session
from ...sculpt.session import ADVICE, POOR, Outcome, SculptOptions, SculptSession
from ..modal import undo
from ..modal.brush_session import BrushSession, Message
from .watch import StrokeWatch


class SculptBrushes(BrushSession):
    """Strokes become weights."""

    label = "Sculpt Weights"
    operator = "skinwright.sculpt_weights"
    mode = "SCULPT"
    # While posing between strokes, Object and Pose mode belong to the session too.
    modes = frozenset({"SCULPT", "OBJECT", "POSE"})
    flag = "sculpting"
    keys = "Ctrl Z: undo   Ctrl Shift Z: redo   Enter: keep   Esc: restore"

    def __init__(self, obj: Object, options: SculptOptions) -> None:
        super().__init__(obj)
        self.session = SculptSession(obj, options)
        self.news = "sculpt, and the weights follow"
        self._was_changed, self._checked = False, -1
        # Blender's undo step of each stroke, also of those taken back.
        self._stroke_at: list[int] = []

    def enter(self, _context: Context) -> None:
        """Sculpt mode, and the mesh ready for strokes."""
        sculpt_session.current = self.session
        modes.go_to(self.target(), self.mode)
        self.session.open()
        self._watch = StrokeWatch(self.session)

    def target(self) -> Object | None:
        """None also if the armature is gone."""
        return self.session.target()

    def problem(self, obj: Object) -> str:
        """Other bones; looked at only when something has changed, as this is asked with every event."""
        if self._checked == changes.version:
            return ""
        self._checked = changes.version
        return self.session.problem(obj)

    def changed_elsewhere(self, obj: Object) -> bool:
        """Remeshed, for instance."""
        return self.session.has_other_vertices(obj)

    def watch(self, context: Context, event: Event, held: bool) -> None:
        """A press may be a brush coming down; while none is, there may be a stroke to take in."""
        self._was_changed = self.changed_elsewhere(self.target())
        if self._was_changed:
            self.news = "something else has changed the vertices, undo it"
        elif held or event.value == "PRESS":
            self._watch.expect_stroke()
        else:
            self._look(context)

    def _look(self, context: Context) -> None:
        try:
            outcome = self._watch.look(context.scene.skinwright.sculpt.kappa)
        except Refused as error:
            self.news = str(error)
            return
        if outcome:
            del self._stroke_at[self.session.stroke_count - 1 :]
            self._stroke_at.append(undo.position() or 0)
            self.news = _sentence(outcome)

    def settle(self, context: Context) -> None:
        """A stroke may have ended just now."""
        obj = self.target()
        assert obj is not None  # a session whose object is gone is not settled
        if obj.mode == self.mode and not self.changed_elsewhere(obj):
            self._look(context)

    def step(self, _context: Context, back: bool) -> bool:
        """The session's own history, stroke by stroke."""
        done = self.session.undo() if back else self.session.redo()
        self.news = self._count() if done else f"nothing to {'undo' if back else 'redo'}"
        return True

    def blender_stepped(self, context: Context, back: bool, brushing: bool) -> None:
        """Edit > Undo means the last stroke, as Ctrl Z does; what Blender has brought back is not the session's."""
        if self.changed_elsewhere(self.target()):
            return
        if brushing and not self._was_changed:
            self._follow(context, back, undo.position())
        self.session.assert_state()

    def _follow(self, context: Context, back: bool, now: int | None) -> None:
        """Take back or redo the strokes between the session and Blender's step `now`; one, where that is not known."""
        if now is None:
            self.step(context, back)
            return
        session, at = self.session, self._stroke_at
        while back and session.stroke_count and at[session.stroke_count - 1] > now:
            self.step(context, back)
        while not back and session.stroke_count < len(at) and at[session.stroke_count] <= now:
            self.step(context, back)

    def _count(self) -> str:
        count = self.session.stroke_count
        return f"{count} stroke{'s' * (count != 1)}"

    @property
    def has_work(self) -> bool:
        """Strokes that count."""
        return self.session.stroke_count > 0

    def keep(self, _context: Context) -> list[Message]:
        """The new weights on the old shape."""
        report = self.session.commit()
        messages = [Message("WARNING", warning) for warning in report.warnings]
        return [Message("INFO", report.sentence()), *messages]

    def restore(self) -> None:
        """Bit for bit."""
        self.session.cancel()

    def tidy(self) -> None:
        """A file gets the weights so far."""
        if not self.changed_elsewhere(self.target()):
            self.session.tidy()

    def resume(self) -> None:
        """The bones to choose from again."""
        if not self.changed_elsewhere(self.target()):
            self.session.assert_state()

    def forget(self) -> None:
        """The panel shows the button to begin again."""
        sculpt_session.current = None


def _sentence(outcome: Outcome) -> str:
    """How far weights have come, and what to do if not far."""
    reached = f"{outcome.vertices} vertices, {outcome.reachability:.0%} of the sculpt reached"
    if outcome.reachability >= POOR:
        return reached
    return f"{reached}. {ADVICE}"
