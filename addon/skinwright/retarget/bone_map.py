"""Which bone of the source is which of the target: by name, by convention, by place in hierarchy and body."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scene.rest_bones import RestBones
from . import bone_names, chains

# Where the bones of both rigs lie in the body, (B, 6) each.
Places = tuple[NDArray, NDArray]
# How a partner was found, how sure that is, and what two names must have in common.
Rule = tuple[str, float, Callable[[list[str]], dict[str, object]]]

# Farther apart than this share of the skeleton's size, bones of unknown names are not one.
REACH = 0.12


@dataclass(frozen=True)
class BoneMatch:
    """The source's bone for a bone of the target, "" for none; how it was found, and how sure that is, 0 to 1."""

    target: str
    source: str
    how: str
    confidence: float


def match(source: RestBones, target: RestBones, given: Mapping[str, str] | None = None) -> list[BoneMatch]:
    """One entry per bone of the target, in its order. `given` entries win and are taken as they are."""
    given = given or {}
    found = {name: BoneMatch(name, given[name], "given", 1.0) for name in target.names if name in given}
    for how, confidence, key in _rules(source.names, target.names):
        _match_by_key(source.names, target.names, found, how, confidence, key)
    places = (_relative(source), _relative(target))
    _follow_the_chains(source, target, found, places)
    _match_by_place(source, target, found, places)
    nothing = "no partner"
    return [found.get(name, BoneMatch(name, "", nothing, 0.0)) for name in target.names]


def _rules(source: list[str], target: list[str]) -> list[Rule]:
    """What pairs of names are looked for, the surest first.

    Two rigs of different conventions may call different bones by one name (Mixamo's first spine bone is `Spine`,
    Rigify's hips are `spine`), so there the conventions decide.
    """
    meanings = [bone_names.vocabulary(names) for names in (source, target)]
    differ = all(meanings) and bone_names.convention(source) != bone_names.convention(target)
    known = set(meanings[0]) | set(meanings[1]) if differ else set()

    def unknown(names: list[str]) -> list[str]:
        return [name for name in names if name not in known]

    by_name: list[Rule] = [
        ("name", 1.0, lambda names: {name: name for name in unknown(names)}),
        ("name", 0.95, lambda names: {name: bone_names.plain(name) for name in unknown(names)}),
        ("name", 0.9, lambda names: {n: (bone_names.without_side(n), bone_names.side(n)) for n in unknown(names)}),
    ]
    return [*by_name, ("convention", 0.85, lambda names: dict(bone_names.vocabulary(names)))]


def _match_by_key(
    source: list[str],
    target: list[str],
    found: dict[str, BoneMatch],
    how: str,
    confidence: float,
    key: Callable[[list[str]], dict[str, object]],
) -> None:
    """Pairs bones of equal keys, each bone once; keys that two bones of one side share decide nothing."""
    taken = {entry.source for entry in found.values()}
    by_key = _unique(key(source))
    for name, value in _unique_names(key(target)).items():
        partner = by_key.get(value)
        if name not in found and partner is not None and partner not in taken:
            found[name] = BoneMatch(name, partner, how, confidence)
            taken.add(partner)


def _unique(keys: dict[str, object]) -> dict[object, str]:
    counts: dict[object, int] = {}
    for value in keys.values():
        counts[value] = counts.get(value, 0) + 1
    return {value: name for name, value in keys.items() if counts[value] == 1}


def _unique_names(keys: dict[str, object]) -> dict[str, object]:
    return {name: value for value, name in _unique(keys).items()}


def _follow_the_chains(source: RestBones, target: RestBones, found: dict[str, BoneMatch], places: Places) -> None:
    """Corrects partners by name that leave a bone over above in one rig and below in the other."""
    partner = {entry.target: entry.source for entry in found.values() if entry.source}
    given = {name for name, entry in found.items() if entry.how == "given"}
    for name, other in chains.shifted(source, target, partner, given, places).items():
        found[name] = BoneMatch(name, other, "place", 0.6)


def _match_by_place(source: RestBones, target: RestBones, found: dict[str, BoneMatch], places: Places) -> None:
    """Pairs what is left by where it lies in the body, the closest first, among bones of one side whose nearest mapped
    ancestors are partners."""
    taken = {entry.source for entry in found.values()}
    free_target = [j for j, name in enumerate(target.names) if name not in found]
    free_source = [i for i, name in enumerate(source.names) if name not in taken]
    if not free_target or not free_source:
        return
    partner = {entry.target: entry.source for entry in found.values() if entry.source}
    above_source = _mapped_ancestors(source, set(partner.values()))
    above_target = _mapped_ancestors(target, set(partner))
    candidates = []
    for j in free_target:
        ancestor = partner.get(above_target[j], "")
        for i in free_source:
            same_side = bone_names.side(source.names[i]) == bone_names.side(target.names[j])
            distance = float(np.abs(places[0][i] - places[1][j]).max())
            if same_side and distance < REACH and (not partner or above_source[i] == ancestor):
                candidates.append((distance, target.names[j], source.names[i]))
    for distance, name, other in sorted(candidates):
        if name not in found and other not in taken:
            confidence = 0.7 * (1 - distance / REACH) if partner else 0.4 * (1 - distance / REACH)
            found[name] = BoneMatch(name, other, "place", round(confidence, 2))
            taken.add(other)


def _relative(bones: RestBones) -> NDArray[np.float64]:
    """(B, 6) heads and tails in the box of the whole skeleton, 0 to 1 along its largest side."""
    ends = np.concatenate([bones.heads, bones.tails])
    low, size = ends.min(axis=0), max(float(np.ptp(ends, axis=0).max()), 1e-12)
    middle = (ends.max(axis=0) + low) / 2
    return np.hstack([(bones.heads - middle) / size, (bones.tails - middle) / size])


def _mapped_ancestors(bones: RestBones, mapped: set[str]) -> list[str]:
    found = []
    for j in range(len(bones.names)):
        k = int(bones.parents[j])
        while k >= 0 and bones.names[k] not in mapped:
            k = int(bones.parents[k])
        found.append(bones.names[k] if k >= 0 else "")
    return found
