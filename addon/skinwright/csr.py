"""Arithmetic on CSR weight rows (indptr, bones, values); numpy only."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Places in a table for each of the entries that are added up in it.
_DENSE = 16


class Rows(NamedTuple):
    """Weights as CSR: row r spans `bones` and `values` from indptr[r] to indptr[r + 1]; bones index a list of names."""

    indptr: NDArray[np.uint32]
    bones: NDArray[np.uint32]
    values: NDArray[np.float32]


def empty(n_rows: int) -> Rows:
    """Rows without an entry."""
    return Rows(np.zeros(n_rows + 1, np.uint32), np.zeros(0, np.uint32), np.zeros(0, np.float32))


def entry_vertices(rows: Rows) -> NDArray[np.int64]:
    """(nnz,) the row of every entry."""
    return np.repeat(np.arange(len(rows.indptr) - 1, dtype=np.int64), np.diff(rows.indptr))


def row_sums(rows: Rows) -> NDArray[np.float64]:
    """(V,) the sum of every row."""
    sums = np.bincount(entry_vertices(rows), weights=rows.values, minlength=len(rows.indptr) - 1)
    return sums.astype(np.float64)  # numpy counts in integers where there is no entry at all


def from_entries(vertex: NDArray, bone: NDArray, value: NDArray, n_rows: int) -> Rows:
    """Rows of entries in any order; entries of one place are added up, those of weight 0 dropped."""
    width = int(bone.max(initial=0)) + 1
    place = vertex.astype(np.int64) * width + bone
    if n_rows * width <= _DENSE * len(place):  # a table is faster than sorting
        table = np.bincount(place, weights=value, minlength=n_rows * width)
        place = np.flatnonzero(table)
        total = table[place]
    else:
        place, inverse = np.unique(place, return_inverse=True)
        total = np.bincount(inverse, weights=value, minlength=len(place))
        place, total = place[total != 0], total[total != 0]
    indptr = np.concatenate([[0], np.cumsum(np.bincount(place // width, minlength=n_rows), dtype=np.int64)])
    return Rows(indptr.astype(np.uint32), (place % width).astype(np.uint32), total.astype(np.float32))


def keep_entries(rows: Rows, kept: NDArray[np.bool_]) -> Rows:
    """The entries marked in `kept` (nnz,)."""
    if kept.all():
        return rows
    indptr = np.concatenate([[0], np.cumsum(kept, dtype=np.int64)])[rows.indptr]
    return Rows(indptr.astype(np.uint32), rows.bones[kept], rows.values[kept])


def keep_columns(rows: Rows, columns: NDArray[np.bool_]) -> Rows:
    """The entries whose bone is marked in `columns` (B,)."""
    return keep_entries(rows, columns[rows.bones])


def take_columns(rows: Rows, columns: NDArray[np.bool_]) -> Rows:
    """The same, with the kept columns numbered anew."""
    if columns.all():
        return rows
    kept = keep_columns(rows, columns)
    return kept._replace(bones=(np.cumsum(columns, dtype=np.int64) - 1).astype(np.uint32)[kept.bones])


def keep_largest(rows: Rows, most: NDArray[np.integer]) -> Rows:
    """At most `most` (V,) entries a row, the largest; of equal ones that of the lower bone."""
    vertex = entry_vertices(rows)
    order = np.lexsort((rows.bones, -rows.values, vertex))
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order), dtype=np.int64) - rows.indptr[vertex[order]]
    return keep_entries(rows, rank < most[vertex])


def beside(left: Rows, n_columns: int, right: Rows) -> Rows:
    """Rows over the `n_columns` columns of `left`, then those of `right`."""
    if n_columns == 0:
        return right
    vertex = np.concatenate([entry_vertices(left), entry_vertices(right)])
    order = np.argsort(vertex, kind="stable")
    bones = np.concatenate([left.bones, right.bones + np.uint32(n_columns)])
    values = np.concatenate([left.values, right.values])
    return Rows(left.indptr + right.indptr, bones[order], values[order])


def concatenated(parts: Sequence[Rows]) -> Rows:
    """The rows of all parts, at least one, one after another."""
    offsets = np.cumsum([0, *(len(part.bones) for part in parts)], dtype=np.int64)
    indptr = [part.indptr[1:] + np.uint32(start) for part, start in zip(parts, offsets, strict=False)]
    return Rows(
        np.concatenate([np.zeros(1, np.uint32), *indptr]),
        np.concatenate([part.bones for part in parts]),
        np.concatenate([part.values for part in parts]),
    )


def take_rows(rows: Rows, indices: NDArray[np.integer]) -> Rows:
    """The rows of these indices, in their order."""
    if np.array_equal(indices, np.arange(len(rows.indptr) - 1, dtype=np.int64)):
        return rows
    counts = np.diff(rows.indptr)[indices].astype(np.int64)
    indptr = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    entries = np.arange(indptr[-1], dtype=np.int64) + np.repeat(rows.indptr[indices] - indptr[:-1], counts)
    return Rows(indptr.astype(np.uint32), rows.bones[entries], rows.values[entries])


def replace_rows(rows: Rows, indices: NDArray[np.integer], new: Rows) -> Rows:
    """`rows` with row r of `new` in place of row indices[r]; entries ascend by bone in each row."""
    vertex = entry_vertices(rows)
    kept = ~np.isin(vertex, indices)
    vertex = np.concatenate([vertex[kept], np.asarray(indices, np.int64)[entry_vertices(new)]])
    bones, values = (
        np.concatenate([old[kept], now]) for old, now in ((rows.bones, new.bones), (rows.values, new.values))
    )
    order = np.lexsort((bones, vertex))
    counts = np.bincount(vertex, minlength=len(rows.indptr) - 1)
    indptr = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    return Rows(indptr.astype(np.uint32), bones[order], values[order])


def half_l1(one: Rows, other: Rows) -> NDArray[np.float64]:
    """(V,) half the sum of absolute differences of two rows each: the share of weights that is elsewhere."""
    vertex = np.concatenate([entry_vertices(one), entry_vertices(other)])
    bones, values = np.concatenate([one.bones, other.bones]), np.concatenate([one.values, -other.values])
    both = from_entries(vertex, bones, values, len(one.indptr) - 1)
    return row_sums(both._replace(values=np.abs(both.values))) / 2
