"""Vertex groups as CSR arrays, read and written exactly."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr, soundness
from ..csr import Rows
from . import deform_array
from .error import SceneError

# Blender stores a name in 64 bytes, the last of them zero.
_NAME_BYTES = 63
# Numbers in a table of rows and groups; beyond, they are sorted.
_LARGEST_TABLE = 1 << 24


@dataclass(frozen=True)
class Memberships:
    """Of some vertices, in stored order: those of row r begin at indptr[r]; group index and weight of each.

    `array` is Blender's own memory, where that can be reached: valid until Blender next touches the mesh.
    """

    indptr: NDArray[np.int64]
    group: NDArray[np.uint32]
    values: NDArray[np.float32]
    array: deform_array.DeformArray | None = None

    @cached_property
    def row(self) -> NDArray[np.int64]:
        """(nnz,) the row of each."""
        return np.repeat(np.arange(len(self.indptr) - 1, dtype=np.int64), np.diff(self.indptr))


def activate(obj: bpy.types.Object, name: str) -> None:
    """Make the group of this name the active one, if there is one."""
    if name in obj.vertex_groups:
        obj.vertex_groups.active = obj.vertex_groups[name]


def remove(obj: bpy.types.Object, names: Sequence[str]) -> None:
    """Remove the groups of these names; the active one stays active."""
    active = obj.vertex_groups.active.name if obj.vertex_groups.active else ""
    for group in [obj.vertex_groups[name] for name in names if name in obj.vertex_groups]:
        obj.vertex_groups.remove(group)
    activate(obj, active)


def locked(obj: bpy.types.Object) -> set[str]:
    """Names of the groups the artist has locked."""
    return {group.name for group in obj.vertex_groups if group.lock_weight}


def read(obj: bpy.types.Object, names: Sequence[str]) -> Rows:
    """Every vertex' memberships in the groups `names`, a membership of weight 0 included; not in Edit mode.

    `bones` index into `names` and ascend in each row; a name the object lacks has no entries.
    Raises SceneError for a weight that is not a number.
    """
    return _read(obj, obj.data, {group.name: group.index for group in obj.vertex_groups}, names)


def read_evaluated(obj: bpy.types.Object, mesh: bpy.types.Mesh, names: Sequence[str]) -> Rows:
    """The same of a mesh that the modifiers of an evaluated object leave."""
    return _read(obj, mesh, {group.name: group.index for group in obj.vertex_groups}, names)


def _read(obj: bpy.types.Object, mesh: bpy.types.Mesh, index: dict[str, int], names: Sequence[str]) -> Rows:
    n = len(mesh.vertices)
    indices = [index.get(_stored(name), -1) for name in names]
    if all(i < 0 for i in indices):
        return csr.empty(n)
    everything = np.arange(n, dtype=np.int64)
    if len(names) == 1 and (array := deform_array.open_array(mesh, everything)):
        return _read_one(obj, names, array, indices[0])
    held = _memberships(mesh, everything)
    column = _lookup(indices, held.group)
    keep = column >= 0
    vertex, column, values = held.row[keep], column[keep], held.values[keep]
    _check_finite(obj, names, vertex, column, values)
    order = np.argsort(vertex * len(names) + column, kind="stable")
    indptr = np.concatenate([[0], np.cumsum(np.bincount(vertex, minlength=n), dtype=np.int64)])
    return Rows(indptr.astype(np.uint32), column[order].astype(np.uint32), values[order])


def _read_one(obj: bpy.types.Object, names: Sequence[str], array: deform_array.DeformArray, index: int) -> Rows:
    """The same for one group, which a stroke of a brush waits for: other groups' weights are not touched."""
    entry = np.flatnonzero(array.groups() == index)
    vertex = np.searchsorted(array.indptr, entry, side="right") - 1
    values = array.memory["weight"][array.entries[entry]]
    column = np.zeros(len(entry), np.int64)
    _check_finite(obj, names, vertex, column, values)
    indptr = np.searchsorted(entry, array.indptr)
    return Rows(indptr.astype(np.uint32), column.astype(np.uint32), values)


def values(obj: bpy.types.Object, name: str) -> NDArray[np.float32]:
    """(V,) the weights of one group, 0 where a vertex is no member."""
    rows = read(obj, [name])
    weights = np.zeros(len(rows.indptr) - 1, np.float32)
    weights[np.diff(rows.indptr).astype(bool)] = rows.values
    return weights


def write(obj: bpy.types.Object, names: Sequence[str], rows: Rows, vertices: NDArray[np.integer] | None = None) -> None:
    """Make row r the memberships of vertex vertices[r] in the groups `names`; not in Edit mode.

    `vertices` are distinct; None stands for all. Groups the object lacks are created; memberships in `names` that a
    row does not hold are removed; other groups, other vertices and the locks stay. Values are stored bit for bit.
    """
    soundness.check(obj.name, rows)
    owned = np.array([group.index for group in ensure(obj, names)], np.uint32)
    mesh = obj.data
    indices = np.arange(len(mesh.vertices), dtype=np.int64) if vertices is None else np.asarray(vertices)
    held = _memberships(mesh, indices)
    wanted = Memberships(rows.indptr.astype(np.int64), owned[rows.bones], rows.values)
    if not _are_members(held, wanted) and _change_members(obj, indices, held, owned, wanted):
        held = _memberships(mesh, indices)
    _set_weights(mesh, indices, held, wanted)
    mesh.update()


def _are_members(held: Memberships, wanted: Memberships) -> bool:
    """Whether memberships are those that are there already, without others: as after a first transfer."""
    return np.array_equal(held.indptr, wanted.indptr) and np.array_equal(held.group, wanted.group)


def _change_members(
    obj: bpy.types.Object,
    indices: NDArray[np.integer],
    held: Memberships,
    owned: NDArray[np.uint32],
    wanted: Memberships,
) -> bool:
    """Give the vertices the memberships `wanted` in place of those in the groups `owned`; whether any differed."""
    is_owned = np.zeros(max(int(held.group.max(initial=0)), int(owned.max(initial=0))) + 1, bool)
    is_owned[owned] = True
    mine, row, group = is_owned[held.group], wanted.row, wanted.group
    held_row, held_group = held.row[mine], held.group[mine]
    missing = _positions((held_row, held_group), (row, group), len(indices)) < 0
    stale = _positions((row, group), (held_row, held_group), len(indices)) < 0
    if not missing.any() and not stale.any():
        return False
    # One call per group. New members begin at 0, so that no row holds too much, whatever stops the work in between.
    for index, members in _by_group(indices[held_row[stale]], held_group[stale]):
        obj.vertex_groups[index].remove(members)
    for index, members in _by_group(indices[row[missing]], group[missing]):
        obj.vertex_groups[index].add(members, 0.0, "REPLACE")
    return True


def ensure(obj: bpy.types.Object, names: Sequence[str]) -> list[bpy.types.VertexGroup]:
    """The groups of these names, created where missing. Raises SceneError where a cut name meets another."""
    stored = [_stored(name) for name in names]
    if len(set(stored)) != len(stored):
        raise SceneError(f"{obj.name} would get two groups of one name: shorten the names beyond {_NAME_BYTES} bytes")
    active = obj.vertex_groups.active
    groups = [obj.vertex_groups.get(name) or obj.vertex_groups.new(name=name) for name in stored]
    if active:
        # A new group becomes the active one: not under a brush that is painting another.
        activate(obj, active.name)
    return groups


def check_names(obj: bpy.types.Object, names: Sequence[str]) -> None:
    """Raise SceneError for a name that a group cannot have."""
    bad = [name for name in names if not name or "\0" in name or _stored(name) != name]
    if bad:
        raise SceneError(
            f"{obj.name} cannot have a group called {bad[0]!r}: rename it, to {_NAME_BYTES} bytes of text at most"
        )


def _stored(name: str) -> str:
    """The name as Blender stores it."""
    return name.encode(errors="ignore")[:_NAME_BYTES].decode(errors="ignore")


def _memberships(mesh: bpy.types.Mesh, indices: NDArray[np.integer]) -> Memberships:
    """Every membership of these vertices."""
    array = deform_array.open_array(mesh, indices)
    if array is None:
        return _from_api(mesh, indices)
    return Memberships(array.indptr, array.groups(), array.weights(), array)


def _from_api(mesh: bpy.types.Mesh, indices: NDArray[np.integer]) -> Memberships:
    """By Blender's public interface alone: 60 times slower."""
    counts: list[int] = []
    groups: list[int] = []
    values: list[float] = []
    for members in (mesh.vertices[i].groups for i in indices.tolist()):
        counts.append(len(members))
        for member in members:
            groups.append(member.group)
            values.append(member.weight)
    indptr = np.concatenate([[0], np.cumsum(np.array(counts, np.int64), dtype=np.int64)])
    return Memberships(indptr, np.array(groups, np.uint32), np.array(values, np.float32))


def _set_weights(
    mesh: bpy.types.Mesh,
    indices: NDArray[np.integer],
    held: Memberships,
    wanted: Memberships,
) -> None:
    """Give memberships that exist already their values."""
    if _are_members(held, wanted):
        now = wanted.values
    else:
        position = _positions((wanted.row, wanted.group), (held.row, held.group), len(indices))
        found = position >= 0
        now = held.values.copy()
        now[found] = wanted.values[position[found]]
    if held.array:
        held.array.set_weights(now)
        return
    for r in np.unique(wanted.row).tolist():
        mesh.vertices[indices[r]].groups.foreach_set("weight", now[held.indptr[r] : held.indptr[r + 1]])


def _by_group(vertex: NDArray[np.integer], group: NDArray[np.integer]) -> Iterator[tuple[int, list[int]]]:
    """Each group's index with its vertices."""
    # NumPy sorts 16 bits by digits, six times as fast.
    small = group.astype(np.uint16) if group.max(initial=0) < 1 << 16 else group
    order = np.argsort(small, kind="stable")
    ordered, vertices = small[order], vertex[order]
    for start, end in pairwise([0, *(np.flatnonzero(np.diff(ordered)) + 1).tolist(), len(ordered)]):
        if start < end:
            yield int(ordered[start]), vertices[start:end].tolist()


Pairs = tuple[NDArray[np.int64], NDArray[np.uint32]]


def _positions(pairs: Pairs, wanted: Pairs, n_rows: int) -> NDArray[np.integer]:
    """Where each (row, group) of `wanted` is among `pairs`, or -1; rows are below `n_rows`."""
    width = max(int(pairs[1].max(initial=0)), int(wanted[1].max(initial=0))) + 1
    if n_rows * width > _LARGEST_TABLE:
        keys = _keys(*pairs)
        order = np.argsort(keys, kind="stable")
        position, found = _find(keys[order], _keys(*wanted))
        return np.where(found, order[position] if order.size else -1, -1)
    # Ten times as fast as sorting.
    table = np.full(n_rows * width, -1, np.int32)
    table[pairs[0] * width + pairs[1]] = np.arange(len(pairs[0]), dtype=np.int32)
    return table[wanted[0] * width + wanted[1]]


def _keys(row: NDArray[np.int64], group: NDArray[np.uint32]) -> NDArray[np.int64]:
    """One number per membership: 64 bits, whatever NumPy counts in. Blender has at most 2^31 groups."""
    return row.astype(np.int64) << 31 | group


def _find(ordered: NDArray[np.integer], keys: NDArray[np.integer]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Position of each key in an ordered array, and whether it is there."""
    if not ordered.size:
        return np.zeros(len(keys), np.intp), np.zeros(len(keys), bool)
    position = np.minimum(np.searchsorted(ordered, keys), len(ordered) - 1)
    return position, ordered[position] == keys


def _lookup(groups: list[int], group: NDArray[np.uint32]) -> NDArray[np.int64]:
    """Position of each group index in `groups`, or -1. A mesh may hold indices beyond its object's list of groups."""
    beyond = max(groups, default=-1) + 1
    column = np.full(beyond + 2, -1, np.int64)
    column[groups] = np.arange(len(groups), dtype=np.int64)
    column[-1] = -1  # where a missing group's index, -1, has landed
    return column[np.minimum(group, beyond)]


def _check_finite(obj, names, vertex, column, values) -> None:
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise SceneError(
            f"{obj.name} has a weight that is not a number at vertex {vertex[bad[0]]} "
            f"in group {names[column[bad[0]]]}: assign it again"
        )
