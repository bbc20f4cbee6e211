"""A kept state brought to a mesh as it is now: by vertex order, or by position with inpainting of what is new."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr, native
from ..csr import Rows
from ..scene import editable, mesh, object_state, vertex_groups, weight_state
from ..scene.weight_state import WeightState
from ..transfer import scalar_fields
from .record import Record

# Vertices closer than this part of the diagonal are the same vertex.
SAME_PLACE = 1e-5
_INPAINT, _AUTOMATIC, _FORCE_MATCH = 0, 1, 2


@dataclass(frozen=True)
class Aligned:
    """A state for the present mesh; `found` (V,) marks the vertices that it knew, all if the mesh has not changed."""

    state: WeightState
    found: NDArray[np.bool_]
    exact: bool

    def sentence(self, name: str) -> str:
        """What was done to which vertices."""
        if self.exact:
            return f"{name}: weights of {len(self.found)} vertices restored exactly"
        new = int((~self.found).sum())
        kept = len(self.found) - new
        return f"{name} has changed: {kept} vertices found by position, {new} new ones inpainted"


def restore(
    obj: bpy.types.Object,
    kept: Record,
    threads: int = 0,
    before_write: Callable[[Sequence[bpy.types.Object]], None] | None = None,
) -> Aligned:
    """Make a state the weights of an object. Raises SceneError and native.NativeError; then nothing has changed."""
    editable.check(obj)
    vertex_groups.check_names(obj, kept.names)
    aligned = align(obj, kept, threads)
    if before_write:
        before_write([obj])
    with object_state.all_or_nothing([obj]):
        weight_state.apply(obj, aligned.state)
    return aligned


def align(obj: bpy.types.Object, kept: Record, threads: int = 0) -> Aligned:
    """The state as it would be on the mesh as it is now."""
    n, positions = len(obj.data.vertices), mesh.rest_positions(obj.data)
    same = n == len(kept.positions) and np.array_equal(_triangles(obj), kept.triangles)
    if same and not _loose_are_shuffled(positions, kept):
        state = WeightState(kept.names, kept.locked, kept.active, kept.indptr, kept.groups, kept.values)
        return Aligned(state, np.ones(n, bool), exact=True)
    partner = partners(positions, kept.positions)
    rows = Rows(kept.indptr, kept.groups, kept.values)
    found = partner >= 0
    if found.all():
        rows = csr.take_rows(rows, partner)
    else:
        rows = _merged(csr.take_rows(rows, partner[found]), _inpainted(obj, kept, found, threads), found)
    state = WeightState(kept.names, kept.locked, kept.active, rows.indptr, rows.bones, rows.values)
    return Aligned(state, found, exact=False)


def _loose_are_shuffled(positions: NDArray[np.float32], kept: Record) -> bool:
    """Whether the vertices of no face, whose order no face tells, are where they were but in another order."""
    loose = np.setdiff1d(np.arange(len(positions), dtype=np.int64), kept.triangles)
    if np.array_equal(positions[loose], kept.positions[loose]):
        return False
    partner = partners(positions[loose], kept.positions[loose])
    return bool((partner >= 0).all() and (partner != np.arange(len(loose), dtype=np.int64)).any())


def _triangles(obj: bpy.types.Object) -> NDArray[np.uint32]:
    return mesh.triangles(obj) if obj.data.polygons else np.zeros((0, 3), np.uint32)


def partners(positions: NDArray[np.float32], before: NDArray[np.float32]) -> NDArray[np.int64]:
    """(V,) the vertex of before that was at each position, -1 if there was none.

    Where several lay at one place (seams), the first stands for the first, the second for the second, and so on.
    """
    if not len(before):
        return np.full(len(positions), -1, np.int64)
    diagonal = float(np.linalg.norm(np.ptp(before, axis=0)))
    step = max(diagonal * SAME_PLACE, 1e-30)
    keys = [np.round(p.astype(np.float64) / step).astype(np.int64) for p in (before, positions)]
    _, place = np.unique(np.concatenate(keys), axis=0, return_inverse=True)
    place = place.reshape(-1)
    old, new = place[: len(before)], place[len(before) :]
    old_key, new_key = (_numbered(ids) for ids in (old, new))
    order = np.argsort(old_key, kind="stable")
    at = np.searchsorted(old_key[order], new_key)
    at = np.minimum(at, len(order) - 1)
    partner = order[at]
    return np.where(old_key[partner] == new_key, partner, -1)


def _numbered(place: NDArray[np.int64]) -> NDArray[np.int64]:
    """A number for each (place, how many of this place came before)."""
    order = np.argsort(place, kind="stable")
    first = np.searchsorted(place[order], place[order])
    rank = np.empty(len(place), np.int64)
    rank[order] = np.arange(len(place), dtype=np.int64) - first
    return place.astype(np.int64) << 24 | np.minimum(rank, (1 << 24) - 1)


def _inpainted(obj: bpy.types.Object, kept: Record, found: NDArray[np.bool_], threads: int) -> Rows:
    """Rows of all vertices from the shape and weights as they were; every group is carried over by itself."""
    n = len(kept.names)
    rows = Rows(kept.indptr, kept.groups, np.clip(np.nan_to_num(kept.values), 0, 1))
    packed = scalar_fields.pack(rows, max(n, 1))
    source = native.Source(f"The stored shape of {obj.name}", kept.positions, kept.triangles, packed, max(n, 1) + 1)
    positions, triangles = mesh.rest_positions(obj.data), mesh.triangles(obj)
    inpainting = native.Inpainting(source, obj.name, positions, triangles, threads)
    mask = np.where(found, _FORCE_MATCH, _INPAINT) if found.any() else np.full(len(found), _AUTOMATIC)
    _, solved = inpainting.start(mask=mask.astype(np.uint8), island_policy="nearest").result()
    return scalar_fields.unpack(solved, max(n, 1))


def _merged(known: Rows, solved: Rows, found: NDArray[np.bool_]) -> Rows:
    """The known rows at `found`, in their stored order; the solved ones elsewhere."""
    counts = np.diff(solved.indptr).astype(np.int64)
    counts[found] = np.diff(known.indptr)
    indptr = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    bones, values = np.zeros(indptr[-1], np.uint32), np.zeros(indptr[-1], np.float32)
    new = csr.take_rows(solved, np.flatnonzero(~found))
    at = np.repeat(found, counts)
    bones[at], bones[~at] = known.bones, new.bones
    values[at], values[~at] = known.values, new.values
    return Rows(indptr.astype(np.uint32), bones, values)
