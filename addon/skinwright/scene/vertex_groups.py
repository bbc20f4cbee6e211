"""Vertex groups as CSR arrays, read and written exactly."""

from collections.abc import Sequence

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows
from .error import SceneError

# Blender stores a name in 64 bytes, the last of them zero.
_NAME_BYTES = 63


def locked(obj: bpy.types.Object) -> set[str]:
    """Names of the groups the artist has locked."""
    return {group.name for group in obj.vertex_groups if group.lock_weight}


def read(obj: bpy.types.Object, names: Sequence[str]) -> Rows:
    """Every vertex' memberships in the groups `names`, a membership of weight 0 included; not in Edit mode.

    `bones` index into `names` and ascend in each row; a name the object lacks has no entries.
    Raises SceneError for a weight that is not a number.
    """
    indices = [obj.vertex_groups.find(_stored(name)) for name in names]
    if all(index < 0 for index in indices):
        return csr.empty(len(obj.data.vertices))
    counts, groups, values = _memberships(obj.data.vertices)
    column = _lookup(indices, groups)
    keep = column >= 0
    vertex = np.repeat(np.arange(len(counts)), counts)[keep]
    column, values = column[keep], values[keep]
    _check_finite(obj, names, vertex, column, values)
    order = np.lexsort((column, vertex))
    indptr = np.concatenate([[0], np.cumsum(np.bincount(vertex, minlength=len(counts)))])
    return Rows(indptr.astype(np.uint32), column[order].astype(np.uint32), values[order])


def write(obj: bpy.types.Object, names: Sequence[str], rows: Rows, vertices: NDArray[np.integer] | None = None) -> None:
    """Make row r the memberships of vertex vertices[r] in the groups `names`; not in Edit mode.

    `vertices` are distinct; None stands for all. Groups the object lacks are created; memberships in `names` that a
    row does not hold are removed; other groups, other vertices and the locks stay. Values are stored bit for bit.
    """
    groups = ensure(obj, names)
    mesh = obj.data
    indices = np.arange(len(mesh.vertices)) if vertices is None else np.asarray(vertices)
    vertex = np.repeat(indices, np.diff(rows.indptr))
    # One call a group makes the members, one call a vertex sets their weights: faster than one call a weight, and
    # the mesh is never rebuilt as it is by a bmesh round trip (shape keys, selection, odd faces).
    for column, group in enumerate(groups):
        members = vertex[rows.bones == column]
        if members.size:
            group.add(members.tolist(), 1.0, "REPLACE")
    stale_vertex, stale_group = _set_weights(mesh, indices, [group.index for group in groups], rows)
    for group in groups:
        members = stale_vertex[stale_group == group.index]
        if members.size:
            group.remove(members.tolist())
    mesh.update()


def ensure(obj: bpy.types.Object, names: Sequence[str]) -> list[bpy.types.VertexGroup]:
    """The groups of these names, created where missing. Raises SceneError where a cut name meets another."""
    stored = [_stored(name) for name in names]
    if len(set(stored)) != len(stored):
        raise SceneError(f"{obj.name} would get two groups of one name: shorten the names beyond {_NAME_BYTES} bytes")
    return [obj.vertex_groups.get(name) or obj.vertex_groups.new(name=name) for name in stored]


def _stored(name: str) -> str:
    """The name as Blender stores it."""
    return name.encode()[:_NAME_BYTES].decode(errors="ignore")


def _memberships(vertices) -> tuple[NDArray[np.intp], NDArray[np.int32], NDArray[np.float32]]:
    """Members a vertex, then group index and weight of every membership in stored order."""
    counts: list[int] = []
    groups: list[int] = []
    values: list[float] = []
    for vertex in vertices:
        members = vertex.groups
        counts.append(len(members))
        for member in members:
            groups.append(member.group)
            values.append(member.weight)
    return np.array(counts, np.intp), np.array(groups, np.int32), np.array(values, np.float32)


def _set_weights(
    mesh: bpy.types.Mesh, indices: NDArray[np.integer], groups: list[int], rows: Rows
) -> tuple[NDArray[np.integer], NDArray[np.int32]]:
    """Set the weights of members that already exist; gives the (vertex, group) of members the rows do not hold."""
    vertices = mesh.vertices
    counts, group, values = _memberships(vertices[i] for i in indices.tolist())
    row = np.repeat(np.arange(len(counts)), counts)
    column = _lookup(groups, group)
    width = len(groups) + 1
    wanted = np.repeat(np.arange(len(counts)), np.diff(rows.indptr)) * width + rows.bones
    order = np.argsort(wanted, kind="stable")
    position, held = _find(wanted[order], row * width + column)
    held &= column >= 0
    values[held] = rows.values[order[position[held]]]
    ends = np.cumsum(counts)
    touched = np.flatnonzero(np.bincount(row[held], minlength=len(counts)))
    spans = np.stack([indices[touched], (ends - counts)[touched], ends[touched]], axis=1)
    for index, start, end in spans.tolist():
        vertices[index].groups.foreach_set("weight", values[start:end])
    stale = (column >= 0) & ~held
    return indices[row[stale]], group[stale]


def _find(ordered: NDArray[np.integer], keys: NDArray[np.integer]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Position of each key in an ordered array, and whether it is there."""
    if not ordered.size:
        return np.zeros(len(keys), np.intp), np.zeros(len(keys), bool)
    position = np.minimum(np.searchsorted(ordered, keys), len(ordered) - 1)
    return position, ordered[position] == keys


def _lookup(groups: list[int], group: NDArray[np.int32]) -> NDArray[np.int64]:
    """Position of each group index in `groups`, or -1. A mesh may hold indices beyond its object's list of groups."""
    column = np.full(max([*groups, group.max(initial=0)]) + 2, -1, np.int64)
    column[groups] = np.arange(len(groups))
    column[-1] = -1  # where a missing group's index, -1, has landed
    return column[group]


def _check_finite(obj, names, vertex, column, values) -> None:
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise SceneError(
            f"{obj.name} has a weight that is not a number at vertex {vertex[bad[0]]} "
            f"in group {names[column[bad[0]]]}: assign it again"
        )
