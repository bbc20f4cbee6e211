"""Which bones are a person's limbs, by the names that the usual rigs give them."""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scene import sides
from ..scene.skeleton import Skeleton

# Tried in this order on the name without its side: the more special words come first.
_ROLES = {
    "foot": r"foot|ankle|足首|toe|つま先",
    "shin": r"shin|calf|lower_?-?leg|leg_?lower|knee|ひざ",
    "thigh": r"thigh|up_?-?leg|upper_?-?leg|leg_?upper|femur|足",
    "leg": r"leg",  # the shin if another bone is the thigh
    "hand": r"hand|wrist|手首|palm|finger|thumb|index|middle|ring|pinky|指",
    "forearm": r"fore_?-?arm|lower_?-?arm|arm_?lower|elbow|ひじ",
    "shoulder": r"clavicle|collar|shoulder|肩",
    "upper_arm": r"upper_?-?arm|arm_?upper|shldr|(?<!fore)arm|腕",
    "head": r"head|頭|neck|首|jaw|eye",
    "trunk": r"spine|chest|torso|abdomen|waist|上半身",
}
_LIMBS = ("thigh", "shin", "upper_arm", "forearm")
_FRAME = re.compile(
    r"(?<![A-Za-z])(?:left|right|[LRlr])(?![A-Za-z])|Left|Right|^[lr](?=[A-Z])|(?<=[a-z0-9])[LR]$|[左右]"
)


@dataclass(frozen=True)
class BodyPlan:
    """`limbs` has the topmost bone of each (role, side); `frame` (3, 3) has columns left, forward, up in the world."""

    skeleton: Skeleton
    limbs: dict[tuple[str, str], int]
    trunk: list[int]
    frame: NDArray[np.float64]

    def world(self, vector: tuple[float, ...]) -> NDArray[np.float64]:
        """A vector of the character's frame in the world."""
        return self.frame @ np.array(vector, np.float64)

    def tip(self, bone: int) -> NDArray[np.float64]:
        """Where a limb leads: the next limb's head, else the bone's own tail."""
        role, side = next((key for key, number in self.limbs.items() if number == bone), ("", ""))
        following = {"thigh": "shin", "upper_arm": "forearm"}.get(role)
        child = self.limbs.get((following, side)) if following else None
        return self.skeleton.tails[bone] if child is None else self.skeleton.heads[child]


def find(skeleton: Skeleton) -> BodyPlan:
    """The plan of a skeleton; without limbs where the names say nothing."""
    limbs: dict[tuple[str, str], int] = {}
    trunk: list[int] = []
    for number, name in enumerate(skeleton.names):
        role, side = role_of(name), side_of(name)
        if role == "leg":
            role = "shin" if ("thigh", side) in limbs else "thigh"
        if role in _LIMBS and side:
            limbs.setdefault((role, side), number)  # parents come first
        elif role == "trunk" and not side:
            trunk.append(number)
    limbs = {key: bone for key, bone in limbs.items() if (key[0], "R" if key[1] == "L" else "L") in limbs}
    return BodyPlan(skeleton, limbs, trunk, _frame(skeleton, limbs))


def role_of(name: str) -> str:
    """The part of the body a bone's name tells of, or nothing."""
    plain = re.sub(r"^(?:DEF|ORG|MCH)-|^.*:|^(?:J_Bip|CC_Base|Bip\d+|ValveBiped\.Bip\d+)[_ ]", "", name)
    plain = _FRAME.sub("", plain).lower().replace(" ", "_")
    return next((role for role, words in _ROLES.items() if re.search(words, plain)), "")


def side_of(name: str) -> str:
    """L, R, or nothing in the middle."""
    if next(sides.spellings(name), None) is None:
        return ""
    found = _FRAME.search(re.sub(r"^(?:DEF|ORG|MCH)-|^.*:", "", name))
    if not found:
        return ""
    return "L" if found[0].lower() in ("l", "left", "左") else "R"


def _frame(skeleton: Skeleton, limbs: dict[tuple[str, str], int]) -> NDArray[np.float64]:
    """Up is up in the world; left leads from the right limb to the left one."""
    up = np.array([0.0, 0, 1])
    pair = next((role for role in ("thigh", "upper_arm") if (role, "L") in limbs), None)
    left = np.array([1.0, 0, 0])
    if pair:
        left = skeleton.heads[limbs[pair, "L"]] - skeleton.heads[limbs[pair, "R"]]
        left = left - (left @ up) * up
    length = float(np.linalg.norm(left))
    left = left / length if length > 1e-9 else np.array([1.0, 0, 0])
    return np.stack([left, np.cross(left, up), up], axis=1)
