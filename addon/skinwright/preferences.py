"""The add-on's preferences, and whether its native module can be used."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bpy.types import AddonPreferences, Context

from . import declared, memory, native
from .registration import registration
from .settings.properties import properties


@dataclass(frozen=True)
class Preferences(declared.Params):
    """What holds for this machine rather than for a file."""

    threads: int = declared.threads()
    memory_share: float = declared.setting(
        memory.share,
        "Memory",
        "The part of the free memory that one calculation may take; larger ones are refused with their estimate",
        least=0.05,
        most=1,
        unit="FACTOR",
    )


class SKINWRIGHT_AP_preferences(AddonPreferences):
    """Preferences of the extension."""

    bl_idname = __package__

    __annotations__ = properties(Preferences)
    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """The properties, which mypy cannot see."""

    def draw(self, _context: Context) -> None:
        """Settings first, then the state of the native module."""
        self.layout.use_property_split = True
        self.layout.prop(self, "threads")
        self.layout.prop(self, "memory_share", slider=True)
        problem = native.problem()
        row = self.layout.row()
        row.alert = bool(problem)
        row.label(text=problem or f"Native module {native.addon_version()}", icon="ERROR" if problem else "CHECKMARK")


def threads(context: Context) -> int:
    """The preference, or all where the add-on runs without being enabled. The memory's is put in force as well."""
    addon = context.preferences.addons.get(__package__)
    if not addon or not addon.preferences:
        return 0
    memory.share = addon.preferences.memory_share
    return addon.preferences.threads


register, unregister = registration(SKINWRIGHT_AP_preferences)
