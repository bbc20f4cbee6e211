"""Groups that are no bones (cloth pins, masks) as rows that sum to 1, so that the native transfer can carry them.

Each of n fields is divided by n; what is missing to 1 goes to one more column. As the transfer is linear but for its
last clamp, each field is carried over as if it were alone.
"""

import numpy as np

from .. import csr
from ..csr import Rows


def pack(fields: Rows, n: int) -> Rows:
    """Rows over n + 1 columns that sum to 1, of rows over n columns with entries in [0, 1]."""
    n_rows = len(fields.indptr) - 1
    rest = np.clip(1 - csr.row_sums(fields) / n, 0, 1)
    return csr.from_entries(
        np.concatenate([csr.entry_vertices(fields), np.arange(n_rows, dtype=np.int64)]),
        np.concatenate([fields.bones, np.full(n_rows, n)]),
        np.concatenate([fields.values / n, rest]),
        n_rows,
    )


def unpack(rows: Rows, n: int) -> Rows:
    """The inverse of pack."""
    fields = csr.keep_columns(rows, np.arange(n + 1, dtype=np.int64) < n)
    return fields._replace(values=np.minimum(fields.values * np.float32(n), 1))
