"""Weights from a body to garments, without an operator or a window: read, compute, write."""

from collections.abc import Callable, Sequence

import bpy
import numpy as np

from .. import csr, jobs, soundness
from ..reporting import Report
from ..scene import mesh, object_state
from ..scene.error import SceneError
from ..scene.watched import Watched
from . import strangers
from .checks import check_source, source_warnings, target_problem
from .compute import Failure, compute
from .inputs import Body, Garment, read_body, read_garment
from .params import Mask, TransferParams, from_json, to_json
from .write import Plan, plan, write

__all__ = ["Mask", "TransferParams", "from_json", "steps", "to_json", "transfer_weights"]


BeforeWrite = Callable[[Sequence[bpy.types.Object]], None]


def transfer_weights(
    context: bpy.types.Context,
    source: bpy.types.Object,
    targets: list[bpy.types.Object],
    params: TransferParams,
    before_write: BeforeWrite | None = None,
) -> Report:
    """Transfer from `source` to each of `targets`: all are computed before the first is written, and all or none are.

    `before_write` is told when writing begins. Raises SceneError or native.NativeError with a sentence.
    """
    return jobs.wait(steps(context, source, targets, params, before_write))


def steps(
    context: bpy.types.Context,
    source: bpy.types.Object,
    targets: list[bpy.types.Object],
    params: TransferParams,
    before_write: BeforeWrite | None = None,
) -> jobs.Jobs[Report]:
    """The same as a generator of jobs, for a window that must live on meanwhile."""
    targets = list(dict.fromkeys(targets))  # one named twice is one
    check_source(source, targets)
    with mesh.object_mode(context):
        body = read_body(source, params, targets)
        seen = Watched([*targets, *body.objects, *body.rigs])
        garments, failures = _read(source, targets, body, params)
        results, unsolved = yield from seen.during(compute(body, garments, params))
        plans, unbindable = _plan(body, [garment for garment in garments if garment.object.name in results], results)
        failures += unsolved + unbindable
        if failures and not (params.skip_failing and plans):
            why = strangers.warnings(body.objects, body.rigs, body.bones) if unsolved else []
            raise SceneError("; ".join([*(failure.sentence for failure in failures), *why]))
        for planned in plans:
            last_look(body, planned)
        written = [planned.garment.object for planned in plans]
        if before_write:
            before_write(written)
        bound = [planned.garment.object for planned in plans if planned.undo is not None]
        with object_state.all_or_nothing(written, reshaped=bound):
            reports = [write(body, planned, params) for planned in plans]
    warnings = source_warnings(body, reports[0].native)
    return Report(body.name, params.method, reports, warnings, [failure.sentence for failure in failures])


def _read(
    source: bpy.types.Object, targets: list[bpy.types.Object], body: Body, params: TransferParams
) -> tuple[list[Garment], list[Failure]]:
    garments: list[Garment] = []
    failures: list[Failure] = []
    for target in targets:
        problem = target_problem(source, target, targets, params)
        try:
            if problem:
                raise SceneError(problem)
            garments.append(read_garment(target, body, params))
        except SceneError as error:
            failures.append(Failure(target.name, str(error)))
    return garments, failures


def _plan(body: Body, garments: list[Garment], results: dict) -> tuple[list[Plan], list[Failure]]:
    plans: list[Plan] = []
    failures: list[Failure] = []
    for garment in garments:
        try:
            plans.append(plan(body, garment, results[garment.object.name]))
        except SceneError as error:
            failures.append(Failure(garment.object.name, str(error)))
    return plans, failures


def last_look(body: Body, planned: Plan) -> None:
    """Raise Unsound for rows that are no weights, before the first garment is written."""
    garment, result = planned.garment, planned.result
    name, bones = garment.object.name, np.array([name not in body.fields for name in result.names], bool)
    soundness.check(name, result.rows)
    complete = not garment.held.any() and not body.is_partial
    rows = csr.take_rows(result.rows, np.flatnonzero(result.written))
    soundness.check_sums(name, rows, bones, least=1.0 if complete else 0.0)
