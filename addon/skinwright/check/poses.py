"""Test poses computed from the deform bones themselves: no constraint can overrule them. Numpy, world space."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scene.skeleton import Skeleton
from .body_plan import BodyPlan

Rotations = dict[int, NDArray[np.float64]]


@dataclass(frozen=True)
class TestPose:
    """`pose_from_rest` (B, 4, 4) in the world."""

    name: str
    pose_from_rest: NDArray[np.float64]


def range_of_motion(skeleton: Skeleton, used: list[int], angle: float) -> Iterator[TestPose]:
    """Bend and twist the used bones by `angle` (radians), those equally deep in the hierarchy together.

    The axes follow from the direction of each bone, not from its roll: figures of one build are bent alike.
    """
    levels: dict[int, list[int]] = {}
    for bone in used:
        levels.setdefault(_depth(skeleton, bone, set(used)), []).append(bone)
    for level in sorted(levels):
        for name, sign in (("X", 1), ("X", -1), ("Z", 1), ("Z", -1), ("Y", 1)):
            turned = {bone: rotation(axes(skeleton, bone)[name], sign * angle) for bone in levels[level]}
            label = f"level {level + 1} of the bones, {sign * math.degrees(angle):+.0f}° about {name}"
            yield TestPose(label, posed(skeleton, turned))


def _depth(skeleton: Skeleton, bone: int, used: set[int]) -> int:
    depth, above = 0, int(skeleton.parents[bone])
    while above >= 0:
        depth += above in used
        above = int(skeleton.parents[above])
    return depth


def axes(skeleton: Skeleton, bone: int) -> dict[str, NDArray[np.float64]]:
    """Unit vectors (3,): Y along the bone, X and Z across it."""
    y = unit(skeleton.tails[bone] - skeleton.heads[bone])
    across = np.eye(3)[int(np.argmin(np.round(np.abs(y), 3)))]
    x = unit(np.cross(y, across))
    return {"X": x, "Y": y, "Z": np.cross(x, y)}


def posed(skeleton: Skeleton, turned: Rotations) -> NDArray[np.float64]:
    """(B, 4, 4): the bones turned about their heads (3, 3), each with all that hangs on it."""
    matrices = np.empty((len(skeleton.names), 4, 4))
    for bone, parent in enumerate(skeleton.parents.tolist()):
        matrix = np.eye(4) if parent < 0 else matrices[parent]
        if bone in turned:
            matrix = matrix @ about(turned[bone], skeleton.heads[bone])
        matrices[bone] = matrix
    return matrices


def about(turn: NDArray[np.float64], centre: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4, 4) a rotation (3, 3) about a point (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3] = turn
    matrix[:3, 3] = centre - turn @ centre
    return matrix


def rotation(axis: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """(3, 3) by an angle (radians) about a unit vector (3,): Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same of length 1."""
    return vector / max(float(np.linalg.norm(vector)), 1e-30)


def _onto(direction: NDArray[np.float64], goal: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) the shortest rotation of one unit vector onto another."""
    axis = np.cross(direction, goal)
    sine, cosine = float(np.linalg.norm(axis)), float(direction @ goal)
    if sine < 1e-9:
        if cosine > 0:
            return np.eye(3)
        axis = np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))])
    return rotation(unit(axis), math.atan2(sine, cosine))


# What each pose does, in the character's frame: left, forward, up. A limb's direction is given for its left side and
# mirrored for the right; a trunk bone turns by degrees about an axis.
_LEFT_RIGHT_AIMS: dict[str, dict[str, tuple[float, float, float]]] = {
    "arms up": {"upper_arm": (0.3, 0, 1), "forearm": (0.1, 0, 1)},
    "arms down": {"upper_arm": (0.15, 0, -1), "forearm": (0.1, 0.2, -1)},
    "arms forward": {"upper_arm": (0.15, 1, 0.1), "forearm": (0.1, 1, 0.2)},
    "arms crossed": {"upper_arm": (-0.1, 0.8, -0.6), "forearm": (-1, 0.35, 0.1)},
    "sit": {"thigh": (0.2, 1, -0.05), "shin": (0.1, 0, -1)},
    "squat": {"thigh": (0.5, 1, 0.3), "shin": (0.2, -0.5, -1), "upper_arm": (0.2, 1, 0)},
    "legs apart": {"thigh": (1, 0.1, -1), "shin": (1, 0, -1)},
}
_ONE_SIDED_AIMS: dict[str, dict[str, tuple[float, float, float]]] = {
    "stride": {
        "thigh.L": (0, 0.7, -1),
        "shin.L": (0, 0.4, -1),
        "thigh.R": (0, -0.5, -1),
        "shin.R": (0, -1, -0.8),
        "upper_arm.L": (0.3, -0.6, -1),
        "upper_arm.R": (-0.3, 0.6, -1),
    },
    "legs crossed": {"thigh.L": (-0.5, 0.8, -0.6), "shin.L": (-0.2, 0, -1), "thigh.R": (-0.1, 1, -0.1)},
    "one leg lifted": {"thigh.L": (0.1, 1, 0.2), "shin.L": (0, 0.2, -1)},
}
_TRUNK: dict[str, tuple[tuple[float, float, float], float]] = {
    "twist": ((0, 0, 1), 60),
    "bend forward": ((-1, 0, 0), 70),
    "bend sideways": ((0, 1, 0), 40),
}


def whole_body(skeleton: Skeleton, plan: BodyPlan) -> Iterator[TestPose]:
    """Poses a person takes, for the limbs that the plan knows."""
    for name, aims in (_LEFT_RIGHT_AIMS | _ONE_SIDED_AIMS).items():
        goals = {bone: goal for limb, aim in aims.items() for bone, goal in _goals(plan, limb, aim)}
        if goals:
            yield TestPose(name, _aimed(skeleton, plan, goals))
    for name, (axis, degrees) in _TRUNK.items():
        if plan.trunk:
            share = math.radians(degrees) / len(plan.trunk)
            yield TestPose(name, posed(skeleton, dict.fromkeys(plan.trunk, rotation(plan.world(axis), share))))


def _goals(plan: BodyPlan, limb: str, aim: tuple[float, float, float]) -> Iterator[tuple[int, NDArray[np.float64]]]:
    role, _, side = limb.partition(".")
    for letter in side or "LR":
        if (role, letter) in plan.limbs:
            mirrored = -1 if letter == "R" and not side else 1
            yield plan.limbs[role, letter], unit(plan.world((mirrored * aim[0], *aim[1:])))


def _aimed(skeleton: Skeleton, plan: BodyPlan, goals: Rotations) -> NDArray[np.float64]:
    """Turn bones so that they point to their goals (3,), parents first."""
    turned: Rotations = {}
    for bone in sorted(goals):
        now = posed(skeleton, turned)[bone]
        direction = unit(now[:3, :3] @ (plan.tip(bone) - skeleton.heads[bone]))
        # What turns the bone as it now is, told in the frame it has at rest.
        turned[bone] = now[:3, :3].T @ _onto(direction, goals[bone]) @ now[:3, :3]
    return posed(skeleton, turned)
