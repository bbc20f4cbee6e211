"""A doll of overlapping tubes and its skeleton, whose joints are known; Z up, facing -Y, its left is +X."""

import numpy as np


def cylinder(around: int = 24, along: int = 40, height: float = 4.0) -> tuple[np.ndarray, np.ndarray]:
    """A closed cylinder of radius 0.5 about the z axis, irregular enough that no two vertices are alike."""
    random = np.random.default_rng(7)
    ring, spoke = np.divmod(np.arange(around * (along + 1)), around)
    angle = (spoke + 0.2 * random.random(len(spoke))) / around * 2 * np.pi
    z = np.clip(ring + 0.2 * (random.random(len(ring)) - 0.5), 0, along) / along * height
    positions = np.column_stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), z])
    positions = np.vstack([positions, [0, 0, 0], [0, 0, height]])
    corner = lambda r, s: r * around + s % around  # noqa: E731
    triangles = []
    for r in range(along):
        for s in range(around):
            a, b, c, d = corner(r, s), corner(r, s + 1), corner(r + 1, s + 1), corner(r + 1, s)
            triangles += [[a, b, c], [a, c, d]]
    bottom, top = len(positions) - 2, len(positions) - 1
    triangles += [[bottom, corner(0, s + 1), corner(0, s)] for s in range(around)]
    triangles += [[top, corner(along, s), corner(along, s + 1)] for s in range(around)]
    return positions.astype(np.float32), np.array(triangles)


def limb(start: list[float], end: list[float], radius: float) -> tuple[np.ndarray, np.ndarray]:
    """A closed tube from one point to another."""
    positions, triangles = cylinder(16, 24)
    start, end = np.array(start, float), np.array(end, float)
    along = (end - start) / np.linalg.norm(end - start)
    aside = np.cross(along, [0, 1, 0] if abs(along[1]) < 0.9 else [1, 0, 0])
    aside /= np.linalg.norm(aside)
    frame = np.stack([aside, np.cross(along, aside), along])
    local = positions * [2 * radius, 2 * radius, np.linalg.norm(end - start) / 4]
    return start + local @ frame, triangles


def figure(arm_length: float = 0.7, lift: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A doll of overlapping closed tubes, Z up, facing -Y: as an artist blocks one out."""
    parts = [limb([0, 0, 0.9], [0, 0, 1.5], 0.14), limb([0, 0, 1.45], [0, 0, 1.8], 0.09)]
    for side in (1, -1):
        parts.append(limb([0, 0, 1.4], [side * (0.15 + arm_length), 0, 1.4 + lift], 0.05))
        parts.append(limb([side * 0.1, 0, 0.95], [side * 0.14, 0, 0.0], 0.07))
    positions, triangles, start = [], [], 0
    for part, faces in parts:
        positions.append(part)
        triangles.append(faces + start)
        start += len(part)
    return np.vstack(positions).astype(np.float32), np.vstack(triangles)


NAMES = ["hips", "spine", "head", "arm.L", "fore.L", "arm.R", "fore.R", "leg.L", "shin.L", "leg.R", "shin.R"]
PARENTS = np.array([-1, 0, 1, 1, 3, 1, 5, 0, 7, 0, 9])


def skeleton(arm_length: float = 0.7, lift: float = 0.0) -> np.ndarray:
    """Heads and tails (B, 2, 3) for the figure."""
    bones = {
        "hips": ([0, 0, 0.95], [0, 0, 1.1]),
        "spine": ([0, 0, 1.1], [0, 0, 1.4]),
        "head": ([0, 0, 1.45], [0, 0, 1.8]),
    }
    for name, side in (("L", 1), ("R", -1)):
        joint = lambda share, s=side: [s * (0.15 + share * arm_length), 0, 1.4 + lift * (0.15 + share) / 1.15]  # noqa: E731
        knee = lambda share, s=side: [s * (0.1 + 0.04 * share), 0, 0.95 - 0.95 * share]  # noqa: E731
        bones[f"arm.{name}"] = (joint(0), joint(0.5))
        bones[f"fore.{name}"] = (joint(0.5), joint(1))
        bones[f"leg.{name}"] = (knee(0.05), knee(0.5))
        bones[f"shin.{name}"] = (knee(0.5), knee(1))
    return np.array([bones[name] for name in NAMES])
