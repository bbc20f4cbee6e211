"""Named attributes on vertices, for Geometry Nodes."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

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
    obj.data.color_attributes.active_color = obj.data.color_attributes[name]
    obj.data.update()


def show_colors(area: bpy.types.Area | None) -> None:
    """Let a 3D view show the active color attribute; other editors stay."""
    if area and area.type == "VIEW_3D" and area.spaces.active.shading.type == "SOLID":
        area.spaces.active.shading.color_type = "VERTEX"


@contextmanager
def all_or_nothing(objects: Sequence[bpy.types.Object], name: str) -> Iterator[None]:
    """Whatever exception leaves the block, colors of this name are as they were before."""
    before = {obj: _colors(obj, name) for obj in objects}
    try:
        yield
    except BaseException:
        for obj, colors in before.items():
            if colors is not None:
                write_colors(obj, name, colors)
            elif name in obj.data.attributes:
                obj.data.attributes.remove(obj.data.attributes[name])
        raise


def _colors(obj: bpy.types.Object, name: str) -> NDArray[np.float32] | None:
    attribute = obj.data.attributes.get(name)
    if attribute is None or (attribute.data_type, attribute.domain) != ("FLOAT_COLOR", "POINT"):
        return None
    colors = np.empty(4 * len(attribute.data), np.float32)
    attribute.data.foreach_get("color", colors)
    return colors.reshape(-1, 4)
