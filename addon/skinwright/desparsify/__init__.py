"""Desparsification: every vertex gets bones to choose from, as members of weight 0."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr, native, soundness
from ..csr import Rows
from ..declared import native_keywords
from ..reporting import DesparsifyReport
from ..scene import armature, editable, mesh, object_state, vertex_groups
from ..scene.error import SceneError
from .params import DesparsifyParams

__all__ = ["DesparsifyParams", "desparsify", "desparsify_all"]


@dataclass(frozen=True)
class _Answer:
    """The rows of `vertices` over `names`, before and after."""

    names: list[str]
    vertices: NDArray[np.intp]
    before: Rows
    after: Rows


def desparsify(obj: bpy.types.Object, params: DesparsifyParams) -> DesparsifyReport:
    """Give vertices of a mesh exactly n deforming bones: the largest they have, and near ones at weight 0.

    Locked groups and groups that are not deforming bones stay as they are. Nothing is written if an error is raised.
    Raises SceneError and native.NativeError.
    """
    return desparsify_all([obj], params)[0]


def desparsify_all(
    objects: Sequence[bpy.types.Object],
    params: DesparsifyParams,
    before_write: Callable[[Sequence[bpy.types.Object]], None] | None = None,
) -> list[DesparsifyReport]:
    """The same for several meshes: all are computed before the first is written, and all are written or none.

    `before_write` is told when writing begins.
    """
    objects = list(dict.fromkeys(objects))  # one named twice is one
    editable.check_separate(objects)
    answers = [_compute(obj, params) for obj in objects]
    if before_write:
        before_write(objects)
    with object_state.all_or_nothing(objects):
        return [_write(obj, answer, params.n) for obj, answer in zip(objects, answers, strict=True)]


def _compute(obj: bpy.types.Object, params: DesparsifyParams) -> _Answer:
    rig = _check(obj)
    names = [bone.name for bone in rig.data.bones]
    deforming = np.isin(names, sorted(armature.deform_bones(rig)))
    before = csr.keep_columns(vertex_groups.read(obj, names), deforming)
    locked = ~deforming | np.isin(names, sorted(vertex_groups.locked(obj)))
    after = _solve(obj, rig, names, locked, before, params)
    vertices = (
        np.flatnonzero(mesh.selected(obj))
        if params.selected_only
        else np.arange(len(obj.data.vertices), dtype=np.int64)
    )
    free = deforming & ~np.isin(names, sorted(vertex_groups.locked(obj)))
    soundness.check_sums(obj.name, after, free)
    return _Answer(names, vertices, csr.take_rows(before, vertices), csr.take_rows(after, vertices))


def nearest_bones(
    obj: bpy.types.Object, rig: bpy.types.Object, names: list[str], rows: Rows, params: DesparsifyParams
) -> Rows:
    """Rows over the bones `names` with the n members that desparsification would leave; nothing is written."""
    all_names = [bone.name for bone in rig.data.bones]
    index = np.array([all_names.index(name) for name in names], np.uint32)
    locked = ~np.isin(all_names, names) | np.isin(all_names, sorted(vertex_groups.locked(obj)))
    after = _solve(obj, rig, all_names, locked, rows._replace(bones=index[rows.bones]), params)
    return csr.take_columns(after, np.isin(all_names, names))


def _check(obj: bpy.types.Object) -> bpy.types.Object:
    editable.check(obj)
    rig = armature.find(obj)
    if rig is None:
        raise SceneError(f"{obj.name} has no armature to take bones from: give it an Armature modifier")
    if not armature.deform_bones(rig):
        raise SceneError(f"{rig.name}, which deforms {obj.name}, has no bone that deforms: turn Deform on for some")
    return rig


def _solve(
    obj: bpy.types.Object,
    rig: bpy.types.Object,
    names: list[str],
    locked: NDArray[np.bool_],
    before: Rows,
    params: DesparsifyParams,
) -> Rows:
    """Bones that do not deform take part as steps of the hierarchy, but are given to no vertex."""
    shape: dict[str, NDArray] = {}
    if params.method == "surface":
        shape["positions"], shape["triangles"] = mesh.rest_positions(obj.data), mesh.triangles(obj)
        shape["bone_segments"] = armature.segments(obj, rig, names)
    parents = armature.parents(rig, names)
    keywords = native_keywords(params) | {"locked": locked} | shape
    return native.desparsify(obj.name, before, len(names), parents, **keywords)


def _write(obj: bpy.types.Object, answer: _Answer, n: int) -> DesparsifyReport:
    names, vertices, before, after = answer.names, answer.vertices, answer.before, answer.after
    present = {group.name for group in obj.vertex_groups}
    used = np.isin(np.arange(len(names), dtype=np.int64), np.concatenate([before.bones, after.bones]))
    needed = [name for name, is_used in zip(names, used, strict=True) if is_used]
    vertex_groups.write(obj, needed, csr.take_columns(after, used), vertices)
    old, new = (csr.entry_vertices(rows) * len(names) + rows.bones for rows in (before, after))
    return DesparsifyReport(
        target=obj.name,
        vertices=len(vertices),
        n=n,
        added=int((~np.isin(new, old)).sum()),
        dropped=int((~np.isin(old, new) & (before.values > 0)).sum()),
        groups=[name for name in needed if name not in present],
    )
