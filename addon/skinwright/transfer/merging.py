"""How transferred weights join those a garment already has: locks, mixing, the limit. Numpy only."""

import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows

# Sums of f32 weights the artist normalised differ from 1 by this much at most.
SUM_TOLERANCE = 1e-4


def merge(transferred: Rows, before: Rows, *, locked: NDArray[np.bool_], factor: float, max_influences: int) -> Rows:
    """Rows over the unlocked columns: `factor` of the transferred and the rest of the old weights.

    `transferred` and `before` share their columns; `locked` (B,) marks those held fixed. A row sums to what the locked
    weights leave of 1 and, with them, has at most `max_influences` entries (0: no limit). Where only locked bones are
    transferred, the old weights fill the rest. An empty transferred row stays empty: that vertex is not to be written.
    """
    held = csr.keep_columns(before, locked)
    remainder = np.clip(1 - csr.row_sums(held), 0, None)
    remainder[remainder < SUM_TOLERANCE] = 0
    rows = _scaled(csr.keep_columns(transferred, ~locked), remainder)
    new_share = np.where(csr.row_sums(rows) > 0, factor, 0.0)
    old_share = np.where(np.diff(transferred.indptr) > 0, 1 - new_share, 0.0)
    if old_share.any():
        rows = _scaled(_mixed(rows, csr.keep_columns(before, ~locked), new_share, old_share), remainder)
    if max_influences:
        members = np.bincount(csr.entry_vertices(held)[held.values > 0], minlength=len(remainder))
        rows = _scaled(csr.keep_largest(rows, np.maximum(max_influences - members, 0)), remainder)
    return rows


def mix(transferred: Rows, before: Rows, factor: float) -> Rows:
    """`factor` of the transferred and the rest of the old weights, column by column, no row normalised."""
    if factor == 1:
        return transferred
    every = np.ones(len(before.indptr) - 1)
    return _mixed(transferred, before, factor * every, (1 - factor) * every)


def overfull(before: Rows, locked: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The vertices whose locked weights alone sum to more than 1."""
    return np.flatnonzero(csr.row_sums(csr.keep_columns(before, locked)) > 1 + SUM_TOLERANCE)


def _mixed(rows: Rows, before: Rows, new_share: NDArray[np.float64], old_share: NDArray[np.float64]) -> Rows:
    """Each row times its share, added up."""
    old, new = csr.entry_vertices(before), csr.entry_vertices(rows)
    return csr.from_entries(
        np.concatenate([old, new]),
        np.concatenate([before.bones, rows.bones]),
        np.concatenate([old_share[old] * before.values, new_share[new] * rows.values]),
        len(new_share),
    )


def _scaled(rows: Rows, sums: NDArray[np.float64]) -> Rows:
    """Rows scaled to these sums; a row that sums to 0 stays as it is."""
    now = csr.row_sums(rows)
    scale = np.divide(sums, now, out=np.zeros_like(sums), where=now > 0)
    values = rows.values * scale[csr.entry_vertices(rows)]
    return csr.from_entries(csr.entry_vertices(rows), rows.bones, values, len(sums))
