"""Automatic weights: a first set of weights for meshes that have an armature and nothing painted."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr, jobs, native, soundness
from ..csr import Rows
from ..declared import native_keywords
from ..reporting import AutoskinReport, SkinnedMesh
from ..scene import armature, mesh, object_state, sculpting, vertex_groups
from ..scene.error import SceneError
from ..scene.watched import Watched
from .params import AutoskinParams

__all__ = ["AutoskinParams", "automatic_weights", "steps"]


@dataclass(frozen=True)
class _Answer:
    """The rows of `vertices` over `names`, and what the native module says about them."""

    names: list[str]
    vertices: NDArray[np.int64]
    rows: Rows
    report: dict[str, Any]


def automatic_weights(
    objects: Sequence[bpy.types.Object], rig: bpy.types.Object | None, params: AutoskinParams
) -> AutoskinReport:
    """Give meshes weights for the deforming bones of `rig`, or of the armature that deforms each.

    Groups that are locked, or not deforming bones of the armature, keep their weights. Nothing is written if an error
    is raised. Raises SceneError and native.NativeError.
    """
    return jobs.wait(steps(objects, rig, params))


def steps(
    objects: Sequence[bpy.types.Object],
    rig: bpy.types.Object | None,
    params: AutoskinParams,
    before_write: Callable[[Sequence[bpy.types.Object]], None] | None = None,
) -> jobs.Jobs[AutoskinReport]:
    """The same in steps: all are computed before the first is written, and all are written or none."""
    rigs = [_rig_of(obj, rig) for obj in objects]
    seen, answers = Watched([*objects, *rigs]), []
    for obj, its_rig in zip(objects, rigs, strict=True):
        answers.append((yield from seen.during(_compute(obj, its_rig, params))))
    if before_write:
        before_write(objects)
    with object_state.all_or_nothing(objects):
        written = zip(objects, rigs, answers, strict=True)
        return AutoskinReport([_write(obj, its_rig, answer) for obj, its_rig, answer in written])


def _rig_of(obj: bpy.types.Object, rig: bpy.types.Object | None) -> bpy.types.Object:
    sculpting.check_editable(obj)
    rig = rig or armature.find(obj)
    if rig is None:
        raise SceneError(
            f"{obj.name} has no armature to take bones from: select one too, or give it an Armature modifier"
        )
    if not armature.deform_bones(rig):
        raise SceneError(f"{rig.name} has no bone that deforms {obj.name}: turn Deform on for some")
    mesh.check_world(obj, rig)
    return rig


def _names(obj: bpy.types.Object, rig: bpy.types.Object, params: AutoskinParams) -> list[str]:
    """The bones that get weights, in the armature's order."""
    chosen = armature.deform_bones(rig) - vertex_groups.locked(obj)
    if not chosen:
        raise SceneError(
            f"all groups of {obj.name} for the bones of {rig.name} are locked: unlock those to be computed"
        )
    if params.selected_bones:
        chosen &= armature.selected_bones(rig)
        if not chosen:
            raise SceneError(f"no unlocked deforming bone of {rig.name} is selected: select the bones to compute")
    return [bone.name for bone in rig.data.bones if bone.name in chosen]


def _compute(obj: bpy.types.Object, rig: bpy.types.Object, params: AutoskinParams) -> jobs.Jobs[_Answer]:
    names = _names(obj, rig, params)
    kept = sorted(armature.deform_bones(rig) - set(names))
    job = native.start_automatic_weights(
        obj.name,
        mesh.rest_positions(obj.data),
        mesh.triangles(obj),
        armature.segments(obj, rig, names),
        armature.parents(rig, names),
        **native_keywords(params),
    )
    result, rows = yield job
    vertices = np.arange(len(obj.data.vertices), dtype=np.int64)
    if params.selected_only:
        vertices = np.flatnonzero(mesh.selected(obj)).astype(np.int64)
    rows = _beside_kept(rows, vertex_groups.read(obj, kept), params.max_influences)
    soundness.check_sums(obj.name, rows, np.ones(len(names), bool))
    return _Answer(names, vertices, csr.take_rows(rows, vertices), result.report)


def _beside_kept(rows: Rows, kept: Rows, max_influences: int) -> Rows:
    """The rows in what the weights that are kept leave of 1, and of the limit."""
    if max_influences:
        room = np.maximum(max_influences - np.diff(kept.indptr).astype(np.int64), 0)
        rows = csr.keep_largest(rows, room)
    share = np.clip(1 - csr.row_sums(kept), 0, 1) / np.maximum(csr.row_sums(rows), 1e-12)
    values = rows.values * share[csr.entry_vertices(rows)]
    return rows._replace(values=values.astype(np.float32))


def _write(obj: bpy.types.Object, rig: bpy.types.Object, answer: _Answer) -> SkinnedMesh:
    vertex_groups.write(obj, answer.names, answer.rows, answer.vertices)
    if armature.find(obj) is None:
        modifier = obj.modifiers.new(rig.name, "ARMATURE")
        modifier.object = rig
    outside = [answer.names[j] for j in answer.report["bones_outside"]]
    return SkinnedMesh(obj.name, rig.name, len(answer.vertices), len(answer.names), outside)
