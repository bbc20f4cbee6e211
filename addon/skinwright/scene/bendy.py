"""B-bones: a vertex follows a mix of two joints of the bone, chosen by where it rests along it.

To a solver that knows one matrix per bone, each place along a B-bone is a bone of its own: a *column*. A vertex has one
column of each bone that it follows, so that columns take the place of bones without a change of meaning.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows
from . import armature as scene_armature
from . import mesh as scene_mesh
from .error import SceneError

# Places along a segment are told apart to this part of it.
_PLACES = 500


@dataclass(frozen=True)
class Columns:
    """`bone` (C,) ascending indices into the names, `joint` (C,), -1 if rigid, and `blend` (C,) towards the next."""

    bone: NDArray[np.int64]
    joint: NDArray[np.int64]
    blend: NDArray[np.float64]

    @property
    def first(self) -> NDArray[np.int64]:
        """(J,) the first column of every bone."""
        return np.searchsorted(self.bone, np.arange(int(self.bone.max(initial=-1)) + 1, dtype=np.int64))

    def names_only(self, rows: Rows) -> Rows:
        """Rows over columns as rows over bones."""
        return rows._replace(bones=self.bone[rows.bones].astype(np.uint32))

    def parents(self, parents: NDArray[np.int32]) -> NDArray[np.int32]:
        """(C,) of the bones' parents (J,): the other columns of a bone hang below its first one."""
        first = self.first
        above = np.where(parents >= 0, first[parents], -1)[self.bone]
        is_first = np.arange(len(self.bone), dtype=np.int64) == first[self.bone]
        return np.where(is_first, above, first[self.bone]).astype(np.int32)


def split(obj: bpy.types.Object, rig: bpy.types.Object, names: Sequence[str], rows: Rows) -> tuple[Columns, Rows]:
    """Columns for the bones `names`, and the rows over them. Raises SceneError for B-bones Blender has not computed."""
    bones = np.arange(len(names), dtype=np.int64)
    bendy = np.array([rig.data.bones[name].bbone_segments > 1 for name in names], bool)
    if not bendy.any():
        return Columns(bones, np.full(len(names), -1), np.zeros(len(names))), rows
    place = np.full(len(rows.bones), -1, np.int64)
    for j in np.flatnonzero(bendy).tolist():
        entries = np.flatnonzero(rows.bones == j)
        place[entries] = _places(obj, rig, names[j], csr.entry_vertices(rows)[entries])
    width = int(place.max(initial=0)) + 2
    # A bone without a vertex keeps a column, so that every name has one.
    kept = np.concatenate([rows.bones * np.int64(width) + place + 1, np.setdiff1d(bones, rows.bones) * width])
    keys, inverse = np.unique(kept, return_inverse=True)
    place = keys % width - 1
    columns = Columns(keys // width, np.where(place < 0, -1, place // _PLACES), (place % _PLACES) / _PLACES)
    return columns, rows._replace(bones=inverse[: len(rows.bones)].astype(np.uint32))


def matrices(
    obj: bpy.types.Object, rig: bpy.types.Object, names: Sequence[str], columns: Columns
) -> NDArray[np.float64]:
    """(C, 4, 4) where each column takes a point of the mesh, in the mesh's own space."""
    rigid = scene_armature.pose_from_rest(obj, rig, names)
    found = rigid[columns.bone]
    if (columns.joint < 0).all() or rig.data.pose_position == "REST":
        return found
    armature_from_object = np.array(rig.matrix_world.inverted_safe() @ obj.matrix_world)
    object_from_armature = np.linalg.inv(armature_from_object)
    for j in np.unique(columns.bone[columns.joint >= 0]).tolist():
        joints = object_from_armature @ _joints(rig, names[j]) @ armature_from_object
        mine = np.flatnonzero((columns.bone == j) & (columns.joint >= 0))
        blend = columns.blend[mine][:, None, None]
        joint = columns.joint[mine]
        found[mine] = (1 - blend) * joints[joint] + blend * joints[np.minimum(joint + 1, len(joints) - 1)]
    return found


def _joints(rig: bpy.types.Object, name: str) -> NDArray[np.float64]:
    """(segments + 1, 4, 4) where each joint takes a point, in the armature's space."""
    bone = _evaluated(rig, name)
    rest = bone.bone.matrix_local
    found = []
    for joint in range(bone.bone.bbone_segments + 1):
        posed, resting = (bone.bbone_segment_matrix(joint, rest=at_rest) for at_rest in (False, True))
        found.append(np.array(bone.matrix @ posed @ resting.inverted() @ rest.inverted()))
    return np.array(found)


def _places(obj: bpy.types.Object, rig: bpy.types.Object, name: str, vertices: NDArray[np.int64]) -> NDArray[np.int64]:
    """Where vertices rest along a B-bone, in parts of its segments."""
    bone = _evaluated(rig, name)
    armature_from_object = rig.matrix_world.inverted_safe() @ obj.matrix_world
    positions = scene_mesh.rest_positions(obj.data)[vertices].tolist()
    found = [bone.bbone_segment_index(armature_from_object @ Vector(position)) for position in positions]
    at = np.array(found, np.float64).reshape(-1, 2)
    return np.round(at.sum(axis=1) * _PLACES).astype(np.int64)


def _evaluated(rig: bpy.types.Object, name: str) -> bpy.types.PoseBone:
    bone = rig.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones[name]
    try:
        bone.bbone_segment_matrix(0)
    except RuntimeError as error:
        raise SceneError(
            f"The B-bone {name} of {rig.name} has not been computed by Blender: show the armature"
        ) from error
    return bone
