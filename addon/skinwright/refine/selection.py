"""Which of the sampled poses need a key: others stand for the rest, as drivers interpolate between keys."""

import numpy as np
from numpy.typing import NDArray


def needed(angles: tuple[float, ...], offsets: list[NDArray[np.floating]], most: float) -> list[int]:
    """Indices of the samples to keep, ascending; the others err by at most `most` when interpolated.

    `offsets` are (V, 3) per angle; at the angle 0 there are none, and beyond the last one they stay.
    None are kept if no offset exceeds `most`.
    """
    chosen: list[int] = []
    while True:
        errors = [_largest(field - _between(angles, offsets, chosen, k)) for k, field in enumerate(offsets)]
        worst = int(np.argmax(errors))
        if errors[worst] <= most:
            return chosen
        chosen = sorted({*chosen, worst})


def _between(
    angles: tuple[float, ...], offsets: list[NDArray[np.floating]], chosen: list[int], k: int
) -> NDArray[np.floating]:
    """What the keys `chosen` show at sample `k`."""
    below = [j for j in chosen if j <= k]
    above = [j for j in chosen if j >= k]
    start = (angles[below[-1]], offsets[below[-1]]) if below else (0.0, np.zeros_like(offsets[k]))
    if not above:
        return start[1]
    end = angles[above[0]], offsets[above[0]]
    share = (angles[k] - start[0]) / (end[0] - start[0]) if end[0] > start[0] else 1.0
    return start[1] + share * (end[1] - start[1])


def _largest(vectors: NDArray[np.floating]) -> float:
    return float(np.sqrt((vectors**2).sum(axis=1).max())) if len(vectors) else 0.0
