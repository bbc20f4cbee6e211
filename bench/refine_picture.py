"""Pictures of posed skin beside each other: triangles that pass through each other are red."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import raster

matplotlib.use("Agg")
import matplotlib.pyplot as plt

METHODS = ("linear", "Preserve Volume", "Corrective Smooth", "live", "bake")
_SIZE = (300, 300)


def _camera(positions: np.ndarray, towards: np.ndarray) -> raster.Camera:
    towards = towards / np.linalg.norm(towards)
    up = np.array([0.0, 1.0, 0.0])
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    return raster.Camera.around(positions, np.stack([right, np.cross(towards, right), towards]), _SIZE)


def _draw(axis, camera: raster.Camera, body, positions: np.ndarray, title: str) -> None:
    pairs = body.new_pairs(positions)
    crossed = np.zeros((len(body.character.positions), 1))
    for pair in pairs:
        crossed[body.triangles[list(pair)].ravel()] = 1
    image = raster.picture(camera, positions, body.triangles, crossed, _colour)
    axis.imshow(image)
    axis.axis("off")
    axis.set_title(f"{title}: {len(pairs)}", fontsize=8)


def _colour(crossed: np.ndarray) -> np.ndarray:
    return np.where(crossed > 0.5, [0.9, 0.1, 0.1], [0.85, 0.8, 0.76])


def sheet(cases: list, path: Path) -> None:
    """A row per case (title, body, positions by method), seen from where the skin differs."""
    figure, grid = plt.subplots(len(cases), len(METHODS), figsize=(2.6 * len(METHODS), 2.8 * len(cases)), squeeze=False)
    for row, (title, body, shown) in zip(grid, cases, strict=True):
        differs = np.linalg.norm(shown[-1] - shown[0], axis=1)
        near = shown[-1][differs > 0.1 * differs.max()]
        camera = _camera(near, np.array([0.8, 0.25, 0.6]))
        for axis, method, positions in zip(row, METHODS, shown, strict=True):
            _draw(axis, camera, body, positions, method)
        row[0].text(0, 0, title, fontsize=8, transform=row[0].transAxes)
    figure.tight_layout(pad=0.4)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def strips(rows: list, path: Path) -> None:
    """A row per strip (title, body, joint, positions by frame, direction to the viewer)."""
    figure, grid = plt.subplots(len(rows), len(rows[0][3]), figsize=(2.2 * len(rows[0][3]), 2.4 * len(rows)))
    for row, (title, body, joint, frames, towards) in zip(grid, rows, strict=True):
        head, tail = body.character.segments[joint]
        around = np.linalg.norm(body.character.positions - head, axis=1) < 0.6 * np.linalg.norm(tail - head)
        seen = np.vstack([frame[around] for frame in frames])
        camera = _camera(seen, towards)
        for axis, positions in zip(row, frames, strict=True):
            _draw(axis, camera, body, positions, title)
    figure.tight_layout(pad=0.4)
    figure.savefig(path, dpi=110)
    plt.close(figure)
