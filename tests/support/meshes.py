"""The benchmark's meshes: a body of 10,682 vertices and 60 bones, and a tunic with a folded skirt in five sizes.

Everything is made from formulas, so every machine gets the same meshes; `load` keeps them in out/bench. Metres, Y up.
The garment stands off the body more and more towards the hem: about 40 % of it finds no match.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import igl
import numpy as np

CACHE = Path(__file__).resolve().parents[2] / "out" / "bench"

# Size: spacing of the grid that the surface is cut from in metres, and how often it is subdivided.
SIZES = {"5k": (0.0526, 1), "20k": (0.0526, 2), "100k": (0.0469, 3), "300k": (0.0541, 4), "1M": (0.0589, 5)}


@dataclass(frozen=True)
class Limb:
    """A cone with round ends, and how many bones lie along it."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    first_radius: float
    last_radius: float
    bones: int


TORSO = Limb((0, 0.95, 0), (0, 1.35, 0), 0.145, 0.155, 6)
NECK = Limb((0, 1.40, 0), (0, 1.55, 0), 0.06, 0.055, 2)
HEAD = Limb((0, 1.62, 0.01), (0, 1.70, 0.01), 0.095, 0.10, 2)
UPPER_ARMS = [Limb((x * 0.16, 1.40, 0), (x * 0.45, 1.25, 0), 0.062, 0.048, 4) for x in (1, -1)]
FOREARMS = [Limb((x * 0.45, 1.25, 0), (x * 0.70, 1.10, 0.02), 0.046, 0.034, 4) for x in (1, -1)]
HANDS = [Limb((x * 0.70, 1.10, 0.02), (x * 0.80, 1.04, 0.03), 0.036, 0.026, 4) for x in (1, -1)]
THIGHS = [Limb((x * 0.09, 0.92, 0), (x * 0.12, 0.50, 0), 0.092, 0.062, 5) for x in (1, -1)]
CALVES = [Limb((x * 0.12, 0.50, 0), (x * 0.13, 0.09, -0.01), 0.058, 0.040, 5) for x in (1, -1)]
FEET = [Limb((x * 0.13, 0.06, -0.01), (x * 0.14, 0.04, 0.15), 0.042, 0.034, 2) for x in (1, -1)]
HIPS = [Limb((0, 0.95, 0), (x * 0.09, 0.92, 0), 0, 0, 1) for x in (1, -1)]  # bones without flesh of their own
FLESH = [TORSO, NECK, HEAD, *UPPER_ARMS, *FOREARMS, *HANDS, *THIGHS, *CALVES, *FEET]

Field = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Mesh:
    """Positions (V, 3) f32 and triangles (T, 3) u32; `weights` (V, 60) f32, of a garment (0, 60)."""

    positions: np.ndarray
    triangles: np.ndarray
    weights: np.ndarray = field(default_factory=lambda: np.zeros((0, 60), np.float32))


def load(name: str) -> Mesh:
    """The body (`source`) or a garment by its size; made on first use."""
    path = CACHE / f"{name}.npz"
    if not path.exists():
        CACHE.mkdir(parents=True, exist_ok=True)
        np.savez(path, **vars(_make(name)))
    with np.load(path) as arrays:
        return Mesh(**arrays)


def _make(name: str) -> Mesh:
    positions, triangles = _body() if name == "source" else _garment(*SIZES[name])
    positions = positions.astype(np.float32)
    mesh = Mesh(positions, triangles.astype(np.uint32))
    return replace(mesh, weights=_bone_weights(positions)) if name == "source" else mesh


def _body() -> tuple[np.ndarray, np.ndarray]:
    positions, triangles = _cut(_body_field, (-0.92, -0.05, -0.25), (0.92, 1.85, 0.30), 0.032)
    positions = _relax(_body_field, positions, triangles)
    return igl.loop(positions, triangles, 1)


def _garment(spacing: float, subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    positions, triangles = _cut(_garment_field, (-0.92, 0.30, -0.50), (0.92, 1.65, 0.50), spacing)
    centre = positions[triangles].mean(axis=1)
    inside = (centre[:, 1] < 1.47) & (centre[:, 1] > 0.46) & (np.abs(centre[:, 0]) < 0.66)  # neck, hem and wrists open
    positions, triangles = _largest_part(positions, triangles[inside])
    positions = _relax(_garment_field, positions, triangles)
    for _ in range(subdivisions):
        positions, triangles = igl.loop(positions, triangles, 1)
    positions = _project(_garment_field, positions, 2)
    edge = igl.avg_edge_length(positions, triangles)
    return positions + np.random.default_rng(11).normal(size=positions.shape) * 0.1 * edge, triangles


def _limb_distance(points: np.ndarray, limb: Limb) -> np.ndarray:
    start, along = np.array(limb.start), np.subtract(limb.end, limb.start)
    t = np.clip((points - start) @ along / (along @ along), 0, 1)
    radius = limb.first_radius + (limb.last_radius - limb.first_radius) * t
    return np.linalg.norm(points - start - t[:, None] * along, axis=1) - radius


def _smooth_minimum(distances: list[np.ndarray], radius: float) -> np.ndarray:
    stacked = np.stack(distances)
    least = stacked.min(axis=0)
    return least - radius * np.log(np.exp((least - stacked) / radius).sum(axis=0))


def _body_field(points: np.ndarray) -> np.ndarray:
    return _smooth_minimum([_limb_distance(points, limb) for limb in FLESH], 0.02)


def _garment_field(points: np.ndarray) -> np.ndarray:
    x, y, z = points.T
    flare = np.clip((0.98 - y) / 0.53, 0, 1)
    skirt = np.maximum((np.hypot(x, 1.15 * z) - 0.17 - 0.20 * flare) * 0.95, np.maximum(y - 1.0, 0.40 - y))
    tunic = [_limb_distance(points, limb) for limb in (TORSO, *UPPER_ARMS, *FOREARMS, *THIGHS)]
    low = np.clip((1.0 - y) / 0.5, 0, 1)
    folds = 0.030 * low * np.sin(9 * np.arctan2(z, x) + 3 * y)
    crumple = 0.009 * np.sin(23 * x + 5) * np.sin(19 * y) * np.sin(27 * z + 1)
    ease = 0.022 + 0.035 * np.clip((np.abs(x) - 0.18) / 0.4, 0, 1)
    return _smooth_minimum([*tunic, skirt], 0.045) - ease + folds + crumple


def _cut(field: Field, low: tuple, high: tuple, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """The zero surface of a field, by marching cubes, without double vertices."""
    axes = [np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
    z, y, x = np.meshgrid(*reversed(axes), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    positions, triangles = igl.marching_cubes(field(points), points, *(len(axis) for axis in axes), 0.0)[:2]
    positions, _, _, triangles = igl.remove_duplicate_vertices(positions, triangles, 1e-7)
    first, second, third = triangles.T
    return _largest_part(positions, triangles[(first != second) & (second != third) & (third != first)])


def _largest_part(positions: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    _, part, _ = igl.connected_components(igl.adjacency_matrix(triangles))
    triangles = triangles[part[triangles[:, 0]] == np.bincount(part).argmax()]
    used, renumbered = np.unique(triangles, return_inverse=True)
    return np.ascontiguousarray(positions[used]), np.ascontiguousarray(renumbered.reshape(-1, 3))


def _relax(field: Field, positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Even out the triangles along the surface; open boundaries stay where they are."""
    neighbours = igl.adjacency_matrix(triangles).astype(float)
    degree = np.asarray(neighbours.sum(axis=1))
    boundary = np.unique(igl.boundary_facets(triangles)[0])
    for _ in range(10):
        mean = neighbours @ positions / degree
        mean[boundary] = positions[boundary]
        positions = _project(field, (positions + mean) / 2, 1)
    return positions


def _project(field: Field, positions: np.ndarray, steps: int) -> np.ndarray:
    """Newton steps towards the zero surface, none longer than a centimetre."""
    reach = 1e-5
    for _ in range(steps):
        slope = np.stack([field(positions + reach * e) - field(positions - reach * e) for e in np.eye(3)], axis=1)
        slope /= 2 * reach
        length = np.maximum((slope**2).sum(axis=1), 1e-6)
        positions = positions - (np.clip(field(positions), -0.01, 0.01) / length)[:, None] * slope
    return positions


def _bone_weights(positions: np.ndarray, max_influences: int = 4) -> np.ndarray:
    """Smooth rows (V, 60) that fall off with the distance to each bone."""
    bones = [bone for limb in (*FLESH, *HIPS) for bone in _bones(limb)]
    distance = np.stack([_limb_distance(positions.astype(float), bone) for bone in bones], axis=1)
    nearest = distance.min(axis=1, keepdims=True)
    weights = np.exp(-1.2 * ((distance - nearest) / 0.05) ** 2) * (nearest / np.maximum(distance, 1e-9)) ** 4
    smallest_kept = np.sort(weights, axis=1)[:, -max_influences, None]
    weights[(weights < smallest_kept) | (weights < 1e-3)] = 0
    return (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)


def _bones(limb: Limb) -> list[Limb]:
    joints = np.linspace(limb.start, limb.end, limb.bones + 1).tolist()
    return [Limb(tuple(a), tuple(b), 0, 0, 1) for a, b in pairwise(joints)]
