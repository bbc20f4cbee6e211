"""The last look at rows before they are written, whoever writes them; numpy only."""

import numpy as np
from numpy.typing import NDArray

from . import csr
from .csr import Rows
from .errors import Refused

# Sums of f32 weights that were normalised differ from 1 by this much at most.
SUM_TOLERANCE = 1e-4
_OVER = 1e-6


class Unsound(Refused):
    """Rows that are no weights: a bug, found before it reached the file."""


def check(name: str, rows: Rows) -> None:
    """Raise Unsound unless every weight is a number from 0 to 1; `name` is the object's."""
    values = rows.values
    with np.errstate(invalid="ignore"):
        good = (values >= 0) & (values <= 1 + _OVER)  # not a number is neither
    if not good.all():
        entry = int(np.flatnonzero(~good)[0])
        vertex = int(np.searchsorted(rows.indptr, entry, side="right")) - 1
        raise Unsound(
            f"{name}: the answer for vertex {vertex} has the weight {values[entry]}, so nothing was written; "
            "please report this"
        )


def check_sums(name: str, rows: Rows, bones: NDArray[np.bool_], *, least: float = 0.0) -> None:
    """Raise Unsound where the weights in the columns `bones` (B,) sum to more than 1 or to less than `least`.

    Rows without such an entry are not looked at.
    """
    deforming = csr.keep_columns(rows, bones)
    sums = csr.row_sums(deforming)[np.diff(deforming.indptr) > 0]
    if sums.size and not (sums.max() <= 1 + SUM_TOLERANCE and sums.min() >= least - SUM_TOLERANCE):
        worst = sums[np.abs(sums - 1).argmax()]
        raise Unsound(
            f"{name}: the answer has weights that sum to {worst:.6g}, so nothing was written; please report this"
        )
