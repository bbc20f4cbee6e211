"""The deform bones as a hierarchy of their own, whatever constraints tie them to controls."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

_FOLLOWING = {"ARMATURE", "CHILD_OF", "COPY_LOCATION", "COPY_ROTATION", "COPY_TRANSFORMS"}
# Of the armature's size: what still counts as touching.
_TOUCHING = 1e-3


@dataclass(frozen=True)
class Skeleton:
    """`parents` (B,) number the bone that carries each, -1 at a root; `heads` and `tails` (B, 3) at rest in the world.

    Parents come before their children.
    """

    names: list[str]
    parents: NDArray[np.int32]
    heads: NDArray[np.float64]
    tails: NDArray[np.float64]


def read(rigs: Sequence[bpy.types.Object]) -> Skeleton:
    """The deform bones of these armatures; of two bones with one name the first counts."""
    parent: dict[str, str] = {}
    ends: dict[str, tuple] = {}
    for rig in rigs:
        carriers = _carriers(rig)
        for name, carrier in carriers.items():
            if name in ends:
                continue
            parent[name] = carrier
            bone = rig.data.bones[name]
            ends[name] = (rig.matrix_world @ bone.head_local, rig.matrix_world @ bone.tail_local)
    names = _parents_first(parent)
    number = {name: i for i, name in enumerate(names)}
    positions = np.array([ends[name] for name in names], np.float64).reshape(-1, 2, 3)
    parents = np.array([number.get(parent[name], -1) for name in names], np.int32)
    return Skeleton(names, parents, positions[:, 0], positions[:, 1])


def _parents_first(parent: dict[str, str]) -> list[str]:
    found: dict[str, None] = {}
    for name in parent:
        chain = [name]
        while parent.get(chain[-1]) and parent[chain[-1]] not in chain:
            chain.append(parent[chain[-1]])
        found |= dict.fromkeys(reversed(chain))
    return list(found)


def _carriers(rig: bpy.types.Object) -> dict[str, str]:
    """The deform bone that each deform bone hangs on, or nothing.

    In generated and copied rigs deform bones hang on, or follow, bones that only control: then it is the deform bone
    that follows such a control or lies on it, or else the one whose tail the bone starts from.
    """
    bones = rig.data.bones
    deforming = [bone for bone in bones if bone.use_deform]
    if not deforming:
        return {}
    heads, tails = (np.array([getattr(b, end) for b in deforming]) for end in ("head_local", "tail_local"))
    touching = _TOUCHING * float(np.linalg.norm(np.ptp(np.concatenate([heads, tails]), axis=0)))
    leaders = {bone.name: _leader(rig.pose.bones[bone.name]) for bone in deforming}
    followers = {leader: name for name, leader in leaders.items() if leader}
    found: dict[str, str] = {}
    for number, bone in enumerate(deforming):
        below = {bone.name} | {child.name for child in bone.children_recursive}
        candidates = [
            *_above(bone, rig, followers, deforming, heads, tails, number, touching),
            *_above(leaders[bone.name], rig, followers, deforming, heads, tails, number, touching),
            *(_before(deforming, heads, tails, number, touching) if bone.parent or leaders[bone.name] else ()),
        ]
        good = (name for name in candidates if name not in below and not _hangs_on(found, name, bone.name))
        found[bone.name] = next(good, "")
    return found


def _leader(bone: bpy.types.PoseBone) -> bpy.types.Bone | None:
    """The bone that a constraint makes this one follow."""
    for constraint in bone.constraints:
        if constraint.mute or constraint.type not in _FOLLOWING:
            continue
        targets = constraint.targets if constraint.type == "ARMATURE" else [constraint]
        for target in targets:
            if target.target and target.target.type == "ARMATURE" and target.subtarget in target.target.data.bones:
                return target.target.data.bones[target.subtarget]
    return None


def _above(
    bone: bpy.types.Bone | None,
    rig: bpy.types.Object,
    followers: dict[bpy.types.Bone, str],
    deforming: list[bpy.types.Bone],
    heads: NDArray,
    tails: NDArray,
    number: int,
    touching: float,
) -> Iterator[str]:
    """The deform bones that are above a bone, that follow one above, or that lie on one above."""
    for ancestor in bone.parent_recursive if bone else ():
        mine = ancestor.id_data == rig.data
        if mine and ancestor.use_deform:
            yield ancestor.name
        if ancestor in followers:
            yield followers[ancestor]
        if mine:
            on_it = (_distance(heads, ancestor) <= touching) & (_distance(tails, ancestor) <= touching)
            ends = (np.linalg.norm(points - heads[number], axis=1) for points in (heads, tails))
            gap = np.minimum(*ends)
            order = np.flatnonzero(on_it)[np.argsort(gap[on_it], kind="stable")]
            yield from (deforming[i].name for i in order.tolist())


def _before(
    deforming: list[bpy.types.Bone], heads: NDArray, tails: NDArray, number: int, touching: float
) -> Iterator[str]:
    """The deform bones whose tail is where this one starts."""
    gap = np.linalg.norm(tails - heads[number], axis=1)
    yield from (deforming[i].name for i in np.argsort(gap, kind="stable").tolist() if gap[i] <= touching)


def _hangs_on(carriers: dict[str, str], name: str, above: str) -> bool:
    """Whether `name` hangs on `above`, as far as is known."""
    while name:
        if name == above:
            return True
        name = carriers.get(name, "")
    return False


def _distance(points: NDArray, bone: bpy.types.Bone) -> NDArray:
    """(n,) from points (n, 3) to a bone."""
    head, along = np.array(bone.head_local), np.array(bone.tail_local) - np.array(bone.head_local)
    share = np.clip((points - head) @ along / max(float(along @ along), 1e-30), 0, 1)
    return np.linalg.norm(points - head - share[:, None] * along, axis=1)
