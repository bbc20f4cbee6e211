"""Binding a mesh in the pose it was fitted to: the rest shape from which the pose leads to what is shown."""

from collections.abc import Sequence

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows
from . import armature, mesh, shapes
from .error import SceneError

# Below this part of the volume a vertex's blended matrix cannot be undone.
_FLATTEST = 1e-3
# Bendy bones, Preserve Volume and other modifiers are not part of the blend: a few rounds take in what they do.
_ROUNDS = 8
_CLOSE = 1e-6


def check(obj: bpy.types.Object, make_single_user: bool) -> None:
    """Raise SceneError where no rest shape can be written."""
    if any(m.type == "MIRROR" and m.show_viewport for m in obj.modifiers):
        raise SceneError(
            f"{obj.name} has a Mirror modifier and was fitted on a posed body, which is not symmetric: "
            "apply the modifier, or set Geometry to As Shown, at Rest"
        )
    others = mesh.other_users(obj)
    if others and not make_single_user:
        raise SceneError(
            f"{obj.name} was fitted on a posed body, so it needs another rest shape, but it shares its mesh with "
            f"{', '.join(others)}: turn on Make Single User"
        )


def blended(obj: bpy.types.Object, rigs: Sequence[bpy.types.Object], names: Sequence[str], rows: Rows) -> NDArray:
    """(V, 4, 4) where the pose takes each vertex, in the mesh's own space; the unit matrix where a row is empty."""
    pose = np.tile(np.eye(4), (len(names), 1, 1))
    for rig in reversed(rigs):
        known = [column for column, name in enumerate(names) if name in rig.data.bones]
        pose[known] = armature.pose_from_rest(obj, rig, [names[column] for column in known])
    n = len(rows.indptr) - 1
    vertex, sums = csr.entry_vertices(rows), csr.row_sums(rows)
    share = rows.values / np.maximum(sums, 1e-30)[vertex]
    matrix = np.zeros((n, 4, 4))
    for i in range(4):
        for j in range(4):
            matrix[:, i, j] = np.bincount(vertex, weights=share * pose[rows.bones, i, j], minlength=n)
    matrix[sums <= 0] = np.eye(4)
    return matrix


def undone(obj: bpy.types.Object, matrices: NDArray) -> NDArray:
    """The inverse matrices (V, 4, 4). Raises SceneError where the pose flattens a vertex's surroundings."""
    flat = np.flatnonzero(np.abs(np.linalg.det(matrices[:, :3, :3])) < _FLATTEST)
    if flat.size:
        raise SceneError(
            f"{obj.name} cannot be bound in this pose: it folds {flat.size} vertices flat, the first is vertex "
            f"{flat[0]}; pose the body with less extreme angles"
        )
    return np.linalg.inv(matrices)


def bind(obj: bpy.types.Object, back: NDArray, shown: NDArray[np.float32]) -> float:
    """Give the mesh the rest shape whose pose is `shown` (V, 3), in the world; returns the largest distance left.

    `back` (V, 4, 4) undoes the pose. All shape keys go along. The modifiers that deform the mesh are there already.
    """
    _move(obj, back)
    size = float(np.linalg.norm(np.ptp(shown, axis=0)))
    to_local = np.linalg.inv(np.array(obj.matrix_world))[:3, :3]
    for _ in range(_ROUNDS):
        off = shown - shapes.read_target(obj, "CURRENT").geometry.positions
        if np.abs(off).max(initial=0) <= _CLOSE * size:
            break
        step = np.einsum("vij,jk,vk->vi", back[:, :3, :3], to_local, off)
        shift = np.tile(np.eye(4), (len(step), 1, 1))
        shift[:, :3, 3] = step
        _move(obj, shift)
    off = shown - shapes.read_target(obj, "CURRENT").geometry.positions
    return float(np.linalg.norm(off, axis=1).max(initial=0))


def _move(obj: bpy.types.Object, matrices: NDArray) -> None:
    """Move each vertex by its matrix (V, 4, 4), in every shape key."""
    data = obj.data
    _set(data.attributes["position"].data, "vector", _moved(mesh.positions(data), matrices))
    for key in data.shape_keys.key_blocks if data.shape_keys else ():
        _set(key.data, "co", _moved(mesh.vectors(key.data, "co"), matrices))
    data.update()


def _moved(positions: NDArray[np.float32], matrices: NDArray) -> NDArray[np.float32]:
    moved = np.einsum("vij,vj->vi", matrices[:, :3, :3], positions.astype(np.float64)) + matrices[:, :3, 3]
    return np.ascontiguousarray(moved, np.float32)


def _set(collection: bpy.types.bpy_prop_collection, name: str, values: NDArray[np.float32]) -> None:
    collection.foreach_set(name, values.ravel())
