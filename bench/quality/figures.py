"""What is measured of a garment's weights against its artist's: the figures of the data's SCORING.md."""

from __future__ import annotations

import numpy as np

from .cases import Case
from .poses import skinned

Figures = dict[str, float]
FEWEST = 12
"""Vertices a zone needs to count."""
DEEP = 0.002
"""Metres inside the body, and deeper than at rest, from where on a vertex penetrates."""

SHOWN = {
    "l1_mean": "half L1",
    "l1_collar": "collar",
    "l1_armpit": "armpit",
    "l1_crotch": "crotch",
    "l1_between_legs": "between legs",
    "l1_loose": "loose",
    "def_p95_mm": "def. p95 mm",
    "stretch_p995": "stretch p99.5",
    "torn_edges_pct": "torn %",
    "jump_max": "jump",
    "pen_pct": "penetration %",
}


def figures(case: Case, weights: np.ndarray, penetration: bool = True) -> Figures:
    """All figures of dense weights (V, B); those that need a reference only if there is one."""
    posed = skinned(case.mesh.positions, weights, case.body.pose_from_rest)
    out = _stretch(case, posed)
    out["jump_max"] = float(_half_l1(weights[case.edges[:, 0]] - weights[case.edges[:, 1]]).max())
    if case.artist is not None:
        out |= _weight_error(case, weights) | _deformation(case, posed)
    if penetration:
        out |= _penetration(case, posed)
    return out


def worst_pose(case: Case, weights: np.ndarray) -> int:
    """The pose in which the 95th percentile of the distance from the artist's surface is largest."""
    posed = skinned(case.mesh.positions, weights, case.body.pose_from_rest)
    return int(np.percentile(np.linalg.norm(posed - case.artist_posed, axis=2), 95, axis=1).argmax())


def _half_l1(difference: np.ndarray) -> np.ndarray:
    return 0.5 * np.abs(difference).sum(axis=1)


def _weight_error(case: Case, weights: np.ndarray) -> Figures:
    error = _half_l1(weights - case.artist)
    out = {"l1_mean": float(error @ case.areas / case.areas.sum()), "l1_p95": float(np.percentile(error, 95))}
    for zone, inside in case.zones.items():
        if inside.sum() >= FEWEST:
            out[f"l1_{zone}"] = float(error[inside].mean())
    return out


def _deformation(case: Case, posed: np.ndarray) -> Figures:
    error = 1000 * np.linalg.norm(posed - case.artist_posed, axis=2)
    p95 = np.percentile(error, 95, axis=1)
    return {"def_p95_mm": float(p95.max()), "def_mean_of_p95_mm": float(p95.mean()), "def_max_mm": float(error.max())}


def _ratios(case: Case, posed: np.ndarray) -> np.ndarray:
    """Length in each pose over length at rest of all edges longer than 0.1 mm (P, E)."""
    a, b = case.edges.T
    rest = np.linalg.norm(case.mesh.positions[a] - case.mesh.positions[b], axis=1)
    long = rest > 1e-4
    return np.linalg.norm(posed[:, a[long]] - posed[:, b[long]], axis=2) / rest[long]


def _stretch(case: Case, posed: np.ndarray) -> Figures:
    ratios = _ratios(case, posed)
    out = {
        "stretch_p995": float(np.percentile(ratios, 99.5, axis=1).max()),
        "stretch_max": float(ratios.max()),
        "crushed_edges_pct": float(100 * (ratios < 0.3).mean(axis=1).max()),
    }
    if case.artist is not None:
        torn = (ratios > 2) & (_ratios(case, case.artist_posed) < 1.6)
        out["torn_edges_pct"] = float(100 * torn.mean(axis=1).max())
    return out


def _penetration(case: Case, posed: np.ndarray) -> Figures:
    shares, deepest = [], 0.0
    for surface, positions in zip(case.body.posed_surfaces, posed, strict=True):
        height = surface.height(positions)
        inside = (height < -DEEP) & (height < case.rest_heights - DEEP)
        shares.append(inside.mean())
        deepest = max(deepest, float(-height[inside].min(initial=0)))
    return {"pen_pct": float(100 * np.mean(shares)), "pen_max_mm": 1000 * deepest}
