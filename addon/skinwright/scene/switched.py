"""What is displayed otherwise while weights are sculpted, and comes back afterwards."""

from dataclasses import dataclass
from typing import Any

import bpy

from . import armature


@dataclass(frozen=True)
class Switch:
    """A property of a modifier, or of the object itself if `modifier` is empty, and why it is switched."""

    modifier: str
    name: str
    before: Any
    during: Any
    reason: str

    def turn(self, obj: bpy.types.Object, *, during: bool) -> None:
        """Set it, if its owner is still there."""
        owner = obj.modifiers.get(self.modifier) if self.modifier else obj
        if owner:
            setattr(owner, self.name, self.during if during else self.before)


def needed(obj: bpy.types.Object) -> list[Switch]:
    """What has to be switched for sculpts on `obj` to become weights."""
    found = []
    for modifier in armature.modifiers(obj):
        if modifier.show_viewport and modifier.use_deform_preserve_volume:
            reason = f"Preserve Volume of {modifier.name} was off while sculpting: joints look rounder with it"
            found.append(Switch(modifier.name, "use_deform_preserve_volume", True, False, reason))
    for modifier in obj.modifiers:
        if modifier.type == "ARMATURE":
            break
        if modifier.type == "MIRROR" and modifier.show_viewport:
            reason = f"{modifier.name} was hidden while sculpting: weights of the half it mirrors are what counts"
            found.append(Switch(modifier.name, "show_viewport", True, False, reason))
    if obj.data.shape_keys and obj.active_shape_key_index != 0:
        found.append(Switch("", "active_shape_key_index", obj.active_shape_key_index, 0, ""))
    return found
