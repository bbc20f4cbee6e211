"""From arrays to the rows that will be written; nothing of Blender is touched."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import native, soundness
from ..csr import Rows
from ..declared import native_keywords
from ..jobs import Jobs
from .inputs import Character, Pair
from .params import RetargetParams


@dataclass(frozen=True)
class Result:
    """The library's answer, and its rows over the target's bones."""

    retarget: Any
    rows: Rows


def compute(pair: Pair, params: RetargetParams) -> Jobs[Result]:
    """The new rows of all meshes of the target. Raises native.NativeError where there is no answer."""
    keywords = native_keywords(params) | {
        "bone_map": pair.bone_map,
        "source_parents": pair.source.bones.parents,
        "landmarks": pair.landmarks,
    }
    name = f"{pair.source.armature.name} to {pair.target.armature.name}"
    retarget, rows = yield native.start_retarget(
        name, _arrays(pair.source), pair.rows, _arrays(pair.target), **keywords
    )
    soundness.check(name, rows)
    soundness.check_sums(name, rows, np.ones(len(pair.target.bones.names), bool), least=1.0)
    return Result(retarget, rows)


def _arrays(character: Character) -> tuple[Any, ...]:
    bones = character.bones
    return character.positions, character.triangles, bones.frames, bones.lengths
