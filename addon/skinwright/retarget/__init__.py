"""Weights of one character for another: inputs, the map between their bones, the native call, and one write."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import bpy

from .. import jobs
from ..jobs import Jobs
from ..scene import editable
from ..scene.watched import Watched
from .compute import compute
from .inputs import by_character, match_bones, read_pair, rest_bones_of
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
    """Retarget the weights of the character of `source`, an armature or one of its meshes, to the meshes `targets`.

    These may be of several characters.
    """
    return jobs.wait(steps(context, source, targets, params))


def steps(
    context: bpy.types.Context,
    source: bpy.types.Object,
    targets: Sequence[bpy.types.Object],
    params: RetargetParams,
    before_write: Callable[[Sequence[bpy.types.Object]], None] | None = None,
    map_of: Callable[[bpy.types.Object], Mapping[str, str]] | None = None,
) -> Jobs[RetargetReport]:
    """The same, a job per character. Nothing is written before all is computed; then `before_write` is told.

    `map_of` returns the given bone map of a target's armature; without it `params` has that of all.
    """
    targets = list(dict.fromkeys(targets))  # one named twice is one
    editable.check_separate(targets)
    pairs = []
    for rig, meshes in by_character(targets):
        others = {obj.name for obj in targets} - {obj.name for obj in meshes}
        own = replace(params, landmarks=tuple(entry for entry in params.landmarks if entry[2] not in others))
        pairs.append(read_pair(context, source, meshes, replace(own, bone_map=map_of(rig)) if map_of else own))
    characters = [character for pair in pairs for character in (pair.source, pair.target)]
    seen = Watched([obj for one in characters for obj in (*one.meshes, one.armature)])
    results = []
    for pair in pairs:
        results.append((yield from seen.during(compute(pair, params))))
    return write(list(zip(pairs, results, strict=True)), params, before_write)
