"""Test poses that mean the same on every rig, and linear blend skinning.

A pose names what each canonical bone does: "aim" turns it until it points along a world direction, "rot" turns it
about a world axis by degrees, "twist" turns it about the line from the joint before it. Parents come first.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .characters import Skeleton


@dataclass(frozen=True)
class Poses:
    """The poses of a data folder's poses.json."""

    poses: dict[str, dict[str, list[Any]]]
    bone_names: dict[str, dict[str, str]]
    next_joint: dict[str, str]
    previous_joint: dict[str, str]

    @classmethod
    def read(cls, folder: Path) -> Poses:
        entries = json.loads((folder / "poses.json").read_text())
        return cls(*(entries[name] for name in ("poses", "bone_names", "next_joint", "previous_joint")))

    def joints(self, skeleton: Skeleton, rig: str) -> dict[str, int]:
        """The bone of each canonical name, as far as the rig has it."""
        found = {}
        for joint, names in self.bone_names[rig].items():
            present = [name for name in names.split("|") if name in skeleton.names]
            if present:
                found[joint] = skeleton.names.index(present[0])
        return found

    def pose_from_rest(self, skeleton: Skeleton, rig: str) -> np.ndarray:
        """World transforms of all bones in all poses (P, B, 4, 4)."""
        joints = self.joints(skeleton, rig)
        return np.stack([self._one(skeleton, joints, pose) for pose in self.poses.values()])

    def _one(self, skeleton: Skeleton, joints: dict[str, int], pose: dict[str, list[Any]]) -> np.ndarray:
        canonical = {bone: joint for joint, bone in joints.items()}
        transforms = np.tile(np.eye(4), (len(skeleton.names), 1, 1))
        for bone in _parents_first(skeleton.parents):
            parent = skeleton.parents[bone]
            carried = transforms[parent] if parent >= 0 else np.eye(4)
            joint = canonical.get(bone)
            if joint in pose:
                turn = self._turn(skeleton, joints, joint, pose[joint], carried[:3, :3])
                head = carried[:3, :3] @ skeleton.heads[bone] + carried[:3, 3]
                about = np.eye(4)
                about[:3, :3], about[:3, 3] = turn, head - turn @ head
                carried = about @ carried
            transforms[bone] = carried
        return transforms

    def _turn(self, skeleton: Skeleton, joints: dict[str, int], joint: str, act: list[Any], carried) -> np.ndarray:
        head = skeleton.heads[joints[joint]]
        if act[0] == "rot":
            return _about(np.array(act[1], float), act[2])
        limb, side = joint.rsplit("_", 1)
        if act[0] == "twist":
            before = skeleton.heads[joints[f"{self.previous_joint[limb]}_{side}"]]
            return _about(carried @ (head - before), act[1])
        tip = skeleton.heads[joints[f"{self.next_joint[limb]}_{side}"]]
        return _between(carried @ (tip - head), np.array(act[1], float))


def skinned(positions: np.ndarray, weights: np.ndarray, pose_from_rest: np.ndarray) -> np.ndarray:
    """Positions in all poses (P, V, 3) by linear blend skinning with dense weights (V, B)."""
    n_poses, n_bones = pose_from_rest.shape[:2]
    flat = pose_from_rest[:, :, :3, :].transpose(1, 0, 2, 3).reshape(n_bones, -1)
    blended = (weights @ flat).reshape(len(positions), n_poses, 3, 4)
    posed = np.einsum("vpij,vj->pvi", blended[..., :3], positions)
    return posed + blended[..., 3].transpose(1, 0, 2)


def _parents_first(parents: list[int]) -> list[int]:
    def depth(bone: int) -> int:
        return 0 if bone < 0 else 1 + depth(parents[bone])

    return sorted(range(len(parents)), key=depth)


def _about(axis: np.ndarray, degrees: float) -> np.ndarray:
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The smallest turn from one direction to the other."""
    start, end = start / np.linalg.norm(start), end / np.linalg.norm(end)
    axis = np.cross(start, end)
    sine = np.linalg.norm(axis)
    if sine > 1e-9:
        return _about(axis, np.degrees(np.arctan2(sine, start @ end)))
    across = [0, 1, 0] if abs(start[1]) < 0.9 else [1, 0, 0]
    return np.eye(3) if start @ end > 0 else _about(np.cross(start, across), 180)
