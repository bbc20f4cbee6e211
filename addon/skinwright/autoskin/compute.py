"""From meshes as read to the rows that are written; nothing of Blender is touched."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import csr, native, soundness
from ..csr import Rows
from ..declared import native_keywords
from ..jobs import Jobs
from ..scene import orientation
from ..transfer import merging, parts
from .inputs import Target
from .params import AutoskinParams


@dataclass(frozen=True)
class Answer:
    """The rows of all vertices over the armature's bones, and the bones no part of which lies inside of the mesh."""

    rows: Rows
    outside: list[str]


def compute(targets: Sequence[Target], params: AutoskinParams) -> Jobs[list[Answer]]:
    """An answer for every target, in their order."""
    answers: dict[int, Answer] = {}
    for together in _solved_together(targets, params):
        found = yield from _solve([targets[number] for number in together], params)
        answers |= dict(zip(together, found, strict=True))
    return [answers[number] for number in range(len(targets))]


def _solved_together(targets: Sequence[Target], params: AutoskinParams) -> list[list[int]]:
    """The numbers of targets in groups, each one solve: those that continue one another and take the same bones."""
    if not params.join_borders:
        return [[number] for number in range(len(targets))]
    alike: dict[tuple, list[int]] = {}
    for number, target in enumerate(targets):
        alike.setdefault((target.rig.name, target.computed.tobytes()), []).append(number)
    found = []
    for numbers in alike.values():
        joined = parts.groups([targets[number].completion.geometry for number in numbers])
        found += [[numbers[k] for k in group] for group in joined]
    return found


def _solve(targets: list[Target], params: AutoskinParams) -> Jobs[list[Answer]]:
    geometry = parts.united([target.completion.geometry for target in targets])
    bones, computed = targets[0].bones, np.flatnonzero(targets[0].computed)
    joined = any(target.joins_old_weights for target in targets)
    # Where old weights or mirror images join in, the limit comes after them.
    keywords = native_keywords(replace(params, max_influences=0) if joined else params)
    job = native.start_automatic_weights(
        " + ".join(target.object.name for target in targets),
        geometry.positions,
        orientation.outward(geometry.positions, geometry.triangles),
        np.stack([bones.heads, bones.tails], axis=1)[computed].astype(np.float32),
        _parents(bones.parents, computed),
        **keywords,
    )
    result, rows = yield job
    rows = rows._replace(bones=computed.astype(np.uint32)[rows.bones])
    outside = _outside(result.report, [bones.names[j] for j in computed])
    starts = np.cumsum([0, *(len(target.completion.geometry.positions) for target in targets)], dtype=np.int64)
    split = zip(targets, starts, starts[1:], strict=False)
    found = [csr.take_rows(rows, np.arange(start, end, dtype=np.int64)) for _, start, end in split]
    return [Answer(_finished(t, part, params), outside) for t, part in zip(targets, found, strict=True)]


def _outside(report: dict[str, Any], names: list[str]) -> list[str]:
    return [names[j] for j in report["bones_outside"]]


def _parents(parents: NDArray[np.int32], computed: NDArray[np.intp]) -> NDArray[np.int32]:
    """(n,) parents among the computed bones: the nearest one above, -1 where there is none."""
    number = {int(j): k for k, j in enumerate(computed)}
    found = []
    for j in computed.tolist():
        above = int(parents[j])
        while above >= 0 and above not in number:
            above = int(parents[above])
        found.append(number.get(above, -1))
    return np.array(found, np.int32)


def _finished(target: Target, rows: Rows, params: AutoskinParams) -> Rows:
    """The rows of the mesh's own vertices, joined with what is kept."""
    rows = target.completion.fold(rows, target.opposite)
    _check(target, rows)
    if not target.joins_old_weights:
        return rows
    return merging.merge(
        rows,
        target.before,
        held=~target.computed,
        chosen=target.chosen,
        factor=target.share,
        max_influences=params.max_influences,
    )


def _check(target: Target, rows: Rows) -> None:
    """A last look: every vertex has an answer, and it is one."""
    name, every = target.object.name, np.ones(len(target.bones.names), bool)
    soundness.check(name, rows)
    soundness.check_sums(name, rows, every, least=1.0)
    empty = np.flatnonzero(np.diff(rows.indptr) == 0)
    if empty.size:
        raise soundness.Unsound(
            f"{name}: the answer has no weight for vertex {empty[0]}, so nothing was written; please report this"
        )
