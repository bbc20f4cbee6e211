"""Names that shift a limb by a bone: one rig's leg is the thigh, the other's the shin."""

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from ..scene.rest_bones import RestBones
from . import bone_names


def shifted(
    source: RestBones,
    target: RestBones,
    partner: Mapping[str, str],
    given: Collection[str],
    places: tuple[NDArray, NDArray],
) -> dict[str, str]:
    """Partners by the order of chains where those by name, in `partner`, skip a bone of one rig above and one of the
    other below, and the order fits the places (B, 6) of both better. Those of the bones `given` stay."""
    found: dict[str, str] = {}
    for name, other in ((name, other) for name, other in partner.items() if name not in given):
        mine, above_mine = _chain(target, name, partner)
        theirs, above_theirs = _chain(source, other, partner.values())
        same_root = not above_mine or partner[above_mine] == above_theirs
        if not same_root or len(mine) != len(theirs) or mine.index(name) == theirs.index(other):
            continue
        by_name = _apart(source, target, [(other, name)], places)
        if _apart(source, target, list(zip(theirs, mine, strict=True)), places) < by_name / 2:
            found |= dict(zip(mine, theirs, strict=True))
    return found


def _chain(bones: RestBones, name: str, matched: Collection[str]) -> tuple[list[str], str]:
    """The bone with the free bones above and below it that are each other's only free child of its side, from the top;
    and the matched bone above them, "" for none."""
    matched, side = set(matched) - {name}, bone_names.side(name)
    chain, parent = [name], _parent(bones, name)
    while parent and parent not in matched and bone_names.side(parent) == side:
        chain.insert(0, parent)
        parent = _parent(bones, parent)
    below = _children(bones, name, matched, side)
    while len(below) == 1:
        chain.append(below[0])
        below = _children(bones, below[0], matched, side)
    return chain, parent if parent in matched else ""


def _parent(bones: RestBones, name: str) -> str:
    above = int(bones.parents[bones.names.index(name)])
    return bones.names[above] if above >= 0 else ""


def _children(bones: RestBones, name: str, matched: Collection[str], side: str) -> list[str]:
    number = bones.names.index(name)
    below = [bones.names[j] for j in np.flatnonzero(bones.parents == number).tolist()]
    return [bone for bone in below if bone not in matched and bone_names.side(bone) == side]


def _apart(
    source: RestBones, target: RestBones, pairs: list[tuple[str, str]], places: tuple[NDArray, NDArray]
) -> float:
    """The largest distance between the places of partners."""
    here = [source.names.index(other) for other, _ in pairs]
    there = [target.names.index(name) for _, name in pairs]
    return float(np.abs(places[0][here] - places[1][there]).max())
