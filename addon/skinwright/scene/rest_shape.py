"""The shape at rest while a brush is at work: what it has moved, and putting it back bit for bit."""

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from . import mesh as scene_mesh
from .error import SceneError

# Of the largest coordinate.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class RestShape:
    """The mesh' own positions (V, 3), and those of each shape key: a brush on the Basis moves the others along.

    What moves less than `rounding` has not been sculpted: a brush that is cancelled brings positions back through the
    pose, not to the bit.
    """

    positions: NDArray[np.float32]
    keys: dict[str, NDArray[np.float32]]
    rounding: float


def read(obj: bpy.types.Object) -> RestShape:
    """The shape as it is now; not in Edit mode."""
    keys = obj.data.shape_keys.key_blocks if obj.data.shape_keys else ()
    positions = scene_mesh.positions(obj.data)
    rounding = _ROUNDING * float(np.abs(positions).max(initial=0))
    return RestShape(positions, {key.name: scene_mesh.vectors(key.data, "co") for key in keys}, rounding)


def moved(obj: bpy.types.Object, shape: RestShape) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """The vertices (n,) that are elsewhere now, and where (n, 3). Raises SceneError where vertices came or went.

    Bits are compared, which is what `restore` brings back; and one flat comparison takes a tenth of the time of one
    by vertices.
    """
    now = scene_mesh.positions(obj.data)
    if len(now) != len(shape.positions):
        raise SceneError(f"{obj.name} has another number of vertices than before: undo what changed it")
    vertices = np.flatnonzero(_bits(now) != _bits(shape.positions)) // 3
    vertices = vertices[np.diff(vertices, prepend=-1) > 0]  # each once
    return vertices.astype(np.uint32), now[vertices]


def restore(obj: bpy.types.Object, shape: RestShape) -> None:
    """Put every vertex back. The caller tells Blender that the mesh has changed."""
    if len(obj.data.vertices) != len(shape.positions):
        return
    obj.data.attributes["position"].data.foreach_set("vector", shape.positions.ravel())
    keys = obj.data.shape_keys.key_blocks if obj.data.shape_keys else {}
    for name, positions in shape.keys.items():
        if name in keys:
            keys[name].data.foreach_set("co", positions.ravel())


def _bits(positions: NDArray[np.float32]) -> NDArray[np.uint32]:
    return positions.ravel().view(np.uint32)
