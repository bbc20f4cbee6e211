"""What a transfer reads from the body and from each garment."""

import time
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..csr import Rows
from ..scene import armature, mask, mesh, vertex_groups
from ..scene.error import SceneError
from . import merging
from .params import Mask, TransferParams


@dataclass(frozen=True)
class Body:
    """The source as read.

    The rows over `bones` sum to 1 and are carried over together. `fields` are groups beside them (cloth pins, masks),
    each carried over by itself. `chosen` names the groups to be written.
    """

    object: bpy.types.Object
    armature: bpy.types.Object | None
    geometry: mesh.Geometry
    bones: list[str]
    bone_weights: Rows
    fields: list[str]
    field_weights: Rows
    chosen: set[str]


@dataclass(frozen=True)
class Garment:
    """A target as read.

    `locks` are all its locked groups. `names` are the body's bones, then bones locked on the target only; `locked`
    marks those in `locks`. The old weights, over `names` and the body's fields, are empty where they take no part.
    """

    object: bpy.types.Object
    geometry: mesh.Geometry
    mask: NDArray[np.uint8] | None
    writable: NDArray[np.bool_]
    locks: set[str]
    names: list[str]
    locked: NDArray[np.bool_]
    before: Rows
    fields_before: Rows
    seconds: float


def read_body(source: bpy.types.Object, params: TransferParams) -> Body:
    """The source's shape and the weights of the groups that take part."""
    rig = armature.find(source)
    bones, chosen = choose_groups(source, rig, params.groups)
    fields = [name for name in chosen if name not in bones]
    return Body(
        object=source,
        armature=rig,
        geometry=mesh.read(source, evaluated=params.evaluated),
        bones=bones,
        bone_weights=vertex_groups.read(source, bones),
        fields=fields,
        field_weights=vertex_groups.read(source, fields),
        chosen=set(chosen),
    )


def choose_groups(source: bpy.types.Object, rig: bpy.types.Object | None, subset: str) -> tuple[list[str], list[str]]:
    """The groups that are bones, and those to be written. Without an armature all groups are, if all are wanted."""
    groups = [group.name for group in source.vertex_groups]
    if not groups:
        raise SceneError(f"{source.name} has no vertex groups to transfer: pick a body that has weights")
    if rig is None:
        return _choose_without_armature(source, groups, subset)
    deforming = armature.deform_bones(rig)
    wanted = {
        "ALL": set(groups),
        "ACTIVE": {groups[source.vertex_groups.active_index]},
        "BONE_DEFORM": deforming,
        "BONE_SELECT": deforming & armature.selected_bones(rig),
    }[subset]
    chosen = [name for name in groups if name in wanted]
    if not chosen:
        kind = "selected deform bone" if subset == "BONE_SELECT" else "deform bone"
        raise SceneError(
            f"No vertex group of {source.name} has the name of a {kind} of {rig.name}: "
            "select other bones, rename the groups, or set Groups to All Groups"
        )
    return [name for name in groups if name in deforming], chosen


def _choose_without_armature(source: bpy.types.Object, groups: list[str], subset: str) -> tuple[list[str], list[str]]:
    if subset == "ALL":
        return groups, groups
    if subset == "ACTIVE":
        return [], [groups[source.vertex_groups.active_index]]
    raise SceneError(
        f"{source.name} has no armature to tell which of its groups are bones: "
        "give it an Armature modifier, or set Groups to All Groups"
    )


def read_garment(target: bpy.types.Object, body: Body, params: TransferParams) -> Garment:
    """A target's shape, mask and locks; its old weights only where they take part in the new ones."""
    start = time.perf_counter()
    locks = vertex_groups.locked(target)
    names = body.bones + sorted((locks & _bone_names(target, body)) - set(body.bones))
    locked = np.array([name in locks for name in names], bool)
    mixed = params.mix_factor < 1
    garment = Garment(
        object=target,
        geometry=mesh.read(target, evaluated=params.evaluated),
        mask=read_mask(target, params.mask),
        writable=mesh.selected(target) if params.selected_only else np.ones(len(target.data.vertices), bool),
        locks=locks,
        names=names,
        locked=locked,
        before=vertex_groups.read(target, names if mixed or locked.any() else []),
        fields_before=vertex_groups.read(target, body.fields if mixed else []),
        seconds=time.perf_counter() - start,
    )
    _check_locks(garment)
    return garment


def _bone_names(target: bpy.types.Object, body: Body) -> set[str]:
    rigs = {rig for rig in (body.armature, armature.find(target)) if rig}
    return set().union(*(armature.deform_bones(rig) for rig in rigs))


def read_mask(target: bpy.types.Object, settings: Mask | None = None) -> NDArray[np.uint8] | None:
    """The mask by `settings` or by the target's own; None where it has none."""
    settings = settings or target.skinwright.mask()
    if settings is None:
        return None
    reading = mask.Reading[settings.reading]
    return mask.read(target, settings.group, reading, threshold=settings.threshold, invert=settings.invert)


def _check_locks(garment: Garment) -> None:
    overfull = merging.overfull(garment.before, garment.locked)
    if overfull.size:
        raise SceneError(
            f"The locked groups of {garment.object.name} sum to more than 1 at {overfull.size} vertices, "
            f"the first is vertex {overfull[0]}: unlock one of them or normalise them"
        )
