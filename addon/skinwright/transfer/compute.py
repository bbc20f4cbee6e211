"""From arrays to the rows that will be written; nothing of Blender is touched.

The functions are generators: each yields a job and is sent what it gave, so that the caller decides how to wait.
"""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import csr, native
from ..csr import Rows
from ..jobs import Jobs
from . import merging, scalar_fields
from .inputs import Body, Garment
from .params import TransferParams


@dataclass(frozen=True)
class Result:
    """The new rows over `names`, for the vertices marked in `written`; `transfer` is the library's own answer."""

    transfer: Any
    names: list[str]
    rows: Rows
    written: NDArray[np.bool_]
    seconds: float


def compute(body: Body, garments: list[Garment], params: TransferParams) -> Jobs[list[Result]]:
    """The new rows of every garment. Raises native.NativeError where there is no answer."""
    packed = scalar_fields.pack(body.field_weights, len(body.fields)) if body.fields else None
    source = bone_source(body) if body.bones else _source(body, packed, len(body.fields) + 1)
    results = []
    for garment in garments:
        results.append((yield from _compute_one(body, garment, source, packed, params)))
    return results


def bone_source(body: Body) -> native.Source:
    """The body with its bones, prepared."""
    return _source(body, body.bone_weights, len(body.bones))


def prepare(source: native.Source, garment: Garment, params: TransferParams) -> native.Inpainting:
    """The garment laid over the body; the mask and the thresholds may still change."""
    geometry = garment.geometry
    return native.Inpainting(
        source, garment.object.name, geometry.positions, geometry.triangles, params.method, params.threads
    )


def _source(body: Body, rows: Rows, n_columns: int) -> native.Source:
    geometry = body.geometry
    return native.Source(body.object.name, geometry.positions, geometry.triangles, rows, n_columns)


def _compute_one(
    body: Body, garment: Garment, source: native.Source, fields: Rows | None, params: TransferParams
) -> Jobs[Result]:
    start = time.perf_counter()
    inpainting = prepare(source, garment, params)
    if body.bones:
        transfer, rows = yield from bone_rows(inpainting, garment, params)
        names = garment.names
    else:
        names, rows = [], csr.empty(len(garment.writable))
    if fields is not None:
        if body.bones:
            # Points and factorisations are those of the bones: only the solve is done again.
            inpainting.set_source_weights(fields, len(body.fields) + 1)
        of_fields, rows_of_fields = yield from _field_rows(inpainting, garment, params, len(body.fields))
        transfer = transfer if body.bones else of_fields
        rows = csr.beside(rows_of_fields, len(body.fields), rows)
        names = body.fields + names
    return to_result(body, garment, transfer, names, rows, time.perf_counter() - start)


def to_result(body: Body, garment: Garment, transfer: Any, names: list[str], rows: Rows, seconds: float) -> Result:
    """The columns that were chosen, without locked groups, and the vertices that have a row."""
    wanted = np.array([name in body.chosen - garment.locks for name in names], bool)
    # A vertex without a row is one the policy for islands leaves alone.
    written = (np.diff(transfer.weights.indptr) > 0) & garment.writable
    names = [name for name, kept in zip(names, wanted, strict=True) if kept]
    return Result(transfer, names, csr.take_columns(rows, wanted), written, seconds)


def bone_rows(inpainting: native.Inpainting, garment: Garment, params: TransferParams) -> Jobs[tuple[Any, Rows]]:
    """The library's answer and the rows over `garment.names`."""
    joined = params.mix_factor < 1 or bool(garment.locked.any())
    # Where old weights join in, the limit comes after them.
    limit = 0 if joined else params.max_influences
    transfer, rows = yield _start(inpainting, garment, params, limit)
    _check(garment, rows, limit)
    if joined:
        rows = merging.merge(
            rows,
            garment.before,
            locked=garment.locked,
            factor=params.mix_factor,
            max_influences=params.max_influences,
        )
    return transfer, rows


def _check(garment: Garment, rows: Rows, max_influences: int) -> None:
    """A last look at what the library answers: nothing that is not a set of weights is ever written."""
    counts = np.diff(rows.indptr)
    sums = csr.row_sums(rows)[counts > 0]
    sound = np.isfinite(rows.values).all() and (rows.values >= 0).all() and (np.abs(sums - 1) < 1e-5).all()
    if not sound or (max_influences and counts.max(initial=0) > max_influences):
        raise native.NativeError(f"{garment.object.name}: the answer is no set of weights; please report this")


def _field_rows(
    inpainting: native.Inpainting, garment: Garment, params: TransferParams, n: int
) -> Jobs[tuple[Any, Rows]]:
    transfer, rows = yield _start(inpainting, garment, params, max_influences=0)
    return transfer, merging.mix(scalar_fields.unpack(rows, n), garment.fields_before, params.mix_factor)


def _start(inpainting: native.Inpainting, garment: Garment, params: TransferParams, max_influences: int) -> native.Job:
    keywords = params.native() | {"mask": garment.mask, "max_influences": max_influences}
    del keywords["threads"]
    return inpainting.start(**keywords)
