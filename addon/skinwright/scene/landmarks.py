"""Landmarks that an artist sets: empties beside a character."""

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from . import editable

# Marks the empties that were made as landmarks.
_MADE = "skinwright_landmark"


def place_of_empty(name: str) -> NDArray[np.float64] | None:
    """(3,) where the empty of this name is in the world; None if no empty is called so."""
    obj = bpy.data.objects.get(name)
    if obj is None or obj.type != "EMPTY":
        return None
    return np.array(obj.matrix_world.translation, np.float64)


def add_empty(context: bpy.types.Context, name: str, place: Vector, size: float) -> bpy.types.Object:
    """A selected empty in front of everything."""
    empty = bpy.data.objects.new(name, None)
    empty.empty_display_type, empty.empty_display_size = "SPHERE", size
    empty.show_in_front, empty.show_name = True, True
    empty.location = place
    empty[_MADE] = True
    editable.collection(context).objects.link(empty)
    empty.select_set(True)
    return empty


def remove_empty(obj: bpy.types.Object | None) -> None:
    """Remove an empty that was made as a landmark; other objects stay."""
    if obj is not None and obj.type == "EMPTY" and obj.get(_MADE):
        bpy.data.objects.remove(obj)


def middle_and_size(obj: bpy.types.Object) -> tuple[Vector, float]:
    """The middle of an object's bounding box and its diagonal, in the world."""
    corners = [obj.matrix_world @ Vector(corner) for corner in obj.bound_box]
    low, high = (Vector(f(c[axis] for c in corners) for axis in range(3)) for f in (min, max))
    return (low + high) / 2, (high - low).length
