"""Weights from a body to garments, without an operator or a window: read, compute, write."""

from collections.abc import Callable, Sequence

import bpy
import numpy as np

from .. import csr, jobs, soundness
from ..reporting import Report
from ..scene import mesh, weight_state
from .checks import check_objects, source_warnings
from .compute import Result, compute
from .inputs import Body, Garment, read_body, read_garment
from .params import Mask, TransferParams, from_json, to_json
from .write import write

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
    check_objects(source, targets, params)
    with mesh.object_mode(context):
        body = read_body(source, params)
        garments = [read_garment(target, body, params) for target in targets]
        results = yield from compute(body, garments, params)
        for garment, result in zip(garments, results, strict=True):
            last_look(body, garment, result)
        if before_write:
            before_write(targets)
        with weight_state.all_or_nothing(targets):
            reports = [write(body, garment, result, params) for garment, result in zip(garments, results, strict=True)]
    return Report(source.name, reports, source_warnings(body, reports[0].native))


def last_look(body: Body, garment: Garment, result: Result) -> None:
    """Raise Unsound for rows that are no weights, before the first garment is written."""
    name, bones = garment.object.name, np.array([name not in body.fields for name in result.names], bool)
    soundness.check(name, result.rows)
    complete = not garment.locks and set(body.bones) <= body.chosen
    rows = csr.take_rows(result.rows, np.flatnonzero(result.written))
    soundness.check_sums(name, rows, bones, least=1.0 if complete else 0.0)
