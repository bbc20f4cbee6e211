"""The add-on's preferences, and whether its native module can be used."""

import bpy
from bpy.props import IntProperty
from bpy.types import AddonPreferences, Context

from . import native


class SKINWRIGHT_AP_preferences(AddonPreferences):
    """Preferences of the extension."""

    bl_idname = __package__

    threads: IntProperty(
        name="Threads",
        description="Processor threads a calculation may take; 0 takes all",
        default=0,
        min=0,
        soft_max=64,
        max=1024,
    )

    def draw(self, _context: Context) -> None:
        """Settings first, then the state of the native module."""
        self.layout.use_property_split = True
        self.layout.prop(self, "threads")
        problem = native.problem()
        row = self.layout.row()
        row.alert = bool(problem)
        row.label(text=problem or f"Native module {native.addon_version()}", icon="ERROR" if problem else "CHECKMARK")


def threads(context: bpy.types.Context) -> int:
    """The preference, or all where the add-on runs without being enabled."""
    addon = context.preferences.addons.get(__package__)
    return addon.preferences.threads if addon and addon.preferences else 0


def register() -> None:
    """Register the preferences."""
    bpy.utils.register_class(SKINWRIGHT_AP_preferences)


def unregister() -> None:
    """Unregister them."""
    bpy.utils.unregister_class(SKINWRIGHT_AP_preferences)
