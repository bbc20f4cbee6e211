"""Weights of one character for another: inputs, the map between their bones, the native call, and one write."""

from collections.abc import Sequence

import bpy

from .. import jobs
from ..jobs import Jobs
from .compute import compute
from .inputs import read_pair
from .params import RetargetParams, from_json, to_json
from .report import RetargetReport
from .write import write

__all__ = ["RetargetParams", "RetargetReport", "from_json", "retarget_weights", "steps", "to_json"]


def retarget_weights(
    context: bpy.types.Context,
    source: bpy.types.Object,
    targets: Sequence[bpy.types.Object],
    params: RetargetParams,
) -> RetargetReport:
    """Retarget the weights of the character of armature `source` to the meshes `targets`, in one go."""
    return jobs.wait(steps(context, source, targets, params))


def steps(
    context: bpy.types.Context,
    source: bpy.types.Object,
    targets: Sequence[bpy.types.Object],
    params: RetargetParams,
) -> Jobs[RetargetReport]:
    """The same, job by job. Nothing is written before all is computed."""
    pair = read_pair(context, source, targets, params)
    result = yield from compute(pair, params)
    return write(pair, result, params)
