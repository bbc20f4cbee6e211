"""From arrays to the rows that will be written; nothing of Blender is touched.

The functions are generators: each yields a job and is sent what it gave, so that the caller decides how to wait.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import csr, native
from ..csr import Rows
from ..jobs import Jobs
from . import completion, fans, merging, parts, scalar_fields
from .inputs import Body, Garment
from .params import TransferParams
from .prepared import Prepared, in_frame


@dataclass(frozen=True)
class Result:
    """The new rows over `names`, for the vertices marked in `written`.

    `matched` (V,) and `report` are the library's own answer; `report` covers all that was solved with this target.
    `islands` (V,) number the loose parts, if nothing matches in one of them.
    """

    matched: NDArray[np.bool_]
    report: dict[str, Any]
    names: list[str]
    rows: Rows
    written: NDArray[np.bool_]
    seconds: float
    islands: NDArray[np.uint32] | None = None


@dataclass(frozen=True)
class Answer:
    """What the library says of the vertices of one target."""

    matched: NDArray[np.bool_]
    has_row: NDArray[np.bool_]
    report: dict[str, Any]


@dataclass(frozen=True)
class Failure:
    """A target without an answer, and the sentence why."""

    name: str
    sentence: str


def compute(
    body: Body, garments: list[Garment], params: TransferParams
) -> Jobs[tuple[dict[str, Result], list[Failure]]]:
    """The new rows by target's name, and the targets that have no answer."""
    packed = scalar_fields.pack(body.field_weights, len(body.fields)) if body.fields else None
    with_bones = bool(set(body.bones) & body.chosen)
    source = bone_source(body) if with_bones or packed is None else _source(body, packed, len(body.fields) + 1)
    results: dict[str, Result] = {}
    failures: list[Failure] = []
    for together in solved_together(garments, params):
        try:
            found = yield from _compute_group(body, together, source, packed, params)
        except native.NativeError as error:
            failures.append(Failure(" + ".join(garment.object.name for garment in together), str(error)))
        else:
            results |= {garment.object.name: result for garment, result in zip(together, found, strict=True)}
    return results, failures


def solved_together(garments: list[Garment], params: TransferParams) -> list[list[Garment]]:
    """The targets in groups, each one system: those whose borders lie on each other."""
    if not params.join_borders or len(garments) == 1:
        return [[garment] for garment in garments]
    found = parts.groups([garment.shape.geometry for garment in garments])
    return [[garments[number] for number in group] for group in found]


def bone_source(body: Body) -> native.Source:
    """The body with its bones, prepared."""
    return _source(body, body.bone_weights, len(body.bones))


def prepare(body: Body, garment: Garment, params: TransferParams) -> Prepared:
    """One target laid over the body and its bones."""
    return Prepared(body, bone_source(body), [garment], params)


def _source(body: Body, rows: Rows, n_columns: int) -> native.Source:
    positions, triangles = fans.surface(body.geometry)
    positions = in_frame(positions, body.unturned)
    return native.Source(body.name, positions, triangles, fans.rows(rows, body.geometry.quads), n_columns)


def _compute_group(
    body: Body,
    garments: list[Garment],
    source: native.Source,
    packed: Rows | None,
    params: TransferParams,
) -> Jobs[list[Result]]:
    """The results of targets that are solved together; `packed` are the weights of the fields."""
    start = time.perf_counter()
    prepared = Prepared(body, source, garments, params)
    prepared.check_reach(params)
    lost = prepared.lost_halves()
    if any(lost):
        # A mirrored half with nothing to match would be solved from this half's side and then drag it to the middle.
        alone = [replace(g, completion=completion.plain(g.shape.geometry)) for g in garments]
        garments = [other if gone else g for g, other, gone in zip(garments, alone, lost, strict=True)]
        prepared = Prepared(body, source, garments, params)
    with_bones = bool(set(body.bones) & body.chosen)
    names = [garment.names if with_bones else [] for garment in garments]
    rows = [csr.empty(len(garment.writable)) for garment in garments]
    answers: list[Answer] = []
    if with_bones:
        answers, rows = yield from _bone_rows(prepared, [g.mask for g in garments], params)
    if packed is not None:
        if with_bones:
            # Points and factorisations are those of the bones: only the solve is done again.
            prepared.set_source_weights(fans.rows(packed, body.geometry.quads), len(body.fields) + 1)
        of_fields, field_rows = yield from _field_rows(prepared, body, params)
        answers = answers or of_fields
        rows = [csr.beside(left, len(body.fields), right) for left, right in zip(field_rows, rows, strict=True)]
        names = [body.fields + each for each in names]
    seconds = (time.perf_counter() - start) / len(garments)
    results = [
        to_result(body, garment, answer, name, row, seconds)
        for garment, answer, name, row in zip(garments, answers, names, rows, strict=True)
    ]
    if not results[0].report["unmatched_islands"]:
        return results
    parts = np.split(prepared.islands, np.cumsum([len(result.matched) for result in results], dtype=np.int64)[:-1])
    return [replace(result, islands=part) for result, part in zip(results, parts, strict=True)]


def to_result(body: Body, garment: Garment, answer: Answer, names: list[str], rows: Rows, seconds: float) -> Result:
    """The columns that are written, and the vertices that have a row.

    Where only some bones are chosen, the others have made room and are written too.
    """
    bones = set(garment.names)
    wanted_names = body.chosen if not body.chosen & bones else body.chosen | bones
    held = {name for name, fixed in zip(garment.names, garment.held, strict=True) if fixed}
    wanted = np.array([name in wanted_names - garment.locks - held for name in names], bool)
    # A vertex without a row is one the policy for islands leaves alone.
    written = answer.has_row & garment.writable
    names = [name for name, kept in zip(names, wanted, strict=True) if kept]
    # The library has counted the centres of quads too.
    report = answer.report | (body.flaws if body.bones else {})
    return Result(answer.matched, report, names, csr.take_columns(rows, wanted), written, seconds)


def bone_rows(
    prepared: Prepared, garment: Garment, params: TransferParams, near: bool = False
) -> Jobs[tuple[Answer, Rows]]:
    """The library's answer for one target and the rows over `garment.names`; its mask counts. `near`: see Prepared."""
    answers, rows = yield from _bone_rows(prepared, [garment.mask], params, near)
    return answers[0], rows[0]


def _bone_rows(
    prepared: Prepared, masks: Sequence[NDArray[np.uint8] | None], params: TransferParams, near: bool = False
) -> Jobs[tuple[list[Answer], list[Rows]]]:
    joined = any(_joins_old_weights(garment, params) for garment in prepared.garments)
    # Where old weights or mirror images join in, the limit comes after them.
    limit = 0 if joined else params.max_influences
    transfer, solved = yield prepared.start(masks, params, limit, near)
    rows = []
    for number, garment in enumerate(prepared.garments):
        folded = garment.completion.fold(prepared.rows_of(solved, number), garment.opposite)
        _check(garment, folded, limit)
        rows.append(_merged(garment, folded, params) if joined else folded)
    return _answers(prepared, transfer), rows


def _joins_old_weights(garment: Garment, params: TransferParams) -> bool:
    partial = not (garment.chosen | garment.held).all()
    return params.mix_factor < 1 or partial or bool(garment.held.any()) or not garment.completion.is_plain


def _merged(garment: Garment, rows: Rows, params: TransferParams) -> Rows:
    return merging.merge(
        rows,
        garment.before,
        held=garment.held,
        chosen=garment.chosen,
        factor=params.mix_factor,
        max_influences=params.max_influences,
    )


def _answers(prepared: Prepared, transfer: Any) -> list[Answer]:
    matched = prepared.split(transfer.matched)
    has_row = prepared.split(np.diff(transfer.weights.indptr) > 0)
    report = dict(transfer.report)
    return [Answer(m, row, report) for m, row in zip(matched, has_row, strict=True)]


def _check(garment: Garment, rows: Rows, max_influences: int) -> None:
    """A last look at what the library answers: nothing that is not a set of weights is ever written."""
    counts = np.diff(rows.indptr)
    sums = csr.row_sums(rows)[counts > 0]
    sound = np.isfinite(rows.values).all() and (rows.values >= 0).all() and (np.abs(sums - 1) < 1e-5).all()
    if not sound or (max_influences and counts.max(initial=0) > max_influences):
        raise native.NativeError(f"{garment.object.name}: the answer is no set of weights; please report this")


def _field_rows(prepared: Prepared, body: Body, params: TransferParams) -> Jobs[tuple[list[Answer], list[Rows]]]:
    n = len(body.fields)
    masks = [garment.mask for garment in prepared.garments]
    transfer, solved = yield prepared.start(masks, params, max_influences=0)
    same = np.arange(n + 1, dtype=np.int64)
    rows = []
    for number, garment in enumerate(prepared.garments):
        folded = garment.completion.fold(prepared.rows_of(solved, number), same)
        rows.append(merging.mix(scalar_fields.unpack(folded, n), garment.fields_before, params.mix_factor))
    return _answers(prepared, transfer), rows
