"""Pictures of the garments that are farthest from their artists' deformation, in the pose where they are."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.collections import PolyCollection

from .cases import Case
from .figures import worst_pose
from .poses import skinned

MOST = 0.1
"""Metres from the artist's surface at the end of the colour scale."""
COLOURS = mpl.colormaps["inferno_r"]
SKIN = np.array([0.78, 0.76, 0.74])


def draw(cases: list[tuple[Case, dict[str, np.ndarray]]], pose_names: list[str], path: Path) -> None:
    """One row per case: the artist's garment on the body, then each method's, coloured by the distance from it."""
    mpl.use("agg")
    import matplotlib.pyplot as plt

    columns = 1 + len(cases[0][1])
    figure, axes = plt.subplots(len(cases), columns, figsize=(3.4 * columns, 4.4 * len(cases)), squeeze=False)
    for row, (case, by_method) in zip(axes, cases, strict=True):
        last = list(by_method.values())[-1]
        pose = worst_pose(case, last)
        body = skinned(case.body.mesh.positions, case.body.skin.toarray(), case.body.pose_from_rest[[pose]])[0]
        assert case.artist is not None  # only such garments are drawn
        artist = case.artist_posed[pose]
        for axis, (name, weights) in zip(row, {"artist": case.artist, **by_method}.items(), strict=True):
            posed = skinned(case.mesh.positions, weights, case.body.pose_from_rest[[pose]])[0]
            off = np.linalg.norm(posed - artist, axis=1)
            _show(axis, (body, case.body.mesh.triangles), (posed, case.mesh.triangles, off), artist)
            p95 = 1000 * np.percentile(off, 95)
            axis.set_title(f"{name}, {pose_names[pose]}" + ("" if name == "artist" else f": {p95:.0f} mm"), fontsize=9)
        row[0].text(0, -0.02, case.name, transform=row[0].transAxes, fontsize=9)
    figure.savefig(path, dpi=90, facecolor="white", bbox_inches="tight")
    plt.close(figure)


def _show(axis, body, garment, framed: np.ndarray) -> None:
    """Triangles from far to near, seen a little from the character's left, framed on the artist's garment."""
    turn = np.deg2rad(30)
    right, towards = np.array([np.cos(turn), 0, -np.sin(turn)]), np.array([np.sin(turn), 0, np.cos(turn)])
    corners, shades = [], []
    for positions, triangles, colour in (
        (*body, np.broadcast_to(SKIN, (len(body[1]), 3))),
        (*garment[:2], COLOURS(np.clip(garment[2][garment[1]].mean(axis=1) / MOST, 0, 1))[:, :3]),
    ):
        faces = positions[triangles]
        normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        facing = np.abs(normals @ towards) / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
        corners.append(faces)
        shades.append(colour * (0.45 + 0.55 * facing)[:, None])
    faces, colours = np.concatenate(corners), np.concatenate(shades)
    order = np.argsort((faces @ towards).mean(axis=1))
    screen = np.stack([faces @ right, faces[..., 1]], axis=2)[order]
    axis.add_collection(PolyCollection(screen, facecolors=colours[order], edgecolors="face", lw=0.1))
    x, y = framed @ right, framed[:, 1]
    margin = 0.25 * max(np.ptp(x), np.ptp(y))
    axis.set_xlim(x.min() - margin, x.max() + margin)
    axis.set_ylim(y.min() - margin, y.max() + margin)
    axis.set_aspect("equal")
    axis.set_axis_off()
