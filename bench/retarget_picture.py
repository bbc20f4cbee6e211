"""Pictures of characters: shaded triangles seen from the front, painted back to front."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.collections import PolyCollection

_LIGHT = np.array([0.3, 0.8, 0.5]) / np.linalg.norm([0.3, 0.8, 0.5])


@dataclass(frozen=True)
class View:
    """Positions (V, 3), triangles (T, 3) and colors (V, 3); `axes` are right, up and towards the viewer."""

    title: str
    positions: np.ndarray
    triangles: np.ndarray
    colors: np.ndarray
    axes: np.ndarray


def axes_of(z_up: bool) -> np.ndarray:
    """(3, 3) for a character that faces -Y with Z up, or Z with Y up."""
    return np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]] if z_up else [[1, 0, 0], [0, 1, 0], [0, 0, 1]], float)


def place_colors(points: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Colors (V, 3) by the place in the source's box, with stripes that show shifts."""
    low, size = source.min(0), np.maximum(np.ptp(source, axis=0), 1e-12)
    places = np.clip((points - low) / size, 0, 1)
    stripes = 0.85 + 0.15 * np.sign(np.sin(60 * places[:, [2]]) * np.sin(60 * places[:, [0]]))
    return (0.15 + 0.85 * places) * stripes


def error_colors(error: np.ndarray) -> np.ndarray:
    """White at 0, red at 0.5 and more (V, 3)."""
    share = np.clip(2 * error, 0, 1)[:, None]
    return (1 - share) * np.array([0.92, 0.92, 0.92]) + share * np.array([0.85, 0.05, 0.05])


def save(rows: list[list[View]], path: Path) -> None:
    """One row of pictures per list."""
    columns = max(len(row) for row in rows)
    figure, grid = plt.subplots(len(rows), columns, figsize=(2.6 * columns, 3.1 * len(rows)), squeeze=False)
    for axes, row in zip(grid, rows, strict=True):
        for place in axes:
            place.axis("off")
        for place, view in zip(axes, row, strict=False):
            _draw(place, view)
    figure.tight_layout(pad=0.3)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def _draw(place, view: View) -> None:
    seen = view.positions @ view.axes.T
    corners = seen[view.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    facing = normals[:, 2] > 0
    order = np.argsort(corners[facing, :, 2].mean(1))
    shade = 0.45 + 0.55 * np.clip(normals[facing] @ _LIGHT, 0, 1)
    colors = np.clip(view.colors[view.triangles[facing]].mean(1) * shade[:, None], 0, 1)
    polygons = corners[facing][:, :, :2][order]
    place.add_collection(PolyCollection(polygons, facecolors=colors[order], edgecolors="none", linewidths=0))
    place.set_xlim(seen[:, 0].min() - 0.02, seen[:, 0].max() + 0.02)
    place.set_ylim(seen[:, 1].min() - 0.02, seen[:, 1].max() + 0.02)
    place.set_aspect("equal")
    place.set_title(view.title, fontsize=7)
