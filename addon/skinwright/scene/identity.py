"""Objects that are found again after undo, which replaces them, and after renaming."""

from dataclasses import dataclass

import bpy


@dataclass
class Identity:
    """An object by Blender's number for it in this session; `name` is the one it was last found under."""

    uid: int
    name: str

    def find(self) -> bpy.types.Object | None:
        """The object, None if it is gone."""
        obj = bpy.data.objects.get(self.name)
        if obj is None or obj.session_uid != self.uid:
            obj = next((other for other in bpy.data.objects if other.session_uid == self.uid), None)
        if obj:
            self.name = obj.name
        return obj


def of(obj: bpy.types.Object) -> Identity:
    """How `obj` is found again."""
    return Identity(obj.session_uid, obj.name)
