"""Weights from a body to garments, without an operator or a window: read, compute, write."""

import bpy

from .. import jobs
from ..reporting import Report
from ..scene import mesh
from .checks import check_objects, source_warnings
from .compute import compute
from .inputs import read_body, read_garment
from .params import Mask, TransferParams, from_json, to_json
from .write import write

__all__ = ["Mask", "TransferParams", "from_json", "steps", "to_json", "transfer_weights"]


def transfer_weights(
    context: bpy.types.Context, source: bpy.types.Object, targets: list[bpy.types.Object], params: TransferParams
) -> Report:
    """Transfer from `source` to each of `targets`; all of them are computed before the first is written.

    Raises SceneError or native.NativeError with a sentence; then nothing has been written.
    """
    return jobs.wait(steps(context, source, targets, params))


def steps(
    context: bpy.types.Context, source: bpy.types.Object, targets: list[bpy.types.Object], params: TransferParams
) -> jobs.Jobs[Report]:
    """The same as a generator of jobs, for a window that must live on meanwhile."""
    check_objects(source, targets, params)
    with mesh.object_mode(context):
        body = read_body(source, params)
        garments = [read_garment(target, body, params) for target in targets]
        results = yield from compute(body, garments, params)
        reports = [write(body, garment, result, params) for garment, result in zip(garments, results, strict=True)]
    return Report(source.name, reports, source_warnings(body, reports[0].native))
