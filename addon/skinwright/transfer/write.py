"""The one place where a transfer changes the scene."""

import time
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows
from ..reporting import GarmentReport
from ..scene import armature, attaching, binding, followers, mesh, smoothing, vertex_groups
from . import afterwards
from .checks import garment_warnings
from .compute import Result
from .inputs import Body, Garment
from .params import TransferParams


@dataclass(frozen=True)
class Plan:
    """What will be written, checked: `undo` (V, 4, 4) leads from the pose a target is bound in back to rest."""

    garment: Garment
    result: Result
    undo: NDArray[np.float64] | None


def plan(body: Body, garment: Garment, result: Result) -> Plan:
    """Raise SceneError while nothing is written yet."""
    if not garment.bound_in_pose:
        return Plan(garment, result, None)
    matrices = binding.blended(garment.object, body.rigs, result.names, _bones_alone(body, result))
    return Plan(garment, result, binding.undone(garment.object, matrices))


def _bones_alone(body: Body, result: Result) -> Rows:
    return csr.keep_columns(result.rows, np.array([name not in body.fields for name in result.names], bool))


def write(body: Body, planned: Plan, params: TransferParams) -> GarmentReport:
    """Write the rows, and what they need to act: missing groups, their opposites, the armature, the rest shape."""
    start = time.perf_counter()
    garment, result = planned.garment, planned.result
    target = garment.object
    warnings = garment_warnings(body, garment, params)
    if params.make_single_user and mesh.other_users(target):
        target.data = target.data.copy()
    before = {group.name for group in target.vertex_groups}
    vertices = np.flatnonzero(result.written)
    names, rows = _needed_columns(result, csr.take_rows(result.rows, vertices), before)
    vertex_groups.write(target, names, rows, vertices)
    vertex_groups.ensure(target, sorted({body.opposite.get(name, name) for name in names} & set(body.bones)))
    found = followers.others(target, body.objects, names, Matrix(garment.shape.matrix))
    warnings += _let_weights_rule(target, found, params)
    warnings += afterwards.warnings(body, garment, result)
    attached = params.add_armature and bool(body.rigs) and not armature.follows_any(target, body.rigs)
    if attached:
        attaching.attach(target, body.object)
        warnings += _let_weights_rule(target, followers.shaping(target, body.objects), params)
    warnings += _smooth(body, target, params)
    bound = planned.undo is not None and bool(armature.rigs(target))
    if planned.undo is not None and bound:
        warnings += _bind(garment, planned.undo)
    seconds = {"read": garment.seconds, "compute": result.seconds, "write": time.perf_counter() - start}
    return _report(planned, names, before, attached, bound, seconds, warnings)


def _let_weights_rule(target: bpy.types.Object, found: list[followers.Follower], params: TransferParams) -> list[str]:
    """End what else moves the target, or name it."""
    if params.replace_others:
        for follower in found:
            follower.end()
        return []
    return [
        f"{target.name} {follower.phrase}: turn on Replace Deformers if the weights alone are to move it"
        for follower in found
    ]


def _smooth(body: Body, target: bpy.types.Object, params: TransferParams) -> list[str]:
    model = smoothing.after_the_pose(body.object)
    if model is None or smoothing.after_the_pose(target) or not armature.rigs(target):
        return []
    if params.add_corrective_smooth:
        smoothing.copy(target, model)
        return []
    return [
        f"{body.object.name} has the modifier {model.name}, which smooths its poses, and {target.name} has none: "
        "turn on Corrective Smooth to give it one"
    ]


def _bind(garment: Garment, undo: NDArray[np.float64]) -> list[str]:
    """Give the target the rest shape that its weights lead from to what is shown."""
    shown = garment.shape.geometry
    left = binding.bind(garment.object, undo, shown.positions)
    if left <= 1e-3 * float(np.linalg.norm(shown.size)):
        return []
    return [
        f"{garment.object.name} was bound in the pose, but its modifiers leave it up to {left:.3g} away from where it "
        "was: apply those that shape it, then transfer again"
    ]


def _needed_columns(result: Result, rows: Rows, present: set[str]) -> tuple[list[str], Rows]:
    """Without the groups that would be created to stay empty."""
    used = np.bincount(rows.bones, minlength=len(result.names)) > 0
    needed = used | np.array([name in present for name in result.names], bool)
    return [name for name, kept in zip(result.names, needed, strict=True) if kept], csr.take_columns(rows, needed)


def _report(
    planned: Plan,
    names: list[str],
    before: set[str],
    attached: bool,
    bound: bool,
    seconds: dict[str, float],
    warnings: list[str],
) -> GarmentReport:
    garment, result = planned.garment, planned.result
    now = [group.name for group in garment.object.vertex_groups]
    matched = result.matched & result.written
    return GarmentReport(
        target=garment.object.name,
        vertices=len(result.written),
        matched=int(matched.sum()),
        inpainted=int((result.written & ~matched).sum()),
        untouched=int((~result.written).sum()),
        groups=len(names),
        created_groups=[name for name in now if name not in before],
        locked_groups=sorted(garment.locks),
        kept_groups=sorted(before - set(names) - garment.locks),
        armature_added=attached,
        bound_in_pose=bound,
        seconds=seconds,
        native=result.report,
        warnings=warnings,
    )
