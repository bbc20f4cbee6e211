"""What the artist asks of Sculpt Weights besides strokes: by keys, or by the panel's buttons."""

import bpy
from bpy.props import BoolProperty
from bpy.types import Context, Event, Object, Operator

from ...sculpt import session as sculpt_session

_KEYS = {"RET": "KEEP", "NUMPAD_ENTER": "KEEP", "ESC": "CANCEL"}


class SKINWRIGHT_OT_end_sculpt_weights(Operator):
    """The panel's buttons for Enter and Esc."""

    bl_idname = "skinwright.end_sculpt_weights"
    bl_label = "End Sculpting Weights"
    bl_description = "Stop sculpting weights"
    bl_options = {"INTERNAL"}

    asked = ""

    keep: BoolProperty(name="Keep", description="Keep the new weights, or bring back those before", default=True)

    @classmethod
    def poll(cls, _context: Context) -> bool:
        """While weights are sculpted."""
        return sculpt_session.current is not None

    def execute(self, _context: Context) -> set[str]:
        """The sculpting operator ends itself."""
        SKINWRIGHT_OT_end_sculpt_weights.asked = "KEEP" if self.keep else "CANCEL"
        return {"FINISHED"}


def forget() -> None:
    """A session begins, and no button has been pressed in it."""
    SKINWRIGHT_OT_end_sculpt_weights.asked = ""


def asked(event: Event, context: Context, obj: Object) -> str:
    """KEEP, CANCEL, UNDO, REDO or nothing. Keys count in Sculpt mode only, as posing has its own undo."""
    if SKINWRIGHT_OT_end_sculpt_weights.asked:
        return SKINWRIGHT_OT_end_sculpt_weights.asked
    if event.value != "PRESS" or context.mode != "SCULPT" or context.object != obj:
        return ""
    if event.type == "Z" and (event.ctrl or event.oskey):
        return "REDO" if event.shift else "UNDO"
    return _KEYS.get(event.type, "")


def register() -> None:
    """Register the operator."""
    bpy.utils.register_class(SKINWRIGHT_OT_end_sculpt_weights)


def unregister() -> None:
    """Unregister it."""
    bpy.utils.unregister_class(SKINWRIGHT_OT_end_sculpt_weights)
