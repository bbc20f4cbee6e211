"""The panel of stored weights."""

from bpy.types import Context, Panel

from ..registration import registration
from ..stored import keeping
from .panel import Tab

_SHOWN = 12


class SKINWRIGHT_PT_stored(Tab, Panel):
    """Weights of the active mesh that can be brought back."""

    bl_label = "Stored Weights"
    bl_order = 8
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Context) -> bool:
        """For a mesh."""
        return context.object is not None and context.object.type == "MESH"

    def draw(self, context: Context) -> None:
        """The newest first, each with its buttons; then what all of them take."""
        layout, obj = self.layout, context.object
        row = layout.row(align=True)
        row.operator("skinwright.store_weights", text="Store", icon="ADD")
        row.operator("skinwright.export_weights", text="", icon="EXPORT")
        row.operator("skinwright.import_weights", text="", icon="IMPORT")
        found = keeping.entries(obj)
        column = layout.column(align=True)
        for number in range(len(found) - 1, max(len(found) - 1 - _SHOWN, -1), -1):
            row = column.row(align=True)
            row.label(text=found[number].name, icon="TIME" if found[number].automatic else "GROUP_VERTEX")
            row.operator("skinwright.compare_weights", text="", icon="OVERLAY").state = str(number)
            row.operator("skinwright.restore_weights", text="", icon="LOOP_BACK").state = str(number)
        if found:
            row = layout.row(align=True)
            row.label(text=f"{len(found)} state{'s' * (len(found) != 1)}, {keeping.size(obj) / 1024:,.0f} KiB")
            row.operator("skinwright.forget_weights", text="", icon="TRASH")


register, unregister = registration(SKINWRIGHT_PT_stored)
