"""The bones that each vertex has to choose from while it is sculpted: those it follows, and near ones at weight 0."""

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows
from ..desparsify import DesparsifyParams, nearest_bones
from ..scene import armature, vertex_groups
from ..scene.error import SceneError
from .params import SculptParams

# Of the solver: skinwright_core::sculpt::MAX_MEMBERS.
MOST_MEMBERS = 12


@dataclass(frozen=True)
class Candidates:
    """`before` are the mesh's own rows over `names`, `rows` the same with candidates.

    `cut` (V,) marks vertices that follow more bones than the solver takes; their rows hold the largest weights.
    """

    names: list[str]
    before: Rows
    rows: Rows
    cut: NDArray[np.bool_]


def choose(obj: bpy.types.Object, rig: bpy.types.Object, options: SculptParams) -> Candidates:
    """Candidates among the deform bones that have members on this mesh.

    A bone that deforms nothing here is not offered: controls that were left to deform would win weights otherwise.
    Raises SceneError where no bone has a member.
    """
    deforming = armature.deform_bones(rig)
    names = [bone.name for bone in rig.data.bones if bone.name in deforming and bone.name in obj.vertex_groups]
    before = vertex_groups.read(obj, names)
    present = np.isin(np.arange(len(names), dtype=np.int64), before.bones)
    names = [name for name, is_present in zip(names, present, strict=True) if is_present]
    if not names:
        raise SceneError(f"No vertex of {obj.name} is in a group of a deform bone of {rig.name}: bind it first")
    before = csr.take_columns(before, present)
    counts = np.diff(before.indptr).astype(np.int64)
    cut = counts > MOST_MEMBERS
    rows = _normalised_where(csr.keep_largest(before, np.full(len(counts), MOST_MEMBERS)), before, cut)
    if options.candidates:
        params = DesparsifyParams(options.candidates, options.method, threads=options.threads)
        rows = _joined(rows, nearest_bones(obj, rig, names, rows, params), len(names))
    return Candidates(names, before, rows, cut)


def _joined(rows: Rows, wanted: Rows, n_bones: int) -> Rows:
    """`rows` and those members of `wanted` that they lack, at weight 0, as far as a row takes more."""
    vertex, width = csr.entry_vertices(wanted), np.int64(n_bones)
    own = csr.entry_vertices(rows) * width + rows.bones
    missing = ~np.isin(vertex * width + wanted.bones, own)
    room = MOST_MEMBERS - np.diff(rows.indptr).astype(np.int64)
    rank = np.cumsum(missing, dtype=np.int64) - missing
    first = np.concatenate([[0], np.cumsum(missing, dtype=np.int64)])[wanted.indptr[:-1]]
    missing &= rank - first[vertex] < room[vertex]
    places = np.concatenate([own, (vertex * width + wanted.bones)[missing]])
    values = np.concatenate([rows.values, np.zeros(int(missing.sum()), np.float32)])
    order = np.argsort(places, kind="stable")
    places, values = places[order], values[order]
    counts = np.bincount(places // width, minlength=len(room))
    indptr = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    return Rows(indptr.astype(np.uint32), (places % width).astype(np.uint32), values)


def _normalised_where(rows: Rows, before: Rows, cut: NDArray[np.bool_]) -> Rows:
    """The rows that have lost members, with the sum they had."""
    if not cut.any():
        return rows
    scale = np.where(cut, csr.row_sums(before) / np.maximum(csr.row_sums(rows), 1e-30), 1.0)
    return rows._replace(values=(rows.values * scale[csr.entry_vertices(rows)]).astype(np.float32))
