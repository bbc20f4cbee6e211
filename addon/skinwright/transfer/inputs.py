"""What a transfer reads from each target; body.py reads the source."""

import time
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..csr import Rows
from ..scene import armature, binding, evaluation, mask, mesh, mirror, modifiers, shapes, symmetry, vertex_groups
from ..scene.error import SceneError
from . import completion, merging
from .body import Body, read_body
from .completion import Completion
from .params import Mask, TransferParams

__all__ = ["Body", "Garment", "read_body", "read_garment", "read_mask"]


@dataclass(frozen=True)
class Garment:
    """A target as read.

    `shape` is what was seen, `completion` that with mirrored halves; `bound_in_pose` if it will get the rest shape from
    which the pose leads to what was seen. `locks` are all its locked groups. `names` are the body's bones,
    then the target's other bones; of these columns `held` marks those that stay as they are, `chosen` those that come
    from the body, and `opposite` has the other side's. The old weights, over `names` and the body's fields, are empty
    where they take no part. `distance` is the one in force if the target's size tells nothing of it; vertices closer
    than `welded` are one by the target's modifiers.
    """

    object: bpy.types.Object
    shape: shapes.Shape
    completion: Completion
    bound_in_pose: bool
    mask: NDArray[np.uint8] | None
    writable: NDArray[np.bool_]
    locks: set[str]
    names: list[str]
    held: NDArray[np.bool_]
    chosen: NDArray[np.bool_]
    opposite: NDArray[np.int64]
    before: Rows
    fields_before: Rows
    distance: float | None
    welded: float
    seconds: float

    @property
    def geometry(self) -> mesh.Geometry:
        """The shape that is solved."""
        return self.completion.geometry


def read_garment(target: bpy.types.Object, body: Body, params: TransferParams) -> Garment:
    """A target's shape, mask and locks; its old weights only where they take part in the new ones."""
    start = time.perf_counter()
    evaluation.bring_up_to_date([target])
    _check_mask(target, body, params)
    locks = vertex_groups.locked(target)
    own_bones = _bone_names(target, body, params) & {group.name for group in target.vertex_groups}
    names = body.bones + sorted(own_bones - set(body.bones))
    partial = body.is_partial
    # Bones that the body lacks keep what they have, as locked ones do; where only some bones come, others make room.
    held = np.array([name in locks or (not partial and name not in body.bones) for name in names], bool)
    mixed = params.mix_factor < 1 or partial
    with shapes.looked_at([target, *body.objects], params.geometry):
        shape = shapes.read_target(target, params.geometry)
        completed = _completed(target, shape, body, params)
    garment = Garment(
        object=target,
        shape=shape,
        completion=completed,
        bound_in_pose=_is_bound_in_pose(target, body, names, params),
        mask=read_mask(target, params.mask),
        writable=mesh.selected(target) if params.selected_only else np.ones(len(target.data.vertices), bool),
        locks=locks,
        names=names,
        held=held,
        chosen=np.array([name in body.chosen for name in names], bool),
        opposite=_opposite_columns(body),
        before=vertex_groups.read(target, names if mixed or held.any() else []),
        fields_before=vertex_groups.read(target, body.fields if params.mix_factor < 1 else []),
        distance=_wire_distance(shape.geometry, body, params),
        welded=modifiers.welded(target) * float(np.abs(np.linalg.det(shape.matrix[:3, :3]))) ** (1 / 3),
        seconds=time.perf_counter() - start,
    )
    _check_locks(garment)
    return garment


def _completed(target: bpy.types.Object, shape: shapes.Shape, body: Body, params: TransferParams) -> Completion:
    """With the halves that Mirror modifiers add, if the weights that these give them are the right ones."""
    found = mirror.reflections(target, shape.matrix, shape.geometry.positions)
    reflections = [reflection for reflection in found if mirror.is_right(reflection, body.armature, body.opposite)]
    done = completion.complete(shape.geometry, reflections)
    if params.symmetrize:
        to_middle = np.linalg.inv(np.array((body.armature or body.object).matrix_world))
        across = mesh.transformed(shape.geometry.positions, to_middle)
        done = completion.symmetrised(done, symmetry.partners(across))
    return done


def _is_bound_in_pose(target: bpy.types.Object, body: Body, names: list[str], params: TransferParams) -> bool:
    """Whether it was fitted on the posed body and does not follow the pose yet. Raises SceneError if it cannot."""
    if params.geometry != "CURRENT" or not any(armature.is_posed(rig) for rig in body.rigs):
        return False
    follows = set(armature.rigs(target)) & set(body.rigs)
    if not follows and (armature.follows_any(target, body.rigs) or not params.add_armature):
        return False  # another armature moves it, or none will
    if follows and (vertex_groups.read(target, names).values > 0).any():
        return False
    binding.check(target, params.make_single_user)
    return True


def _wire_distance(geometry: mesh.Geometry, body: Body, params: TransferParams) -> float | None:
    """Strings have no width that a distance could be a part of: it is one of the source's size."""
    if len(geometry.triangles) or params.max_distance is not None:
        return None
    return params.relative_max_distance * float(np.linalg.norm(body.geometry.size))


def _opposite_columns(body: Body) -> NDArray[np.int64]:
    """(B,) the column of the other side's bone; its own where the body has no such group."""
    index = {name: column for column, name in enumerate(body.bones)}
    return np.array([index.get(body.opposite[name], index[name]) for name in body.bones], np.int64)


def _bone_names(target: bpy.types.Object, body: Body, params: TransferParams) -> set[str]:
    """Of the armatures that will deform the target: others of its own only if nothing ends them."""
    others = [] if params.replace_others and body.rigs else armature.rigs(target)
    rigs = {*body.rigs, *others}
    return set().union(*(armature.deform_bones(rig) for rig in rigs))


def read_mask(target: bpy.types.Object, settings: Mask | None = None) -> NDArray[np.uint8] | None:
    """The mask by `settings` or by the target's own; None where it has none."""
    settings = settings or target.skinwright.mask()
    if settings is None:
        return None
    reading = mask.Reading[settings.reading]
    return mask.read(target, settings.group, reading, threshold=settings.threshold, invert=settings.invert)


def _check_mask(target: bpy.types.Object, body: Body, params: TransferParams) -> None:
    settings = params.mask or target.skinwright.mask()
    if settings is not None and settings.group in body.chosen - vertex_groups.locked(target):
        raise SceneError(
            f"The mask of {target.name} is its group {settings.group}, which would be overwritten with the weights of "
            f"{body.object.name}: pick another group as mask, or rename it"
        )


def _check_locks(garment: Garment) -> None:
    locked = np.array([name in garment.locks for name in garment.names], bool)
    overfull = merging.overfull(garment.before, locked)
    if overfull.size:
        raise SceneError(
            f"The locked groups of {garment.object.name} sum to more than 1 at {overfull.size} vertices, "
            f"the first is vertex {overfull[0]}: unlock one of them or normalise them"
        )
