"""What automatic weights read from each mesh and its armature."""

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..csr import Rows
from ..scene import armature, editable, evaluation, mesh, mirror, rest_bones, shapes, sides, symmetry, vertex_groups
from ..scene.error import SceneError
from ..scene.rest_bones import RestBones
from ..transfer import completion, merging
from ..transfer.completion import Completion
from .params import AutoskinParams


@dataclass(frozen=True)
class Target:
    """A mesh as read, with the deforming bones of its armature (B) in the armature's order.

    `computed` (B,) marks the bones that take part, which are those whose groups are not locked; `chosen` (B,) those of
    them that are written from the answer, while the rest make room. `opposite` (B,) is the other side's bone.
    `before` are the old rows, empty where they take no part; `share` is how much of the new rows is taken, (V,) or one
    for all. `mirror_warning` says why a half that a modifier adds will not follow its side.
    """

    object: bpy.types.Object
    rig: bpy.types.Object
    bones: RestBones
    computed: NDArray[np.bool_]
    chosen: NDArray[np.bool_]
    opposite: NDArray[np.int64]
    completion: Completion
    before: Rows
    share: NDArray[np.float64] | float
    vertices: NDArray[np.int64]
    mirror_warning: str

    @property
    def joins_old_weights(self) -> bool:
        """Whether the answer is not written as it comes."""
        partial = not (self.computed & self.chosen).all() or not self.completion.is_plain
        return partial or isinstance(self.share, np.ndarray) or self.share < 1


def read(objects: Sequence[bpy.types.Object], rig: bpy.types.Object | None, params: AutoskinParams) -> list[Target]:
    """Every mesh, with `rig` or the armature that deforms it. Raises SceneError with the object, problem and cure."""
    evaluation.bring_up_to_date([*objects, *([rig] if rig else [])])
    rigs = [_rig_of(obj, rig) for obj in objects]
    editable.check_separate(objects)
    bones = {one.name: _bones_of(one) for one in dict.fromkeys(rigs)}
    with shapes.looked_at([*objects, *rigs], params.geometry):
        pairs = zip(objects, rigs, strict=True)
        return [_read_target(obj, its_rig, bones[its_rig.name], params) for obj, its_rig in pairs]


def _rig_of(obj: bpy.types.Object, rig: bpy.types.Object | None) -> bpy.types.Object:
    editable.check(obj)
    rig = rig or armature.find(obj)
    if rig is None:
        raise SceneError(
            f"{obj.name} has no armature to take bones from: select one too, or give it an Armature modifier"
        )
    if rig.type != "ARMATURE":
        raise SceneError(f"{rig.name} is no armature: name the armature whose bones the weights follow")
    if not armature.deform_bones(rig):
        raise SceneError(f"{rig.name} has no bone that deforms {obj.name}: turn Deform on for some")
    mesh.check_world(obj, rig)
    return rig


def _bones_of(rig: bpy.types.Object) -> RestBones:
    deforming = armature.deform_bones(rig)
    bones = rest_bones.read(rig, [bone.name for bone in rig.data.bones if bone.name in deforming])
    ends = np.concatenate([bones.heads, bones.tails], axis=1)
    bad = np.flatnonzero(~np.isfinite(ends).all(axis=1))
    if bad.size:
        raise SceneError(
            f"{rig.name}: bone {bones.names[bad[0]]} has a head or tail that is not a number: move or delete it"
        )
    # As the library will see it, in 32 bits.
    length = np.linalg.norm(bones.tails.astype(np.float32) - bones.heads.astype(np.float32), axis=1)
    flat = np.flatnonzero(length == 0)
    if flat.size:
        raise SceneError(
            f"{rig.name}: bone {bones.names[flat[0]]} has no length: move its tail away from its head, "
            "turn its Deform off, or give the armature a scale other than 0"
        )
    return bones


def _read_target(obj: bpy.types.Object, rig: bpy.types.Object, bones: RestBones, params: AutoskinParams) -> Target:
    locks = vertex_groups.locked(obj)
    computed = np.array([name not in locks for name in bones.names], bool)
    if not computed.any():
        raise SceneError(
            f"all groups of {obj.name} for the bones of {rig.name} are locked: unlock those to be computed"
        )
    chosen = _chosen(obj, rig, bones, computed, params)
    share = _share(obj, params, {name for name, taken in zip(bones.names, computed, strict=True) if taken})
    shape, opposite = _shape(obj, params), sides.opposites(rig, bones.names)
    partial = not chosen.all() or params.mix_factor < 1 or bool(params.mask_group)
    target = Target(
        object=obj,
        rig=rig,
        bones=bones,
        computed=computed,
        chosen=chosen,
        opposite=_opposite_columns(opposite, bones.names),
        completion=_completed(obj, rig, opposite, shape, params),
        before=vertex_groups.read(obj, bones.names if partial else []),
        share=share,
        vertices=_vertices(obj, share, params),
        mirror_warning=mirror.warning(obj, shape.matrix, shape.geometry.positions, rig, opposite),
    )
    _check_locks(target, locks)
    return target


def _chosen(
    obj: bpy.types.Object,
    rig: bpy.types.Object,
    bones: RestBones,
    computed: NDArray[np.bool_],
    params: AutoskinParams,
) -> NDArray[np.bool_]:
    if not params.selected_bones:
        return computed
    selected = armature.selected_bones(rig)
    chosen = computed & np.array([name in selected for name in bones.names], bool)
    if not chosen.any():
        raise SceneError(
            f"no unlocked deforming bone of {rig.name} is selected for {obj.name}: select the bones to compute"
        )
    return chosen


def _share(obj: bpy.types.Object, params: AutoskinParams, written: set[str]) -> NDArray[np.float64] | float:
    """How much of the new rows each vertex takes; one that is not in the mask's group takes nothing."""
    if not params.mask_group:
        return params.mix_factor
    if params.mask_group not in obj.vertex_groups:
        raise SceneError(
            f"{obj.name} has no vertex group {params.mask_group} to use as mask: pick another or clear the field"
        )
    if params.mask_group in written:
        raise SceneError(
            f"The mask of {obj.name} is its group {params.mask_group}, which would be overwritten with weights: "
            "pick another group as mask, or rename it"
        )
    share = vertex_groups.values(obj, params.mask_group).astype(np.float64)
    return np.clip(share, 0, 1) * params.mix_factor


def _opposite_columns(opposite: dict[str, str], names: list[str]) -> NDArray[np.int64]:
    index = {name: column for column, name in enumerate(names)}
    return np.array([index.get(opposite[name], index[name]) for name in names], np.int64)


def _shape(obj: bpy.types.Object, params: AutoskinParams) -> shapes.Shape:
    shape = shapes.read_target(obj, params.geometry)
    if not len(shape.geometry.triangles):
        raise SceneError(f"{obj.name} has no faces: this works along surfaces, so give it some")
    return shape


def _completed(
    obj: bpy.types.Object, rig: bpy.types.Object, opposite: dict[str, str], shape: shapes.Shape, params: AutoskinParams
) -> Completion:
    """With the halves that Mirror modifiers add, if the weights that these give them are the right ones."""
    found = mirror.reflections(obj, shape.matrix, shape.geometry.positions)
    reflections = [reflection for reflection in found if mirror.is_right(reflection, rig, opposite)]
    done = completion.complete(shape.geometry, reflections)
    if params.symmetrize:
        to_middle = np.linalg.inv(np.array(rig.matrix_world))
        across = mesh.transformed(shape.geometry.positions, to_middle)
        done = completion.symmetrised(done, symmetry.partners(across))
    return done


def _vertices(obj: bpy.types.Object, share: NDArray[np.float64] | float, params: AutoskinParams) -> NDArray[np.int64]:
    """(n,) those that are written: what takes nothing of the new rows stays as it is to the bit."""
    written = np.broadcast_to(np.asarray(share) > 0, len(obj.data.vertices))
    if params.selected_only:
        written = written & mesh.selected(obj)
    return np.flatnonzero(written).astype(np.int64)


def _check_locks(target: Target, locks: set[str]) -> None:
    locked = np.array([name in locks for name in target.bones.names], bool)
    overfull = merging.overfull(target.before, locked) if locked.any() else np.zeros(0, np.intp)
    if overfull.size:
        raise SceneError(
            f"The locked groups of {target.object.name} sum to more than 1 at {overfull.size} vertices, "
            f"the first is vertex {overfull[0]}: unlock one of them or normalise them"
        )
