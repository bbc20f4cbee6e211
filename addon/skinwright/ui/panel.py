"""The Weights tab of the sidebar: a list of sub-panels, one a step."""

import bpy
from bl_ui.utils import PresetPanel
from bpy.types import Context, Panel, UILayout

from .. import jobs
from ..native import problem


class Tab:
    """Where all of Skinwright's panels live."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Weights"


class _TransferStep(Tab):
    """A sub-panel of settings under the button."""

    bl_parent_id = "SKINWRIGHT_PT_transfer"
    bl_options = {"DEFAULT_CLOSED"}


class SKINWRIGHT_PT_transfer_presets(PresetPanel, Panel):
    """Ready-made settings by kind of garment."""

    bl_label = "Garment Presets"
    preset_subdir = "skinwright/transfer_weights"
    preset_operator = "script.execute_preset"
    preset_add_operator = "skinwright.transfer_preset_add"


class SKINWRIGHT_PT_transfer(Tab, Panel):
    """Source and button; all else has a default that does."""

    bl_label = "Transfer Weights"
    bl_order = 1

    def draw_header_preset(self, _context: Context) -> None:
        """The presets' button, on the right of the header."""
        SKINWRIGHT_PT_transfer_presets.draw_panel_header(self.layout)

    def draw(self, context: Context) -> None:
        """Problems first, as red rows."""
        layout = _settings_column(self.layout)
        if problem():
            row = layout.row()
            row.alert = True
            row.label(text="The native module cannot be used", icon="ERROR")  # the button's tooltip says why
        settings = context.scene.skinwright.transfer
        row = layout.row(align=True)
        row.prop(settings, "source")
        row.operator("skinwright.active_as_source", text="", icon="RESTRICT_SELECT_OFF")
        layout.prop(settings, "groups")
        if jobs.running:
            layout.progress(factor=jobs.running.progress, text=f"{jobs.running.progress:.0%}, Esc stops")
        layout.operator("skinwright.transfer_weights", icon="MOD_VERTEX_WEIGHT")
        layout.operator("skinwright.automatic_weights", icon="BONE_DATA")


class SKINWRIGHT_PT_transfer_matching(_TransferStep, Panel):
    """Which vertices take over the weights of their closest point."""

    bl_label = "Matching"

    def draw(self, context: Context) -> None:
        """As the operator lays them out."""
        context.scene.skinwright.transfer.draw_matching(_settings_column(self.layout))


class SKINWRIGHT_PT_transfer_mask(_TransferStep, Panel):
    """The active mesh's match mask."""

    bl_label = "Mask"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Each mesh has its own mask."""
        return context.object is not None and context.object.type == "MESH"

    def draw(self, context: Context) -> None:
        """The group and how it is read."""
        layout = _settings_column(self.layout)
        settings = context.object.skinwright
        layout.prop_search(settings, "mask_group", context.object, "vertex_groups", icon="GROUP_VERTEX")
        column = layout.column()
        column.active = bool(settings.mask_group)
        column.prop(settings, "mask_reading")
        if settings.mask_reading == "PAINTED":
            column.prop(settings, "mask_threshold", slider=True)
            column.prop(settings, "mask_invert")


class SKINWRIGHT_PT_transfer_inpainting(_TransferStep, Panel):
    """What happens where nothing matches."""

    bl_label = "Inpainting"

    def draw(self, context: Context) -> None:
        """As the operator lays them out."""
        context.scene.skinwright.transfer.draw_inpainting(_settings_column(self.layout))


class SKINWRIGHT_PT_transfer_writing(_TransferStep, Panel):
    """How the new weights join the old ones."""

    bl_label = "Writing"

    def draw(self, context: Context) -> None:
        """As the operator lays them out."""
        context.scene.skinwright.transfer.draw_writing(_settings_column(self.layout))
        self.layout.operator("skinwright.reset_settings", icon="LOOP_BACK")


def _settings_column(layout: UILayout) -> UILayout:
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout.column()


CLASSES = (
    SKINWRIGHT_PT_transfer_presets,
    SKINWRIGHT_PT_transfer,
    SKINWRIGHT_PT_transfer_matching,
    SKINWRIGHT_PT_transfer_mask,
    SKINWRIGHT_PT_transfer_inpainting,
    SKINWRIGHT_PT_transfer_writing,
)


def register() -> None:
    """Register the panels, parents first."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Unregister them, children first."""
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
