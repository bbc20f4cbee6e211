"""Colours of values on vertices; all but the influence counts can be told apart by the colour-blind."""

import numpy as np
from numpy.typing import NDArray

# By match_session.Category: blues match, oranges are inpainted. Okabe & Ito, Color Universal Design, 2008.
CATEGORIES = np.array(
    [(86, 180, 233), (230, 159, 0), (0, 114, 178), (213, 94, 0), (204, 121, 167)],
    np.float32,
) / np.float32(255)

# From filled in from around to copied from the source; the ends are those of inpainted and matched.
CONFIDENCE = np.array([CATEGORIES[1], (0.94, 0.9, 0.55), CATEGORIES[0]])

# No influence, then 1 to 4, then more: what riggers know from other tools.
INFLUENCES = np.array(
    [(0.1, 0.1, 0.1), (0.85, 0.12, 0.1), (0.95, 0.5, 0.05), (0.95, 0.85, 0.1), (0.25, 0.7, 0.2), (0.15, 0.35, 0.9)],
    np.float32,
)

# Sound, then by check.weight_check.Fault.
FAULTS = np.array(
    [
        (0.75, 0.75, 0.75),
        (0.1, 0.1, 0.1),
        (0.94, 0.89, 0.26),
        (0.8, 0.47, 0.65),
        (0.9, 0.62, 0),
        (0.84, 0.37, 0),
        (0.65, 0, 0.1),
        (0, 0.45, 0.7),
    ],
    np.float32,
)

# Pressed to half its length or less, as at rest, stretched to twice its length or more.
STRETCH = np.array([(0.13, 0.4, 0.67), (0.57, 0.77, 0.87), (0.96, 0.96, 0.96), (0.96, 0.65, 0.51), (0.7, 0.09, 0.17)])

# Equal, then from pale to dark red with the difference; single-hued, so that lightness alone tells it.
DIFFERENCE = np.array([(0.93, 0.93, 0.93), (0.99, 0.75, 0.55), (0.94, 0.42, 0.27), (0.75, 0.1, 0.15), (0.35, 0.0, 0.1)])


def of_values(kind: str, values: NDArray) -> NDArray[np.float32]:
    """(V, 3) of what a preview.Picture of this kind holds."""
    if kind == "MATCH":
        return of_categories(values)
    if kind == "CONFIDENCE":
        return of_confidence(values)
    if kind == "FAULTS":
        return FAULTS[values]
    if kind == "DIFFERENCE":
        return of_difference(values)
    return of_influences(values) if kind == "INFLUENCES" else of_stretch(values)


def of_categories(category: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(V, 3) of categories (V,)."""
    return CATEGORIES[category]


def of_confidence(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """(V, 3) of confidences (V,) from 0 to 1; 2 and more stand for the categories of these numbers."""
    steps = np.linspace(0, 1, len(CONFIDENCE))
    graded = np.stack([np.interp(values, steps, CONFIDENCE[:, channel]) for channel in range(3)], axis=1)
    whole = np.where(values >= 2, values, 0).astype(np.int64)
    return np.where((values >= 2)[:, None], CATEGORIES[whole], graded).astype(np.float32)


def of_influences(count: NDArray[np.integer]) -> NDArray[np.float32]:
    """(V, 3) of the number of influences (V,)."""
    return INFLUENCES[np.minimum(count, 5)]


def of_stretch(stretch: NDArray[np.floating]) -> NDArray[np.float32]:
    """(V, 3) of the base-2 logarithm (V,) of length now over length at rest."""
    at = np.clip(np.nan_to_num(stretch), -1, 1) * 2 + 2
    steps = np.arange(len(STRETCH), dtype=np.int64)
    return np.stack([np.interp(at, steps, STRETCH[:, channel]) for channel in range(3)], axis=1).astype(np.float32)


def of_difference(difference: NDArray[np.floating]) -> NDArray[np.float32]:
    """(V, 3) of differences (V,) from 0 to 1; small ones take more of the scale than large ones."""
    at = np.sqrt(np.clip(difference, 0, 1)) * (len(DIFFERENCE) - 1)
    steps = np.arange(len(DIFFERENCE), dtype=np.int64)
    return np.stack([np.interp(at, steps, DIFFERENCE[:, channel]) for channel in range(3)], axis=1).astype(np.float32)
