"""A stand-in for a mesh whose positions somebody else computes: a hidden copy that is never saved."""

import bpy
import numpy as np
from numpy.typing import NDArray

MARK = "skinwright_preview_of"
_HIDDEN = "skinwright_hidden_by_preview"


def show(obj: bpy.types.Object) -> bpy.types.Object:
    """Put a copy without armature and keys in the place of `obj`, which is hidden in this view layer."""
    copy = obj.copy()
    copy.data = obj.data.copy()
    copy.name = f"{obj.name} (Refined)"
    if copy.data.shape_keys:
        copy.shape_key_clear()
    last = max((i for i, m in enumerate(copy.modifiers) if m.type == "ARMATURE"), default=-1)
    for modifier in list(copy.modifiers)[: last + 1]:
        copy.modifiers.remove(modifier)
    if copy.parent_type == "ARMATURE":
        copy.parent_type = "OBJECT"  # as an armature parent it would be deformed once more
    copy.animation_data_clear()
    copy.hide_select = True
    copy[MARK] = obj.name
    for collection in obj.users_collection:
        collection.objects.link(copy)
    obj[_HIDDEN] = True
    obj.hide_set(True)
    return copy


def place(name: str, positions: NDArray[np.float32]) -> bool:
    """Move the vertices of the copy of `name`; whether it is there and fits."""
    copy = of(name)
    if copy is None or len(copy.data.vertices) != len(positions):
        return False
    copy.data.vertices.foreach_set("co", np.ascontiguousarray(positions, np.float32).ravel())
    copy.data.update()
    return True


def of(name: str) -> bpy.types.Object | None:
    """The copy of the object of this name."""
    return next((obj for obj in bpy.data.objects if obj.get(MARK) == name), None)


def clear() -> int:
    """Remove every copy and show the originals again; how many there were."""
    copies = [obj for obj in bpy.data.objects if MARK in obj]
    for copy in copies:
        data = copy.data
        bpy.data.objects.remove(copy)
        if data.users == 0:
            bpy.data.meshes.remove(data)
    for obj in [obj for obj in bpy.data.objects if _HIDDEN in obj]:
        del obj[_HIDDEN]
        if obj.name in bpy.context.view_layer.objects:
            obj.hide_set(False)
    return len(copies)
