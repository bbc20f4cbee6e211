"""The add-on's preferences, and whether its native module can be used."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bpy.types import AddonPreferences, Context

from . import declared, native
from .registration import registration
from .settings.properties import properties


@dataclass(frozen=True)
class Preferences(declared.Params):
    """What holds for this machine rather than for a file."""

    threads: int = declared.threads()


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
        problem = native.problem()
        row = self.layout.row()
        row.alert = bool(problem)
        row.label(text=problem or f"Native module {native.addon_version()}", icon="ERROR" if problem else "CHECKMARK")


def threads(context: Context) -> int:
    """The preference, or all where the add-on runs without being enabled."""
    addon = context.preferences.addons.get(__package__)
    return addon.preferences.threads if addon and addon.preferences else 0


register, unregister = registration(SKINWRIGHT_AP_preferences)
