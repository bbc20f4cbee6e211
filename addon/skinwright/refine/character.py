"""A mesh and its armature as the arrays that refinement takes, in the mesh's own space."""

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr, native
from ..csr import Rows
from ..scene import armature, mesh, mirror, orientation, shapes, vertex_groups
from ..scene.error import SceneError
from .params import RefineParams


@dataclass(frozen=True)
class Character:
    """B deform bones with names, parents (B,), segments (B, 2, 3) and rest matrices (B, 4, 4); V vertices at rest."""

    name: str
    rig: str
    positions: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    rows: Rows
    bones: list[str]
    parents: NDArray[np.int32]
    segments: NDArray[np.float32]
    rest_bones: NDArray[np.float64]
    preserve_volume: bool
    armature_from_mesh: NDArray[np.float64]

    def refiner(self, params: RefineParams) -> native.Refiner:
        """The native object, prepared. Raises native.NativeError."""
        options = {
            name: getattr(params, name) for name in ("stretch", "volume", "bind", "energy", "self_collision", "threads")
        }
        if params.cell > 0:
            options["cell"] = params.cell
        arrays = (self.positions, self.triangles, self.rows, len(self.bones), self.parents, self.segments)
        return native.Refiner(self.name, *arrays, **options)

    def skinned(self, pose_from_rest: NDArray[np.float64]) -> NDArray[np.float32]:
        """(V, 3) as the Armature modifier leaves them."""
        return self.posed(self.positions, pose_from_rest)

    def posed(self, positions: NDArray[np.float32], pose_from_rest: NDArray[np.float64]) -> NDArray[np.float32]:
        """The same of other rest positions (V, 3). Dual quaternions blend in the armature's space, as Blender's do."""
        if not self.preserve_volume:
            return native.skin(positions, self.rows, pose_from_rest, None)
        there, back = self.armature_from_mesh, np.linalg.inv(self.armature_from_mesh)
        poses = there @ pose_from_rest @ back
        moved = native.skin(_moved(there, positions), self.rows, poses, there @ self.rest_bones)
        return _moved(back, moved)

    def lengths(self) -> NDArray[np.float64]:
        """(B,) of the bones."""
        return np.linalg.norm(self.segments[:, 1] - self.segments[:, 0], axis=1).astype(np.float64)


def read(obj: bpy.types.Object) -> Character:
    """Everything about a mesh that no pose changes. Raises SceneError before anything is written."""
    rig = rig_of(obj)
    deforming, members = armature.deform_bones(rig), {group.name for group in obj.vertex_groups}
    bones = [bone.name for bone in rig.data.bones if bone.name in deforming and bone.name in members]
    if not bones:
        raise SceneError(f"{obj.name} has no vertex group of a deform bone of {rig.name}: give it weights first")
    mesh.check_world(obj, rig)
    halves = mirror.before_the_pose(obj)
    if halves:
        raise SceneError(
            f"{obj.name} has the modifier {halves[0].name} before its armature, and the half it makes would be refined "
            "as the other one: apply it first"
        )
    positions = shapes.before_the_pose(obj)
    if not np.isfinite(positions).all():
        raise SceneError(f"{obj.name} has a coordinate that is not a number: move or delete that vertex")
    rows = vertex_groups.read(obj, bones)
    object_from_armature = np.array(obj.matrix_world.inverted_safe() @ rig.matrix_world, np.float64)
    rest = np.array([rig.data.bones[name].matrix_local for name in bones], np.float64)
    return Character(
        name=obj.name,
        rig=rig.name,
        positions=positions,
        triangles=orientation.outward(positions, mesh.triangles(obj)),
        rows=csr.Rows(*rows),
        bones=bones,
        parents=armature.parents(rig, bones),
        segments=armature.segments(obj, rig, bones),
        rest_bones=object_from_armature @ rest,
        preserve_volume=preserves_volume(obj),
        armature_from_mesh=np.linalg.inv(object_from_armature),
    )


def _moved(matrix: NDArray[np.float64], positions: NDArray[np.float32]) -> NDArray[np.float32]:
    moved = np.einsum("ij,nj->ni", matrix[:3, :3], positions) + matrix[:3, 3]
    return moved.astype(np.float32)


def preserves_volume(obj: bpy.types.Object) -> bool:
    """Whether the Armature modifier blends by dual quaternions."""
    found = armature.modifiers(obj)
    return bool(found) and found[0].use_deform_preserve_volume


def pose(obj: bpy.types.Object, character: Character) -> NDArray[np.float64]:
    """(B, 4, 4) the present pose."""
    return armature.pose_from_rest(obj, rig_of(obj), character.bones)


def rig_of(obj: bpy.types.Object) -> bpy.types.Object:
    """The armature that deforms the mesh: another object, of a library, may have its name. Raises SceneError."""
    rig = armature.find(obj)
    if rig is None:
        raise SceneError(f"{obj.name} has no armature whose joints could be refined: give it an Armature modifier")
    return rig
