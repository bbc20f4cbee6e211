"""When to look for a stroke, and what is done about it. No window: the operator says when no brush is down."""

from ...scene import changes
from ...sculpt.session import Outcome, SculptSession


class StrokeWatch:
    """Looks only when there may be a stroke, as a look reads the whole mesh."""

    def __init__(self, session: SculptSession) -> None:
        """Nothing has changed yet."""
        self._session = session
        self._seen: int | None = changes.version
        self._expected: int | None = None

    def expect_stroke(self) -> None:
        """A brush is down or may come down: what it does is in the mesh before Blender evaluates and counts it.

        A brush that rests leaves time for what the stroke would else wait for; one that moves is not slowed down.
        """
        if self._expected == changes.version:
            self._session.expect_stroke()
        self._expected = changes.version
        self._seen = None

    def look(self, kappa: float) -> Outcome | None:
        """Turn into weights what has moved since the last look, None if nothing has. Raises as the session does."""
        if self._seen == changes.version:
            return None
        self._seen = changes.version
        self._session.set_strength(kappa)
        return self._session.stroke()
