"""Painting the match mask beside Blender's brushes; the weights follow every stroke."""

from bpy.types import Context, Event, Object

from ... import preferences
from ...match import session as match_session
from ...match.painting import MaskPainting
from ...scene import modes
from ...transfer.params import TransferParams
from ..modal.brush_session import BrushSession, Message


class MaskBrushes(BrushSession):
    """Strokes change the mask, the mask changes the weights."""

    label = "Paint Match Mask"
    operator = "skinwright.paint_match_mask"
    mode = "WEIGHT_PAINT"
    modes = frozenset({"PAINT_WEIGHT"})
    flag = "painting"

    def __init__(self, context: Context, obj: Object) -> None:
        super().__init__(obj)
        self.painting = MaskPainting(context, obj, params(context))
        self.news = "0 inpaints, 0.5 is automatic, 1 forces a match"

    def enter(self, context: Context) -> None:
        """Weight Paint mode on the mask, the match on show."""
        match_session.current = self.painting.session
        self.painting.open(context)
        if self.painting.armature_added:
            self.news = f"{self.object.name} has the source's armature now"
        modes.go_to(self.target(), self.mode)

    def problem(self, obj: Object) -> str:
        """Other vertices: what was prepared no longer fits."""
        return "" if self.painting.session.target() == obj else f"{obj.name} has other vertices"

    def watch(self, context: Context, event: Event, held: bool) -> None:
        """A press may be a brush coming down; on the timer, look whether the mask has changed."""
        if held or event.value == "PRESS":
            self.painting.expect_stroke()
        elif event.type == "TIMER" and self.painting.tick(params(context), context.scene.skinwright.overlay.live):
            for area in context.screen.areas:
                if area.type == "VIEW_3D":
                    area.tag_redraw()

    def blender_stepped(self, _context: Context, _back: bool, _brushing: bool) -> None:
        """Blender's undo is the one for strokes here."""
        self.painting.undone()

    @property
    def has_work(self) -> bool:
        """Painting solves as it begins, so weights have changed in any case."""
        return bool(self.painting.written_at)

    def keep(self, _context: Context) -> list[Message]:
        """Mask and weights."""
        self.painting.finish()
        added = ", and it has the source's armature now" if self.painting.armature_added else ""
        return [Message("INFO", f"{self.object.name}: mask and weights kept{added}")]

    def tidy(self) -> None:
        """No file gets rows that are not quite those of a transfer."""
        self.painting.settle()

    def restore(self) -> None:
        """Bit for bit."""
        self.painting.restore()

    def release(self, _context: Context) -> None:
        """The overlay as it was."""
        self.painting.close()


def params(context: Context) -> TransferParams:
    """The panel's settings."""
    return context.scene.skinwright.transfer.to_params(preferences.threads(context))
