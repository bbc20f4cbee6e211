"""From arrays to the rows that will be written; nothing of Blender is touched."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import csr, native, soundness
from ..csr import Rows
from ..declared import native_keywords
from ..jobs import Jobs
from ..transfer import merging
from .inputs import Character, Pair
from .params import RetargetParams


@dataclass(frozen=True)
class Result:
    """The library's answer, its rows over the target's bones, and (V,) the vertices that have one.

    Columns of locked groups are empty, and the others fill what these leave of 1.
    """

    retarget: Any
    rows: Rows
    written: NDArray[np.bool_]


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
    merged = _beside_locked(pair, rows, params)
    soundness.check_sums(name, merged, np.ones(len(pair.target.bones.names), bool))
    return Result(retarget, merged, np.diff(rows.indptr) > 0)


def _beside_locked(pair: Pair, rows: Rows, params: RetargetParams) -> Rows:
    """Mesh by mesh, as each has locks of its own."""
    if not pair.held.any():
        return rows
    starts, parts = pair.target.starts, []
    every, limit = np.ones(pair.held.shape[1], bool), params.max_influences
    for held, before, start, end in zip(pair.held, pair.before, starts, starts[1:], strict=False):
        new = csr.take_rows(rows, np.arange(start, end, dtype=np.int64))
        parts.append(merging.merge(new, before, held=held, chosen=every, factor=1.0, max_influences=limit))
    return csr.concatenated(parts)


def _arrays(character: Character) -> tuple[Any, ...]:
    bones = character.bones
    return character.positions, character.whole.triangles, bones.frames, bones.lengths
