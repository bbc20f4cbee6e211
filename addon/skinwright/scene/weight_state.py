"""All weights of an object as they stand, to the bit and in stored order, and what brings them back."""

import hashlib
from dataclasses import dataclass
from itertools import pairwise

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows
from .vertex_groups import Memberships, _by_group, _memberships, activate


@dataclass(frozen=True)
class WeightState:
    """The groups in their order, and the members of vertex i: entries indptr[i] to indptr[i + 1], in stored order.

    `groups` (nnz,) index `names`; values need not be sound: what is there is kept.
    """

    names: list[str]
    locked: list[bool]
    active: str
    indptr: NDArray[np.uint32]
    groups: NDArray[np.uint32]
    values: NDArray[np.float32]

    def digest(self) -> str:
        """Equal for equal states only."""
        found = hashlib.sha256(repr((self.names, self.locked, self.active)).encode())
        for array in (self.indptr, self.groups, self.values):
            found.update(np.ascontiguousarray(array).tobytes())
        return found.hexdigest()


def capture(obj: bpy.types.Object) -> WeightState:
    """The state of an object; not in Edit mode."""
    n = len(obj.data.vertices)
    held = _memberships(obj.data, np.arange(n, dtype=np.int64))
    rows = Rows(held.indptr.astype(np.uint32), held.group, held.values)
    # A mesh may hold indices beyond its object's list.
    known = csr.keep_entries(rows, held.group < len(obj.vertex_groups))
    return WeightState(
        names=[group.name for group in obj.vertex_groups],
        locked=[group.lock_weight for group in obj.vertex_groups],
        active=obj.vertex_groups.active.name if obj.vertex_groups.active else "",
        indptr=known.indptr,
        groups=known.bones,
        values=known.values,
    )


def apply(obj: bpy.types.Object, state: WeightState) -> None:
    """Bring a state back to a mesh of as many vertices: groups, their order, locks, members, their order, every bit."""
    if [group.name for group in obj.vertex_groups] != state.names:
        obj.vertex_groups.clear()
        for name in state.names:
            obj.vertex_groups.new(name=name)
    for group, lock in zip(obj.vertex_groups, state.locked, strict=True):
        group.lock_weight = lock
    _apply_members(obj, state)
    activate(obj, state.active)
    obj.data.update()


def _apply_members(obj: bpy.types.Object, state: WeightState) -> None:
    mesh, every = obj.data, np.arange(len(obj.data.vertices), dtype=np.int64)
    held = _memberships(mesh, every)
    known = held.group < len(obj.vertex_groups)
    wrong = _vertices_with_other_members(held.row[known], held.group[known], state)
    if wrong.any():
        gone = known & wrong[held.row]
        for index, members in _by_group(held.row[gone], held.group[gone]):
            obj.vertex_groups[index].remove(members)
        _add_in_order(obj, state, wrong)
        held = _memberships(mesh, every)
        known = held.group < len(obj.vertex_groups)
    now = held.values.copy()
    now[known] = state.values
    _set_all(mesh, held, now)


def _set_all(mesh: bpy.types.Mesh, held: Memberships, values: NDArray[np.float32]) -> None:
    if held.array is not None:
        held.array.set_weights(values)
        return
    for vertex, (start, end) in zip(mesh.vertices, pairwise(held.indptr.tolist()), strict=True):
        vertex.groups.foreach_set("weight", values[start:end])


def _vertices_with_other_members(
    row: NDArray[np.int64], group: NDArray[np.uint32], state: WeightState
) -> NDArray[np.bool_]:
    """(V,) those whose members or their order differ."""
    wanted = np.diff(state.indptr).astype(np.int64)
    now = np.bincount(row, minlength=len(wanted))
    wrong = wanted != now
    same = ~wrong
    mine = group[same[row]]
    theirs = state.groups[np.repeat(same, wanted)]
    at = np.repeat(np.flatnonzero(same), wanted[same])
    wrong[at[mine != theirs]] = True
    return wrong


def _add_in_order(obj: bpy.types.Object, state: WeightState, chosen: NDArray[np.bool_]) -> None:
    """First members first, as Blender appends each. They come with weight 0, so that no row ever holds too much."""
    counts = np.diff(state.indptr).astype(np.int64)
    row = np.repeat(np.arange(len(counts), dtype=np.int64), counts)
    rank = np.arange(len(row), dtype=np.int64) - np.repeat(state.indptr[:-1].astype(np.int64), counts)
    entries = np.flatnonzero(chosen[row])
    for position in range(int(rank[entries].max(initial=-1)) + 1):
        now = entries[rank[entries] == position]
        for index, members in _by_group(row[now], state.groups[now].astype(np.int64)):
            obj.vertex_groups[index].add(members, 0.0, "REPLACE")
