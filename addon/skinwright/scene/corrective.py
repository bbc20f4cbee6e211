"""Corrective shape keys: what weights cannot reach, driven by the turn of a joint."""

import bpy
import numpy as np
from mathutils import Quaternion
from numpy.typing import NDArray

from . import mesh as scene_mesh


def add(
    obj: bpy.types.Object, name: str, vertices: NDArray[np.integer], offsets: NDArray[np.float32]
) -> bpy.types.ShapeKey:
    """A key that moves `vertices` (n,) by `offsets` (n, 3) at rest; the Basis, made where missing, stays active."""
    if not obj.data.shape_keys:
        obj.shape_key_add(name="Basis", from_mix=False)
    basis = obj.data.shape_keys.reference_key
    key = obj.shape_key_add(name=name, from_mix=False)
    key.relative_key, key.value = basis, 0.0  # in Blender 5.2 new keys are on
    positions = scene_mesh.vectors(basis.data, "co")
    positions[vertices] += offsets
    key.data.foreach_set("co", positions.ravel())
    obj.active_shape_key_index = 0
    return key


def drive(key: bpy.types.ShapeKey, armature: bpy.types.Object, bone: str, rotation: Quaternion) -> None:
    """Let `key` be 0 at rest and 1 where `bone` has this local rotation, against its turn the same way.

    The value is the joint's quaternion vector along that of the sculpted pose, q_pose . q / |q_pose|^2, from 0 to 1.
    The expression is one of Blender's simple ones: it needs no permission to run scripts.
    """
    axis = np.array(rotation if rotation.w >= 0 else -rotation)[1:]
    driver = key.driver_add("value").driver
    driver.type = "SCRIPTED"
    for letter in "xyz":
        variable = driver.variables.new()
        variable.name, variable.type = letter, "TRANSFORMS"
        target = variable.targets[0]
        target.id, target.bone_target = armature, bone
        target.transform_type, target.transform_space = f"ROT_{letter.upper()}", "LOCAL_SPACE"
        target.rotation_mode = "QUATERNION"
    x, y, z = (f"{component:.6g}" for component in axis / (axis @ axis))
    driver.expression = f"min(max(x * {x} + y * {y} + z * {z}, 0), 1)"


def joint(armature: bpy.types.Object, share: dict[str, float], rotations: dict[str, Quaternion]) -> str:
    """The bone whose turn moves most of what was sculpted, or nothing where none has turned.

    `share` is the sum of the sculpted vertices' weights in each bone; `rotations` are local.
    """
    carried = dict.fromkeys(rotations, 0.0)
    for name, weight in share.items():
        bone = armature.data.bones[name]
        for above in (bone, *bone.parent_recursive):
            carried[above.name] += weight
    turned = {name: carried[name] * _angle(rotation) for name, rotation in rotations.items()}
    best = max(turned, key=turned.__getitem__, default="")
    return best if best and turned[best] > 0 else ""


def _angle(rotation: Quaternion) -> float:
    """Radians, 0 below what rounding leaves."""
    angle = 2 * float(np.arctan2(np.linalg.norm(rotation[1:]), abs(rotation[0])))
    return angle if angle > 1e-4 else 0.0
