"""The picture of the evaluation: the posed body, coloured by how far it is from the sculpt."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection
from sculpt_case import Case

POSES = {"A": "A (sculpted)", "B": "B (sculpted)", "C": "C (sculpted)", "D": "D (never sculpted)"}
MOST = 10.0
"""Millimetres at the end of the colour scale."""

COLOURS = mpl.colormaps["inferno_r"]


def draw(case: Case, results: dict[str, np.ndarray], path: Path) -> None:
    """One row for each of `results` (weights by name), one column for each pose."""
    mpl.use("agg")
    figure, axes = plt.subplots(len(results), len(POSES), figsize=(12, 7.4), facecolor="white", layout="constrained")
    for row, (name, weights) in zip(axes, results.items(), strict=True):
        errors = case.errors(weights)
        for axis, pose in zip(row, POSES, strict=True):
            show(axis, case, case.body.posed(weights, case.poses[pose]), errors[pose])
            axis.set_title(f"{POSES[pose]}, {name}: {errors[pose][case.touched].mean():.2f} mm", fontsize=10)
    scale = mpl.cm.ScalarMappable(mpl.colors.Normalize(0, MOST), COLOURS)
    figure.colorbar(scale, ax=axes, label="distance from the sculpt, mm", shrink=0.6, extend="max")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def show(axis: plt.Axes, case: Case, positions: np.ndarray, errors: np.ndarray) -> None:
    """Triangles from far to near, seen a little from the character's left; what was not touched is grey."""
    turn = np.deg2rad(35)
    right = np.array([np.cos(turn), 0, -np.sin(turn)])
    towards = np.array([np.sin(turn), 0, np.cos(turn)])
    screen = np.column_stack([positions @ right, positions[:, 1]])
    corners = positions[case.body.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = normals @ towards / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    order = np.argsort((corners @ towards).mean(axis=1))
    order = order[facing[order] > 0]
    light = (0.45 + 0.55 * facing[order])[:, None]
    is_touched = np.isin(case.body.triangles[order], case.touched).all(axis=1)
    shade = COLOURS(np.clip(errors[case.body.triangles[order]].mean(axis=1) / MOST, 0, 1))[:, :3]
    shade[~is_touched] = 0.8
    polygons = PolyCollection(screen[case.body.triangles[order]], facecolors=shade * light, edgecolors="face", lw=0.2)
    axis.add_collection(polygons)
    axis.set_aspect("equal")
    axis.set_axis_off()
    axis.set_xlim(-0.66, 0.8)
    axis.set_ylim(-0.85, 0.96)
