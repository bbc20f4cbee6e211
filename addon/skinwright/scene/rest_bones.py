"""Bones at rest in the world: frames, lengths, names."""

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from . import armature, mesh

# How far from its meshes' box a bone may lie, as a part of the box's diagonal.
_MARGIN = 0.2


@dataclass(frozen=True)
class RestBones:
    """Bones (B): frames (B, 4, 4) with the bone along +Y and lengths (B,) in world units, parents (B,), -1 for none."""

    names: list[str]
    frames: NDArray[np.float64]
    lengths: NDArray[np.float64]
    parents: NDArray[np.int32]

    @property
    def heads(self) -> NDArray[np.float64]:
        """(B, 3)."""
        return self.frames[:, :3, 3]

    @property
    def tails(self) -> NDArray[np.float64]:
        """(B, 3)."""
        return self.heads + self.frames[:, :3, 1] * self.lengths[:, None]


def read(rig: bpy.types.Object, names: Sequence[str]) -> RestBones:
    """The bones of these names as the armature rests now, where its object stands. Raises SceneError if it is flat."""
    mesh.check_world(rig)
    world = np.array(rig.matrix_world, np.float64)
    local = np.array([rig.data.bones[name].matrix_local for name in names], np.float64).reshape(-1, 4, 4)
    frames = world @ local
    scale = np.linalg.norm(frames[:, :3, 1], axis=1)
    own = np.array([rig.data.bones[name].length for name in names], np.float64)
    frames[:, :3, :3] /= np.maximum(np.linalg.norm(frames[:, :3, :3], axis=1, keepdims=True), 1e-30)
    return RestBones(list(names), frames, own * scale, armature.parents(rig, names))


def meshes(rig: bpy.types.Object, scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The scene's meshes that an armature deforms, by name."""
    found = [obj for obj in scene.objects if obj.type == "MESH" and armature.find(obj) == rig]
    return sorted(found, key=lambda obj: obj.name)


def visible(
    meshes: Sequence[bpy.types.Object], picked: bpy.types.Object
) -> tuple[list[bpy.types.Object], list[bpy.types.Object]]:
    """Those of a character's meshes that can be seen or were picked, and the others: levels of detail, collision hulls,
    older versions. If none can be seen, all count."""
    seen = [obj for obj in meshes if obj.visible_get() or obj == picked]
    return (seen, [obj for obj in meshes if obj not in seen]) if seen else (list(meshes), [])


def left_out_of(rig: bpy.types.Object, meshes: Sequence[bpy.types.Object]) -> str:
    """What to say of hidden meshes that took no part."""
    names = ", ".join(obj.name for obj in meshes[:8]) + (", ..." if len(meshes) > 8 else "")
    return f"Hidden meshes on {rig.name} took no part in its shape and weights: {names}; show those that should"


def misfit(rig: bpy.types.Object, bones: RestBones, positions: NDArray[np.float32]) -> str:
    """A sentence where most bones lie outside of the box around their meshes' points (V, 3): one of both was scaled or
    moved without the other."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    margin = _MARGIN * float(np.linalg.norm(high - low))
    middles = (bones.heads + bones.tails) / 2
    outside = ((middles < low - margin) | (middles > high + margin)).any(axis=1)
    if outside.mean() <= 0.5:
        return ""
    return (
        f"{int(outside.sum())} of {len(outside)} bones of {rig.name} lie far from the meshes on it: are scale and "
        "place of both as they should be?"
    )
