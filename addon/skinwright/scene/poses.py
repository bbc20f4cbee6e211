"""Test poses: an armature is put into each in turn, and afterwards is as it was."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from . import armature as scene_armature
from .error import SceneError

# Blender shows no frame beyond these, in both directions: it stays there.
LAST_FRAME = 1_048_574
_CHANNELS = ("location", "rotation_quaternion", "rotation_euler", "rotation_axis_angle", "scale")


def check_shown(armature: bpy.types.Object) -> None:
    """Raise SceneError for an armature that is shown at rest, whatever its action says."""
    if armature.data.pose_position == "REST":
        raise SceneError(f"{armature.name} is set to Rest Position, where nothing moves: set it to Pose Position")


def keyframes(armature: bpy.types.Object, most: int) -> Iterator[str]:
    """The frames that have keys, at most so many, evenly chosen; yields "frame N"."""
    frames = keyed_frames(armature)
    if not frames:
        raise SceneError(f"{armature.name} has no keyframes: give it an action, or choose Range of Motion")
    for frame in _shown(armature, frames, most):
        yield f"frame {frame}"


def keyed_frames(armature: bpy.types.Object) -> list[int]:
    """The frames that have keys, ascending."""
    return sorted({round(key.co[0]) for curve in _curves(armature) for key in curve.keyframe_points})


def marked_frames(armature: bpy.types.Object, most: int) -> Iterator[str]:
    """The frames with a marker in the timeline, at most so many, evenly chosen; yields their names."""
    names: dict[int, str] = {}
    for marker in bpy.context.scene.timeline_markers:
        names.setdefault(marker.frame, marker.name)
    if not names:
        raise SceneError("The timeline has no markers: press M on the frames to test, or choose other poses")
    for frame in _shown(armature, sorted(names), most):
        yield f"{names[frame]} (frame {frame})"


def library(armature: bpy.types.Object, most: int) -> Iterator[str]:
    """The pose assets of this file, at most so many, evenly chosen; yields their names."""
    actions = [action for action in bpy.data.actions if action.asset_data]
    if not actions:
        raise SceneError("There are no pose assets in this file: create some, or choose other poses")
    rest = [Matrix.Identity(4)] * len(armature.pose.bones)
    with _restored(armature):
        for action in actions[:: math.ceil(len(actions) / most)]:
            for bone, matrix in zip(armature.pose.bones, rest, strict=True):
                bone.matrix_basis = matrix
            armature.pose.apply_pose_from_action(action)
            bpy.context.view_layer.update()
            yield action.name


def _shown(armature: bpy.types.Object, frames: Sequence[int], most: int) -> Iterator[int]:
    """Show these frames, at most so many, evenly chosen."""
    scene = bpy.context.scene
    before = scene.frame_current, scene.frame_subframe
    with _restored(armature):
        try:
            for frame in frames[:: math.ceil(len(frames) / most)]:
                scene.frame_set(frame)
                yield frame
        finally:
            scene.frame_set(before[0], subframe=before[1])


def recorded(armature: bpy.types.Object, bones: Sequence[str], basis: NDArray[np.floating]) -> Iterator[int]:
    """Give the bones (B,) their matrices `basis` (P, B, 4, 4), one pose after the other; yields its number."""
    with _restored(armature):
        for number, matrices in enumerate(basis):
            for name, matrix in zip(bones, matrices, strict=True):
                armature.pose.bones[name].matrix_basis = Matrix(matrix.tolist())
            bpy.context.view_layer.update()
            yield number


def frames(numbers: Sequence[int]) -> Iterator[int]:
    """Show frames of the scene one after the other; yields how many have been shown before."""
    scene = bpy.context.scene
    before = scene.frame_current, scene.frame_subframe
    try:
        for number, frame in enumerate(numbers):
            scene.frame_set(frame)
            yield number
    finally:
        scene.frame_set(before[0], subframe=before[1])


def take(obj: bpy.types.Object, bones: Sequence[str], pose_from_rest: NDArray[np.floating]) -> None:
    """Pose the armatures of `obj` so that each bone (B,) moves the world as its matrix (B, 4, 4) says.

    Raises SceneError, with the pose as before, where constraints or drivers keep bones from obeying.
    """
    rigs = scene_armature.rigs(obj)
    wanted = dict(zip(bones, pose_from_rest, strict=True))
    undo = [_saved(rig) for rig in rigs]
    try:
        for rig in rigs:
            _set_matrices(rig, wanted)
        now = scene_armature.world_pose(rigs, list(bones))
        size = max(rig.dimensions.length for rig in rigs)
        astray = [b for b, pose in zip(bones, now, strict=True) if np.abs(pose - wanted[b]).max() > 1e-3 * max(size, 1)]
        if astray:
            raise SceneError(
                f"{len(astray)} bones of {rigs[0].name}, {astray[0]} for one, follow constraints or drivers and cannot "
                "be put into this pose: the overlay Faults shows the offenders all the same"
            )
    except BaseException:
        for restore in undo:
            restore()
        raise


def _set_matrices(rig: bpy.types.Object, wanted: dict[str, NDArray[np.floating]]) -> None:
    """Set the pose of the bones that are wanted, level by level, as a bone's matrix builds on that of its parent."""
    for bone in rig.pose.bones:
        bone.matrix_basis = Matrix.Identity(4)
    rig.data.pose_position = "POSE"
    world = np.array(rig.matrix_world)
    levels: dict[int, list[bpy.types.PoseBone]] = {}
    for bone in rig.pose.bones:
        if bone.name in wanted:
            levels.setdefault(len(bone.bone.parent_recursive), []).append(bone)
    bpy.context.view_layer.update()
    for level in sorted(levels):
        for bone in levels[level]:
            rest = np.array(bone.bone.matrix_local)
            bone.matrix = Matrix((np.linalg.inv(world) @ wanted[bone.name] @ world @ rest).tolist())
        bpy.context.view_layer.update()


@contextmanager
def at_rest(armature: bpy.types.Object) -> Iterator[None]:
    """Show the rest pose for the moment."""
    position = armature.data.pose_position
    armature.data.pose_position = "REST"
    bpy.context.view_layer.update()
    try:
        yield
    finally:
        armature.data.pose_position = position
        bpy.context.view_layer.update()


@contextmanager
def _restored(armature: bpy.types.Object) -> Iterator[None]:
    """Bring back every channel of every bone, bit for bit, and let the pose be shown meanwhile."""
    restore = _saved(armature)
    armature.data.pose_position = "POSE"
    try:
        yield
    finally:
        restore()


def _saved(armature: bpy.types.Object) -> Callable[[], None]:
    """What brings the pose back, bit for bit."""
    bones = armature.pose.bones
    before = [[tuple(getattr(bone, channel)) for channel in _CHANNELS] for bone in bones]
    position = armature.data.pose_position

    def restore() -> None:
        for bone, values in zip(bones, before, strict=True):
            for channel, value in zip(_CHANNELS, values, strict=True):
                setattr(bone, channel, value)
        armature.data.pose_position = position
        bpy.context.view_layer.update()

    return restore


def _curves(armature: bpy.types.Object) -> list[bpy.types.FCurve]:
    """Of the armature's action, which since Blender 4.4 has layers and slots, and since 5.0 nothing else."""
    data = armature.animation_data
    action = data.action if data else None
    if action is None:
        return []
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    strips = [strip for layer in action.layers for strip in layer.strips]
    bags = [strip.channelbag(data.action_slot) for strip in strips if data.action_slot]
    return [curve for bag in bags if bag for curve in bag.fcurves]
