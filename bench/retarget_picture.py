"""Pictures of characters seen from the front."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
import raster

matplotlib.use("Agg")
import matplotlib.pyplot as plt


@dataclass(frozen=True)
class View:
    """Positions (V, 3), triangles (T, 3), values (V, k) of which `color` makes RGB (n, 3) in each pixel; `axes` are
    right, up and towards the viewer.
    """

    title: str
    positions: np.ndarray
    triangles: np.ndarray
    values: np.ndarray
    color: Callable[[np.ndarray], np.ndarray]
    axes: np.ndarray


def axes_of(z_up: bool) -> np.ndarray:
    """(3, 3) for a character that faces -Y with Z up, or Z with Y up."""
    return np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]] if z_up else [[1, 0, 0], [0, 1, 0], [0, 0, 1]], float)


def place_colors(source: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Colors of places (n, 3) in the source's box, with a chequer that shows shifts."""
    low, size = source.min(0), np.maximum(np.ptp(source, axis=0), 1e-12)
    square = size.max() / 36

    def color(points: np.ndarray) -> np.ndarray:
        places = np.clip((points - low) / size, 0, 1)
        dark = np.floor((points - low) / square).astype(int).sum(1) % 2
        return (0.25 + 0.75 * places) * np.where(dark, 0.6, 1.0)[:, None]

    return color


def error_colors(error: np.ndarray) -> np.ndarray:
    """White at 0, red at 0.5 and more, of errors (n, 1)."""
    share = np.clip(2 * error, 0, 1)
    return (1 - share) * np.array([0.92, 0.92, 0.92]) + share * np.array([0.85, 0.05, 0.05])


def grey(values: np.ndarray) -> np.ndarray:
    """One grey for every pixel (n, 3)."""
    return np.full((len(values), 3), 0.85)


def save(rows: list[list[View]], path: Path) -> None:
    """One row of pictures per list."""
    columns = max(len(row) for row in rows)
    figure, grid = plt.subplots(len(rows), columns, figsize=(2.6 * columns, 3.1 * len(rows)), squeeze=False)
    for axes, row in zip(grid, rows, strict=True):
        for place in axes:
            place.axis("off")
        for place, view in zip(axes, row, strict=False):
            camera = raster.Camera.around(view.positions, view.axes, (312, 340))
            place.imshow(raster.picture(camera, view.positions, view.triangles, view.values, view.color))
            place.set_title(view.title, fontsize=7)
    figure.tight_layout(pad=0.3)
    figure.savefig(path, dpi=120)
    plt.close(figure)
