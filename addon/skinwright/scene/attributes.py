"""Named attributes on vertices, for Geometry Nodes."""

import bpy
import numpy as np
from numpy.typing import NDArray


def write(obj: bpy.types.Object, name: str, values: NDArray) -> None:
    """Store (V,) bool or f32 values on the vertices, in place of an attribute of this name."""
    attributes = obj.data.attributes
    if name in attributes:
        attributes.remove(attributes[name])
    kind = "BOOLEAN" if values.dtype == bool else "FLOAT"
    attribute = attributes.new(name, kind, "POINT")
    attribute.data.foreach_set("value", np.ascontiguousarray(values))
    obj.data.update()


def write_colors(obj: bpy.types.Object, name: str, colors: NDArray[np.float32]) -> None:
    """Store (V, 4) colors on the vertices, in place of an attribute of this name."""
    attributes = obj.data.attributes
    if name in attributes:
        attributes.remove(attributes[name])
    attribute = attributes.new(name, "FLOAT_COLOR", "POINT")
    attribute.data.foreach_set("color", np.ascontiguousarray(colors).ravel())
    obj.data.update()
