"""The shape that shape keys give a mesh before any modifier."""

import bpy
import numpy as np
from numpy.typing import NDArray

from . import mesh as scene_mesh
from . import vertex_groups


def in_use(obj: bpy.types.Object) -> list[bpy.types.ShapeKey]:
    """The relative keys that change the shape now."""
    keys = obj.data.shape_keys
    if not keys or obj.show_only_shape_key:
        return []
    return [key for key in keys.key_blocks if key != keys.reference_key and not key.mute and key.value != 0]


def mixed(obj: bpy.types.Object, basis: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """(V, 3) the Basis with the keys in use, driven ones at the value that they have now.

    `basis` (V, 3) stands in for the Basis, as while a brush has moved it, and all keys along.
    """
    positions = scene_mesh.rest_positions(obj.data) if basis is None else basis
    keys = in_use(obj)
    if not keys:
        return positions
    mix = positions.astype(np.float64)
    for key in keys:
        offset = scene_mesh.vectors(key.data, "co") - scene_mesh.vectors(key.relative_key.data, "co")
        mix += key.value * offset.astype(np.float64) * _influence(obj, key)
    return mix.astype(np.float32)


def _influence(obj: bpy.types.Object, key: bpy.types.ShapeKey) -> NDArray[np.float32] | float:
    """(V, 1) how far the key's vertex group lets it act."""
    return vertex_groups.values(obj, key.vertex_group)[:, None] if key.vertex_group in obj.vertex_groups else 1.0
