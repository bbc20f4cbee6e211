"""Saving the panel's settings as a preset, and the presets that come with the extension."""

import os

import bpy
from bl_operators.presets import AddPresetBase
from bpy.types import Context, Operator

from ..registration import registration
from ..settings import TransferSettings
from ..settings.properties import reset
from .base import SkinwrightOperator

PRESET_PATH = os.path.dirname(os.path.dirname(__file__))


class SKINWRIGHT_OT_transfer_preset_add(AddPresetBase, Operator):
    """Add or remove a preset of the panel's settings"""

    bl_idname = "skinwright.transfer_preset_add"
    bl_label = "Add Garment Preset"

    preset_menu = "SKINWRIGHT_PT_transfer_presets"
    preset_subdir = "skinwright/transfer_weights"
    preset_defines = ["settings = bpy.context.scene.skinwright.transfer"]
    preset_values = [f"settings.{name}" for name in TransferSettings.__annotations__]


class SKINWRIGHT_OT_reset_settings(SkinwrightOperator):
    """All but the source."""

    bl_idname = "skinwright.reset_settings"
    bl_label = "Reset Settings"
    bl_description = "Give the settings of the transfer their defaults; the source stays"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def refusal(cls, _context: Context) -> str:
        """Always possible."""
        return ""

    def work(self, context: Context) -> set[str]:
        """The panel's settings."""
        reset(context.scene.skinwright.transfer, TransferSettings.__annotations__)
        return {"FINISHED"}


_register, _unregister = registration(SKINWRIGHT_OT_transfer_preset_add, SKINWRIGHT_OT_reset_settings)


def register() -> None:
    """Register the operator and the folder of presets."""
    _register()
    bpy.utils.register_preset_path(PRESET_PATH)


def unregister() -> None:
    """Unregister both."""
    bpy.utils.unregister_preset_path(PRESET_PATH)
    _unregister()
