"""Weights of one character for another: inputs, the map between their bones, the native call, and one write."""

from collections.abc import Callable, Sequence

import bpy

from .. import jobs
from ..jobs import Jobs
from ..scene.watched import Watched
from .compute import compute
from .inputs import match_bones, read_pair, rest_bones_of
from .params import RetargetParams, from_json, to_json
from .report import RetargetReport
from .write import write

__all__ = [
    "RetargetParams",
    "RetargetReport",
    "from_json",
    "match_bones",
    "rest_bones_of",
    "retarget_weights",
    "steps",
    "to_json",
]


def retarget_weights(
    context: bpy.types.Context,
    source: bpy.types.Object,
    targets: Sequence[bpy.types.Object],
    params: RetargetParams,
) -> RetargetReport:
    """Retarget the weights of the character of `source`, an armature or one of its meshes, to the meshes `targets`."""
    return jobs.wait(steps(context, source, targets, params))


def steps(
    context: bpy.types.Context,
    source: bpy.types.Object,
    targets: Sequence[bpy.types.Object],
    params: RetargetParams,
    before_write: Callable[[Sequence[bpy.types.Object]], None] | None = None,
) -> Jobs[RetargetReport]:
    """The same, job by job. Nothing is written before all is computed; `before_write` is told when writing begins."""
    pair = read_pair(context, source, list(dict.fromkeys(targets)), params)  # one named twice is one
    seen = Watched([*pair.source.meshes, *pair.target.meshes, pair.source.armature, pair.target.armature])
    result = yield from seen.during(compute(pair, params))
    return write(pair, result, params, before_write)
