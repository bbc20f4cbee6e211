"""Poses of one joint: bent about its two axes and twisted, by several angles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .character import Character
from .params import CorrectiveParams

# Axis of the bone, sign: what a joint can do. Y runs along the bone.
BENDS = (("X", 1), ("X", -1), ("Z", 1), ("Z", -1))
TWISTS = (("Y", 1), ("Y", -1))
_AXES = {"X": 0, "Y": 1, "Z": 2}


@dataclass(frozen=True)
class Sample:
    """Bone `bone` turned about its own `axis`; `angles` are those of all samples of this direction, `k` which it is."""

    bone: int
    axis: str
    sign: int
    angles: tuple[float, ...]
    k: int

    @property
    def angle(self) -> float:
        """Radians, positive."""
        return self.angles[self.k]

    def rotation(self, character: Character) -> NDArray[np.float64]:
        """(3, 3) about the joint, in the mesh's space."""
        direction = character.rest_bones[self.bone, :3, _AXES[self.axis]]
        return rotation(direction / np.linalg.norm(direction), self.sign * self.angle)

    def pose(self, character: Character) -> NDArray[np.float64]:
        """(B, 4, 4) with this joint alone turned."""
        turned = np.eye(4)
        turned[:3, :3] = self.rotation(character)
        head = character.segments[self.bone, 0].astype(np.float64)
        turned[:3, 3] = head - turned[:3, :3] @ head
        return np.where(below(character, self.bone)[:, None, None], turned, np.eye(4))


Limits = dict[str, tuple[float, float]]
# Joints that can turn by less than this (radians) in a direction are not sampled in it.
_LEAST = np.radians(10)


def samples(bones: list[int], params: CorrectiveParams, limits: list[Limits]) -> list[Sample]:
    """Every pose that is solved, direction by direction, as far as each bone's limits go."""
    steps = np.arange(1, params.samples + 1, dtype=np.int64) / params.samples
    found = []
    for bone, limit in zip(bones, limits, strict=True):
        for axis, sign in (*BENDS, *TWISTS):
            low, high = limit[axis]
            most = min(params.twist if axis == "Y" else params.angle, high if sign > 0 else -low)
            if most >= _LEAST:
                angles = tuple(float(x) for x in steps * most)
                found += [Sample(bone, axis, sign, angles, k) for k in range(params.samples)]
    return found


def below(character: Character, bone: int) -> NDArray[np.bool_]:
    """(B,) the bone and all that hang from it."""
    found = np.zeros(len(character.bones), bool)
    for j in range(len(character.bones)):
        at = j
        while at >= 0 and at != bone:
            at = int(character.parents[at])
        found[j] = at == bone
    return found


def rotation(axis: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """(3, 3) about a unit axis."""
    x, y, z = axis
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew


def joints(character: Character, chosen: set[str]) -> list[int]:
    """The bones with a parent that skin follows; only the chosen ones if any are."""
    used = np.unique(character.rows.bones[character.rows.values > 0])
    bones = [j for j in range(len(character.bones)) if character.parents[j] >= 0 and j in used]
    return [j for j in bones if not chosen or character.bones[j] in chosen]
