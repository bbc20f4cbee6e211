"""The panel of the last result: its sentence and its warnings, as long as the artist needs them."""

import textwrap

from bpy.types import Context, Panel, UILayout

from .. import reporting
from ..registration import registration
from .panel import Tab

# Of the interface's font at scale 1, on average, and what icons and margins take.
_LETTER, _MARGIN = 6.6, 52


class SKINWRIGHT_PT_result(Tab, Panel):
    """What the last operator said."""

    bl_label = "Last Result"
    bl_order = 2

    @classmethod
    def poll(cls, _context: Context) -> bool:
        """Nothing has been done yet, or the artist has read it."""
        return reporting.last is not None

    def draw_header_preset(self, _context: Context) -> None:
        """The way to be rid of it."""
        self.layout.operator("skinwright.forget_result", text="", icon="X", emboss=False)

    def draw(self, context: Context) -> None:
        """Lines as long as the sidebar is wide."""
        result = reporting.last
        if result is None:
            return
        column = self.layout.column(align=True)
        column.label(text=result.title)
        paragraph(column, context, result.sentence, "ERROR" if result.failed else "CHECKMARK", alert=result.failed)
        for icon, sentences in (("INFO", result.facts), ("ERROR", result.warnings)):
            for sentence in sentences:
                column.separator()
                paragraph(column, context, sentence, icon)


def paragraph(layout: UILayout, context: Context, text: str, icon: str = "NONE", *, alert: bool = False) -> None:
    """A sentence over several lines, the icon beside the first."""
    scale = context.preferences.system.ui_scale
    letters = max(int((context.region.width / scale - _MARGIN) / _LETTER), 16)
    for number, line in enumerate(textwrap.wrap(text, letters)):
        row = layout.row()
        row.alert = alert
        row.scale_y = 0.8
        row.label(text=line, icon=icon if number == 0 else ("BLANK1" if icon != "NONE" else "NONE"))


register, unregister = registration(SKINWRIGHT_PT_result)
