"""Prints a SHA-256 of each of a list of results of the native module, to compare platforms: NumPy alone, no Blender.

The meshes are made by additions and multiplications of seeded random numbers, so that every platform starts from the
same bits; no sine of some system's library takes part.
"""

from __future__ import annotations

import hashlib
import io
import sys
from typing import Any, cast

import numpy as np
import skinwright_native as skinwright


def main() -> None:
    """One line per result: name, digest."""
    cast(io.TextIOWrapper, sys.stdout).reconfigure(encoding="utf-8", newline="\n")
    for name, arrays in results():
        digest = hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays))
        print(name, digest.hexdigest())


def results():
    """(name, arrays) of every kind of calculation over sizes and settings."""
    for n in (12, 60, 150):
        body_positions, body_triangles = surface(n, 0.0, seed=n)
        body_weights = skinwright.Weights.from_dense(rows(body_positions, n_bones=9))
        source = skinwright.Source(body_positions, body_triangles, body_weights)
        positions, triangles = surface(n + 7, 0.02, seed=n + 1)
        for name, settings in SETTINGS.items():
            transfer = source.transfer(positions, triangles, **settings)
            yield f"transfer {n} {name}", [*parts(transfer.weights), transfer.matched, transfer.distance]
        yield (
            f"desparsify {n}",
            parts(skinwright.desparsify(body_weights, np.arange(-1, 8, dtype=np.int32), method="hop")),
        )
        yield f"sculpt {n}", sculpted(body_positions, body_weights)
        yield f"fill {n}", [filled(positions, triangles)]
    for method in ("heat", "geodesic", "euclidean"):
        yield f"automatic weights {method}", automatic(body_positions, body_triangles, method)
    yield "refine", [refined(body_positions, body_triangles, body_weights)]


SETTINGS = {
    "default": {},
    "harmonic": {"smoothness_length": 0.0},
    "smoothed": {"smoothing_iterations": 3},
    "limited": {"max_influences": 2},
    "confidence": {"method": "confidence"},
    "tight": {"relative_max_distance": 0.02, "max_normal_angle": 0.4},
}


def surface(n: int, height: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A bumpy square of n x n vertices, some of it too far away to match."""
    random = np.random.default_rng(seed)
    step = np.float32(1.0 / (n - 1))
    x, y = (axis.ravel().astype(np.float32) * step for axis in np.meshgrid(np.arange(n), np.arange(n)))
    jitter = random.random((3, n * n), dtype=np.float32) * step * np.float32(0.2)
    bump = x * (1 - x) * y * (1 - y)
    z = bump + np.float32(height) + jitter[2] * np.float32(0.1) + (x > np.float32(0.6)) * bump * np.float32(height * 20)
    positions = np.stack([x + jitter[0], y + jitter[1], z], axis=1).astype(np.float32)
    first = (np.arange(n - 1)[None] + n * np.arange(n - 1)[:, None]).ravel()
    quads = np.stack([first, first + 1, first + n + 1, first + n], axis=1)
    return positions, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.uint32)


def rows(positions: np.ndarray, n_bones: int) -> np.ndarray:
    """(V, n_bones) weights that fall off along x; made in f32 by single operations."""
    centres = np.arange(n_bones, dtype=np.float32) / np.float32(n_bones - 1)
    reach = np.float32(1.5 / n_bones)
    near = np.maximum(np.float32(0), 1 - np.abs(positions[:, :1] - centres) / reach)
    return near / near.sum(axis=1, keepdims=True, dtype=np.float32)


def parts(weights) -> list[np.ndarray]:
    """The arrays of weights."""
    return [weights.indptr, weights.bones, weights.values]


def sculpted(positions: np.ndarray, weights) -> list[np.ndarray]:
    """Rows after one stroke in a pose of shears."""
    pose = np.tile(np.eye(4), (9, 1, 1))
    pose[:, 2, 0] = np.arange(9) / 16
    solver = skinwright.SculptSolver(positions, weights)
    solver.add_pose(pose)
    touched = np.flatnonzero(positions[:, 0] > 0.4).astype(np.uint32)
    targets = solver.posed(touched, positions[touched]) + np.float32(0.01)
    stroke = solver.stroke(touched, targets)
    return [*parts(stroke.weights), stroke.residuals]


def filled(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Three columns that are known on a seventh of the vertices, some of them softly."""
    known = np.arange(len(positions)) % 7 == 0
    kinds = np.where(known, 1 + (np.arange(len(positions)) % 14 == 0), 0).astype(np.uint8)
    confidence = np.where(kinds == 2, np.float32(0.5), np.float32(0))
    return skinwright.fill(positions, triangles, kinds, positions, confidence=confidence, length=0.1)


def bones(n_bones: int) -> tuple[np.ndarray, np.ndarray]:
    """Segments (B, 2, 3) of a chain along x below the surface, and the parent of each."""
    joints = np.zeros((n_bones + 1, 3))
    joints[:, 0], joints[:, 1], joints[:, 2] = np.arange(n_bones + 1) / n_bones, 0.5, -0.125
    return np.stack([joints[:-1], joints[1:]], axis=1), np.arange(n_bones) - 1


def automatic(positions: np.ndarray, triangles: np.ndarray, method: Any) -> list[np.ndarray]:
    """Rows from scratch."""
    return parts(skinwright.automatic_weights(positions, triangles, *bones(4), method=method).weights)


def refined(positions: np.ndarray, triangles: np.ndarray, weights: skinwright.Weights) -> np.ndarray:
    """Positions in a pose of shears."""
    segments, parents = bones(9)
    pose = np.tile(np.eye(4), (9, 1, 1))
    pose[:, 2, 0] = np.arange(9) / 16
    return skinwright.Refiner(positions, triangles, weights, parents, segments).solve(pose)


if __name__ == "__main__":
    main()
