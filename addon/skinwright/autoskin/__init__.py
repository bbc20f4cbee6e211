"""Automatic weights: a first set of weights for meshes that have an armature and nothing painted."""

from collections.abc import Callable, Sequence

import bpy
import numpy as np

from .. import csr, jobs
from ..reporting import AutoskinReport, SkinnedMesh
from ..scene import armature, attaching, editable, followers, object_state, vertex_groups
from ..scene.watched import Watched
from .compute import Answer, compute
from .inputs import Target, read
from .params import AutoskinParams

__all__ = ["AutoskinParams", "automatic_weights", "steps"]


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
    objects = list(dict.fromkeys(objects))  # one named twice is one
    targets = read(objects, rig, params)
    seen = Watched([*objects, *(target.rig for target in targets)])
    answers = yield from seen.during(compute(targets, params))
    if before_write:
        before_write(objects)
    with object_state.all_or_nothing(objects):
        return AutoskinReport([_write(target, answer, params) for target, answer in zip(targets, answers, strict=True)])


def _write(target: Target, answer: Answer, params: AutoskinParams) -> SkinnedMesh:
    obj, rig, names = target.object, target.rig, target.bones.names
    written = [name for name, computed in zip(names, target.computed, strict=True) if computed]
    rows = csr.take_columns(csr.take_rows(answer.rows, target.vertices), target.computed)
    vertex_groups.write(obj, written, rows, target.vertices)
    was_free = armature.find(obj) is None
    if was_free:
        attaching.bind(obj, rig, make_parent=params.make_parent)
    columns = int(np.count_nonzero(target.chosen))
    return SkinnedMesh(
        obj.name, rig.name, len(target.vertices), columns, answer.outside, _notes(target, was_free=was_free)
    )


def _notes(target: Target, *, was_free: bool) -> list[str]:
    """What keeps the new weights from moving the mesh as they say, and whom they move too; `was_free` if nothing
    deformed it before."""
    obj, rig = target.object, target.rig
    found = [editable.changes_others(obj), target.mirror_warning]
    if was_free and armature.is_posed(rig):
        found.append(
            f"{rig.name} is posed, and its bones at rest were used: if {obj.name} was made for the pose, apply that as "
            "rest pose and try again"
        )
    found += [
        f"{obj.name} {phrase}: end that if the weights alone are to move it"
        for phrase in followers.phrases(obj, rig, target.bones.names)
    ]
    return [note for note in found if note]
