"""Shape keys that drivers turn on: sparse offsets, and rotations of a bone as variables."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from numpy.typing import NDArray

from . import editable
from . import mesh as scene_mesh
from .error import SceneError


def check(obj: bpy.types.Object) -> None:
    """Raise SceneError where keys cannot be added."""
    editable.check(obj)
    if obj.mode != "OBJECT":
        raise SceneError(f"{obj.name} is in {obj.mode.title()} mode: go to Object or Pose mode first")
    shared = scene_mesh.other_users(obj)
    if shared:
        raise SceneError(f"{obj.name} shares its mesh with {shared[0]}: make it single-user, or both would change")
    if obj.data.shape_keys and not obj.data.shape_keys.use_relative:
        raise SceneError(f"{obj.name} has absolute shape keys: turn Relative on, correctives are relative")
    if obj.show_only_shape_key:
        raise SceneError(f"{obj.name} shows one shape key alone: take the pin off below its list of shape keys first")


@contextmanager
def all_or_nothing(obj: bpy.types.Object, record: str) -> Iterator[None]:
    """Whatever exception leaves the block, keys, drivers and the property `record` of the object are as before."""
    kept, active = obj.data.copy(), obj.active_shape_key_index
    told = obj.get(record)
    try:
        yield
    except BaseException:
        _swap(obj, kept)
        obj.active_shape_key_index = active
        if told is not None:
            obj[record] = told
        elif record in obj:
            del obj[record]
        raise
    bpy.data.meshes.remove(kept)


def _swap(obj: bpy.types.Object, kept: bpy.types.Mesh) -> None:
    """Put the copy in the place of the mesh, with all that points to it."""
    spoiled, name = obj.data, obj.data.name
    key = spoiled.shape_keys.name if spoiled.shape_keys else ""
    spoiled.user_remap(kept)
    bpy.data.meshes.remove(spoiled)
    kept.name = name
    if key and kept.shape_keys:
        kept.shape_keys.name = key


def add(
    obj: bpy.types.Object, name: str, vertices: NDArray[np.integer], offsets: NDArray[np.floating]
) -> bpy.types.ShapeKey:
    """A key that moves `vertices` (n,) by `offsets` (n, 3) against the Basis, which is made if there is none."""
    active = obj.active_shape_key_index
    if not obj.data.shape_keys:
        obj.shape_key_add(name="Basis", from_mix=False)
    basis = obj.data.shape_keys.reference_key
    key = obj.shape_key_add(name=name, from_mix=False)
    key.relative_key, key.value = basis, 0.0  # in Blender 5.2 new keys are on
    positions = scene_mesh.vectors(basis.data, "co")
    positions[vertices] += offsets.astype(np.float32)
    key.data.foreach_set("co", positions.ravel())
    obj.active_shape_key_index = active
    return key


def drive(
    key: bpy.types.ShapeKey, armature: bpy.types.Object, bone: str, expression: str, channels: dict[str, str]
) -> None:
    """Let `key` have the value of `expression`.

    Its variables are channels of the bone's rotation against rest, the twist about Y apart from the swing.
    """
    driver = key.driver_add("value").driver
    driver.type = "SCRIPTED"
    for letter, channel in channels.items():
        variable = driver.variables.new()
        variable.name, variable.type = letter, "TRANSFORMS"
        target = variable.targets[0]
        target.id, target.bone_target = armature, bone
        target.transform_type, target.transform_space = channel, "LOCAL_SPACE"
        target.rotation_mode = "SWING_TWIST_Y"
    driver.expression = expression


def remove(obj: bpy.types.Object, names: Iterable[str], *, basis_too: bool) -> int:
    """Remove these keys with their drivers; the Basis too if asked and if it is the last one. Returns how many went."""
    keys = obj.data.shape_keys
    if keys is None:
        return 0
    count = 0
    for name in names:
        block = keys.key_blocks.get(name)
        if block is not None:
            block.driver_remove("value")
            obj.shape_key_remove(block)
            count += 1
    if basis_too and len(keys.key_blocks) == 1:
        obj.shape_key_clear()
    elif keys.animation_data and not keys.animation_data.drivers and not keys.animation_data.action:
        keys.animation_data_clear()
    return count
