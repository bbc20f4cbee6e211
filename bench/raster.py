"""Pictures of triangles with a depth buffer, in NumPy: smooth shading, colours calculated per pixel.

matplotlib sorts whole triangles by their middles, which tears bent skin open, and leaves seams between neighbours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

_LIGHT = np.array([-0.35, 0.55, 0.75]) / np.linalg.norm([-0.35, 0.55, 0.75])
_FINER = 2
"""Samples per pixel along each side."""


@dataclass(frozen=True)
class Camera:
    """Parallel projection: `axes` (3, 3) are right, up and towards the viewer, the picture's middle and its height in
    units of the scene, and its size in pixels (width, height).
    """

    axes: np.ndarray
    middle: np.ndarray
    height: float
    size: tuple[int, int]

    @classmethod
    def around(cls, positions: np.ndarray, axes: np.ndarray, size: tuple[int, int]) -> Camera:
        """A camera that sees all positions (V, 3)."""
        seen = positions @ axes.T
        low, high = seen.min(0), seen.max(0)
        extent = np.maximum(high - low, 1e-9)
        height = 1.05 * max(extent[1], extent[0] * size[1] / size[0])
        return cls(axes, (low + high) / 2 @ axes, height, size)


def picture(
    camera: Camera,
    positions: np.ndarray,
    triangles: np.ndarray,
    values: np.ndarray,
    colour: Callable[[np.ndarray], np.ndarray] | None = None,
    *,
    lit: bool = True,
) -> np.ndarray:
    """(height, width, 3) in 0 to 1 on white: `values` (V, k) are interpolated, `colour` makes RGB (n, 3) of them."""
    width, height = (_FINER * n for n in camera.size)
    seen = (positions - camera.middle) @ camera.axes.T * (height / camera.height)
    places = np.column_stack([seen[:, 0] + width / 2, height / 2 - seen[:, 1], seen[:, 2]])
    pixels, nearest, shares = _visible(places[triangles], width, height)
    corners = triangles[nearest]
    found = np.einsum("nk,nkc->nc", shares, values[corners])
    rgb = found if colour is None else colour(found)
    if lit:
        normals = np.einsum("nk,nkc->nc", shares, _normals(positions, triangles)[corners]) @ camera.axes.T
        light = np.abs(normals @ _LIGHT) / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
        rgb = rgb * (0.3 + 0.7 * light)[:, None]
    image = np.ones((width * height, 3))
    image[pixels] = np.clip(rgb, 0, 1)
    return image.reshape(camera.size[1], _FINER, camera.size[0], _FINER, 3).mean(axis=(1, 3))


def _normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(V, 3), weighted by area; vertices at one place share theirs, so that split seams do not show."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    _, welded = np.unique(positions.astype(np.float32), axis=0, return_inverse=True)
    welded = welded.ravel()
    sums = np.zeros((welded.max() + 1, 3))
    for k in range(3):
        np.add.at(sums, welded[triangles[:, k]], np.cross(b - a, c - a))
    return sums[welded]


def _visible(corners: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of corners (T, 3, 3), pixels and depth: which pixels are covered, the nearest triangle, its shares (n, 3)."""
    xy = corners[:, :, :2]
    low = np.clip(np.floor(xy.min(1)).astype(int), 0, [width, height])
    high = np.clip(np.ceil(xy.max(1)).astype(int), 0, [width, height])
    (ax, ay), (bx, by), (cx, cy) = (xy[:, k].T for k in range(3))
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    extent = np.where((np.abs(area) > 1e-12)[:, None], high - low, 0)
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
    order = np.argsort(-extent[:, 1], kind="stable")
    for j in range(int(extent[:, 1].max(initial=0))):
        rows = order[: np.searchsorted(-extent[order, 1], -j, side="left")]
        columns = rows[np.argsort(-extent[rows, 0], kind="stable")]
        for i in range(int(extent[rows, 0].max(initial=0))):
            t = columns[: np.searchsorted(-extent[columns, 0], -i, side="left")]
            x, y = low[t, 0] + i + 0.5, low[t, 1] + j + 0.5
            v = ((x - ax[t]) * (cy[t] - ay[t]) - (cx[t] - ax[t]) * (y - ay[t])) / area[t]
            w = ((bx[t] - ax[t]) * (y - ay[t]) - (x - ax[t]) * (by[t] - ay[t])) / area[t]
            share = np.column_stack([1 - v - w, v, w])
            inside = (share >= -1e-9).all(1)
            t, share = t[inside], share[inside]
            pixel = (low[t, 1] + j) * width + low[t, 0] + i
            parts.append((pixel, t, share, (share * corners[t, :, 2]).sum(1)))
    pixel, t, share, depth = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort((t, -depth, pixel))
    first = order[np.r_[True, np.diff(pixel[order]) > 0]]
    return pixel[first], t[first], share[first]
