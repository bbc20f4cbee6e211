"""What a retargeting reads from the two characters, each of which may have several meshes."""

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows
from ..scene import armature, editable, evaluation, landmarks, rest_bones, vertex_groups
from ..scene.error import SceneError
from ..scene.rest_bones import RestBones
from ..transfer import merging
from . import bone_map, whole
from .bone_map import BoneMatch
from .params import RetargetParams
from .whole import Whole


@dataclass(frozen=True)
class Character:
    """An armature, its deforming bones, and meshes end to end: the k-th has vertices starts[k] to starts[k + 1].

    `left_out` are meshes on the armature that take no part, as they are hidden.
    """

    armature: bpy.types.Object
    bones: RestBones
    meshes: list[bpy.types.Object]
    whole: Whole
    left_out: list[bpy.types.Object]

    @property
    def positions(self) -> NDArray[np.float32]:
        """Of all vertices, those of mirrored halves last."""
        return self.whole.positions

    @property
    def starts(self) -> list[int]:
        """Of each mesh, and the end of the last."""
        return self.whole.starts


@dataclass(frozen=True)
class Pair:
    """Both characters, the source's rows over its bones, the match of each bone of the target, and landmarks (L, 2).

    `held` (M, B) marks of each mesh of the target the bones whose groups are locked; `before` (M) are the rows of such
    a mesh as they are, empty ones of the others.
    """

    source: Character
    target: Character
    rows: Rows
    matches: list[BoneMatch]
    landmarks: NDArray[np.uint32]
    held: NDArray[np.bool_]
    before: list[Rows]

    @property
    def bone_map(self) -> NDArray[np.int64]:
        """(B_target,) the source's bone for each of the target's, -1 for none."""
        index = {name: i for i, name in enumerate(self.source.bones.names)}
        return np.array([index.get(entry.source, -1) for entry in self.matches], np.int64)


def read_pair(
    context: bpy.types.Context, source: bpy.types.Object, targets: Sequence[bpy.types.Object], params: RetargetParams
) -> Pair:
    """Read and check both; the targets are of one character. Raises SceneError with object, problem and cure."""
    giver = _source(context, source)
    ((rig, meshes),) = by_character(targets)
    taker = _character(rig, meshes)
    if giver.armature == taker.armature:
        raise SceneError(
            f"{giver.armature.name} deforms the source and the target: use Transfer Weights between meshes of "
            "one armature"
        )
    for obj in targets:
        editable.check(obj)
    editable.check_separate(targets, giver.meshes)
    rows = _rows(giver)
    matches = match_bones(giver.bones, taker.bones, params)
    if not any(entry.source for entry in matches):
        raise SceneError(
            f"No deforming bone of {taker.armature.name} has a partner in {giver.armature.name}: "
            "pair at least one in the bone map"
        )
    return Pair(giver, taker, rows, matches, _landmarks(giver, taker, params), *_locked(taker))


def match_bones(source: RestBones, target: RestBones, params: RetargetParams) -> list[BoneMatch]:
    """By the map of `params`, then by name and place. Raises SceneError for a name that is no bone."""
    for name, partner in (params.bone_map or {}).items():
        for bone, bones, whose in ((name, target, "target"), (partner, source, "source")):
            if bone and bone not in bones.names:
                raise SceneError(f"The bone map names {bone}, but the {whose} has no deforming bone of that name")
    return bone_map.match(source, target, params.bone_map)


def rest_bones_of(rig: bpy.types.Object) -> RestBones:
    """The deforming bones in the armature's order. Raises SceneError if there is none."""
    deforming = armature.deform_bones(rig)
    names = [bone.name for bone in rig.data.bones if bone.name in deforming]
    if not names:
        raise SceneError(f"{rig.name} has no bone that deforms: turn Deform on for some")
    return rest_bones.read(rig, names)


def _source(context: bpy.types.Context, source: bpy.types.Object) -> Character:
    rig = source if source.type == "ARMATURE" else armature.find(source)
    if rig is None:
        raise SceneError(f"{source.name} has no armature: pick the source's armature, or give it an Armature modifier")
    meshes = [obj for obj in rest_bones.meshes(rig, context.scene) if obj.vertex_groups and obj.data.edges]
    if not meshes:
        raise SceneError(f"{rig.name} deforms no mesh that has weights: pick the armature of a skinned character")
    return _character(rig, *rest_bones.visible(meshes, source))


def by_character(
    targets: Sequence[bpy.types.Object],
) -> list[tuple[bpy.types.Object, list[bpy.types.Object]]]:
    """The meshes of each character with its armature. Raises SceneError for a mesh without one."""
    characters: dict[bpy.types.Object, list[bpy.types.Object]] = {}
    for obj in targets:
        rig = armature.find(obj)
        if rig is None:
            raise SceneError(
                f"{obj.name} has no armature: give it an Armature modifier with the skeleton it shall follow"
            )
        characters.setdefault(rig, []).append(obj)
    return list(characters.items())


def _character(
    rig: bpy.types.Object, meshes: list[bpy.types.Object], left_out: Sequence[bpy.types.Object] = ()
) -> Character:
    evaluation.bring_up_to_date([rig, *meshes])
    return Character(rig, rest_bones_of(rig), meshes, whole.read(meshes, rig), list(left_out))


def joined_rows(meshes: Sequence[bpy.types.Object], names: Sequence[str]) -> Rows:
    """The rows of all meshes over the groups `names`, one after another."""
    return csr.concatenated([vertex_groups.read(obj, names) for obj in meshes])


def _rows(source: Character) -> Rows:
    names = source.bones.names
    rows = source.whole.rows(joined_rows(source.meshes, names), source.armature, names)
    if not csr.row_sums(rows).any():
        listed = ", ".join(obj.name for obj in source.meshes)
        raise SceneError(f"{listed}: no vertex follows a deforming bone of {source.armature.name}; paint weights first")
    return rows


def _locked(target: Character) -> tuple[NDArray[np.bool_], list[Rows]]:
    """`Pair.held` and `Pair.before`. Raises SceneError where locked groups sum to more than 1."""
    names = target.bones.names
    held = np.array([np.isin(names, sorted(vertex_groups.locked(obj))) for obj in target.meshes])
    before = []
    for obj, locked in zip(target.meshes, held, strict=True):
        before.append(vertex_groups.read(obj, names if locked.any() else []))
        overfull = merging.overfull(before[-1], locked)
        if overfull.size:
            raise SceneError(
                f"The locked groups of {obj.name} sum to more than 1 at {overfull.size} vertices, "
                f"the first is vertex {overfull[0]}: unlock one of them or normalise them"
            )
    return held, before


def _landmarks(source: Character, target: Character, params: RetargetParams) -> NDArray[np.uint32]:
    pairs = [
        (_vertex(source, source_name, i), _vertex(target, target_name, j))
        for source_name, i, target_name, j in params.landmarks
    ]
    return np.array(pairs, np.uint32).reshape(-1, 2)


def _vertex(character: Character, name: str, vertex: int) -> int:
    place = landmarks.place_of_empty(name)
    if place is not None:
        if not np.isfinite(place).all():
            raise SceneError(f"The landmark {name} is nowhere: give it a location of numbers")
        return int(np.linalg.norm(character.positions - place, axis=1).argmin())
    for obj, start, end in zip(character.meshes, character.starts, character.starts[1:], strict=False):
        if obj.name == name:
            if not 0 <= vertex < end - start:
                raise SceneError(f"A landmark names vertex {vertex} of {name}, which has {end - start}")
            return start + vertex
    raise SceneError(f"A landmark names {name}, which is neither an empty nor a mesh of {character.armature.name}")
