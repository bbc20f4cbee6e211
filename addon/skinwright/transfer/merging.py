"""How transferred weights join those a garment already has: locks, mixing, the limit. Numpy only."""

import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows

# Sums of f32 weights the artist normalised differ from 1 by this much at most.
SUM_TOLERANCE = 1e-4

# One for all vertices, or (V,) one for each.
Factor = float | NDArray[np.float64]


def merge(
    transferred: Rows,
    before: Rows,
    *,
    held: NDArray[np.bool_],
    chosen: NDArray[np.bool_],
    factor: Factor,
    max_influences: int,
) -> Rows:
    """Rows over the columns that are not held: `factor` of the transferred and the rest of the old weights.

    `transferred` and `before` share their columns (B,); `held` marks those that stay as they are, `chosen` those that
    are taken from the transfer. The others make room: they keep their proportions and fill what is left. A row sums to
    what the held weights leave of 1 and, with them, has at most `max_influences` entries (0: no limit). An empty
    transferred row stays empty: that vertex is not to be written.
    """
    written = np.diff(transferred.indptr) > 0
    kept = csr.keep_columns(before, held)
    remainder = np.clip(1 - csr.row_sums(kept), 0, None)
    remainder[remainder < SUM_TOLERANCE] = 0
    old = _only(csr.keep_columns(before, ~held), written)
    if chosen[~held].all():
        rows = _joined(_scaled(csr.keep_columns(transferred, ~held), remainder), old, factor, remainder)
    else:
        rows = _beside(csr.keep_columns(transferred, ~held & chosen), old, chosen, factor, remainder)
    if max_influences:
        members = np.bincount(csr.entry_vertices(kept)[kept.values > 0], minlength=len(remainder))
        rows = _scaled(csr.keep_largest(rows, np.maximum(max_influences - members, 0)), remainder)
    return rows


def _joined(new: Rows, old: Rows, factor: Factor, remainder: NDArray[np.float64]) -> Rows:
    """`factor` of the new and the rest of the old weights; the old alone where there are no new ones."""
    new_share = np.where(csr.row_sums(new) > 0, factor, 0.0)
    has_only_new = not old.values.size and np.all(factor > 0)
    if has_only_new or (new_share == 1).all():
        return new
    return _scaled(_mixed(new, old, new_share, 1.0 - new_share), remainder)


def _beside(new: Rows, old: Rows, chosen: NDArray[np.bool_], factor: Factor, remainder: NDArray[np.float64]) -> Rows:
    """The chosen columns as they come, and the old weights of the others scaled to what that leaves."""
    every = np.ones(len(remainder))
    new = _mixed(new, csr.keep_columns(old, chosen), factor * every, (1 - factor) * every)
    others = csr.keep_columns(old, ~chosen)
    sums = np.minimum(csr.row_sums(new), remainder)
    alone = csr.row_sums(others) <= 0
    new = _scaled(new, np.where(alone, remainder, sums))
    others = _scaled(others, np.where(alone, 0.0, remainder - sums))
    return _mixed(new, others, every, every)


def _only(rows: Rows, written: NDArray[np.bool_]) -> Rows:
    """The entries of these rows alone."""
    if written.all():
        return rows
    kept = written[csr.entry_vertices(rows)]
    return csr.from_entries(csr.entry_vertices(rows)[kept], rows.bones[kept], rows.values[kept], len(written))


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
