"""Which bone is which one's opposite: by the naming of the usual rigs, else by mirrored positions."""

import re
from collections.abc import Iterable, Iterator

import bpy
import numpy as np
from numpy.typing import NDArray

_OPPOSITE = {"l": "r", "L": "R", "left": "right", "Left": "Right", "LEFT": "RIGHT", "左": "右"}
_OPPOSITE |= {right: left for left, right in _OPPOSITE.items()}
_PATTERNS = tuple(
    re.compile(pattern)
    for pattern in (
        r"(?<![A-Za-z0-9])[LRlr](?![A-Za-z0-9])",  # J_Bip_L_UpperLeg, CC_Base_L_Thigh, Bip001 L Thigh
        r"(?<![A-Z])(?:Left|Right)(?![a-z])",  # mixamorig:LeftUpLeg
        r"(?<![A-Za-z])(?:left|right|LEFT|RIGHT)(?![A-Za-z])",  # leg left thigh
        r"[左右]",  # 左足
        r"(?:(?<=^)|(?<=[^A-Za-z0-9]))[lr](?=[A-Z])",  # lThighBend
        r"(?<=[a-z0-9])[LR]$",  # UpperArmL
    )
)
# Two bones mirror each other if their ends do to this part of the armature's size.
_TOLERANCE = 1e-3


def opposites(armature: bpy.types.Object | None, names: Iterable[str]) -> dict[str, str]:
    """For each name that of the other side's bone, itself in the middle; only names that have an opposite or none.

    Without an armature the names themselves are what there is to choose from.
    """
    names = list(names)
    known = set(names) if armature is None else {*names, *armature.data.bones.keys()}
    found = {name: next((other for other in spellings(name) if other in known), name) for name in names}
    alone = [name for name in names if found[name] == name]
    if armature is not None and alone:
        found |= _by_position(armature, alone)
    return found


def spellings(name: str) -> Iterator[str]:
    """What the other side's bone may be called: as Blender flips names, then by the naming of other programs."""
    flipped = bpy.utils.flip_name(name)
    if flipped != name:
        yield flipped
    for pattern in _PATTERNS:
        other = pattern.sub(lambda match: _OPPOSITE[match[0]], name, count=1)
        if other != name:
            yield other


def _by_position(armature: bpy.types.Object, names: list[str]) -> dict[str, str]:
    """The bone whose ends are mirrored in the armature's X; of several that are, none."""
    bones = armature.data.bones
    ends = np.array([(*bone.head_local, *bone.tail_local) for bone in bones]).reshape(-1, 6)
    size = float(np.linalg.norm(np.ptp(ends.reshape(-1, 3), axis=0)))
    index = {name: i for i, name in enumerate(bones.keys())}
    found = {}
    for name in (name for name in names if name in index):
        mirrored = ends[index[name]] * (-1, 1, 1, -1, 1, 1)
        near = np.flatnonzero(np.abs(ends - mirrored).max(axis=1) < _TOLERANCE * size)
        if len(near) == 1:
            found[name] = bones[int(near[0])].name
    return found


def exchanged(armature: bpy.types.Object | None, opposite: dict[str, str], world: NDArray[np.float64]) -> bool | None:
    """Whether the reflection `world` (4, 4) exchanges left and right; None where bones do not tell."""
    bones = armature.data.bones if armature else {}
    pairs = [(bones[n], bones[o]) for n, o in opposite.items() if o != n and n in bones and o in bones]
    if armature is None or not pairs:
        return None
    place = np.array(armature.matrix_world)
    here, there = (np.array([(*b[k].head_local, 1, *b[k].tail_local, 1) for b in pairs]) for k in (0, 1))
    here, there = (ends.reshape(-1, 4) @ place.T for ends in (here, there))
    reflected = here @ world.T
    off = np.linalg.norm(reflected - there, axis=1).sum(), np.linalg.norm(reflected - here, axis=1).sum()
    return None if np.isclose(*off, rtol=1e-6) else bool(off[0] < off[1])


def unflippable(opposite: dict[str, str]) -> str:
    """The first name whose opposite Blender's mirroring does not find, or nothing."""
    return next((name for name, other in opposite.items() if other != name and bpy.utils.flip_name(name) != other), "")
