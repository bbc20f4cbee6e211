"""Test poses: an armature is put into each in turn, and afterwards is as it was."""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from .error import SceneError

_CHANNELS = ("location", "rotation_quaternion", "rotation_euler", "rotation_axis_angle", "scale")
# About the bone's own axes: bent both ways, bent sideways both ways, twisted.
_BENDS = (("X", 1), ("X", -1), ("Z", 1), ("Z", -1), ("Y", 1))


def range_of_motion(armature: bpy.types.Object, bones: Iterable[str], angle: float) -> Iterator[str]:
    """Bend the bones by `angle` (radians), those equally deep in the hierarchy together; yields each pose's name."""
    levels: dict[int, list[str]] = {}
    for name in bones:
        levels.setdefault(len(armature.data.bones[name].parent_recursive), []).append(name)
    with _restored(armature):
        for level in sorted(levels):
            for axis, sign in _BENDS:
                for bone in armature.pose.bones:
                    bone.matrix_basis = Matrix.Identity(4)
                for name in levels[level]:
                    armature.pose.bones[name].matrix_basis = Matrix.Rotation(sign * angle, 4, axis)
                bpy.context.view_layer.update()
                yield f"level {level + 1} of the bones, {sign * math.degrees(angle):+.0f}° about {axis}"


def keyframes(armature: bpy.types.Object, most: int) -> Iterator[str]:
    """The frames that have keys, at most so many, evenly chosen; yields "frame N"."""
    scene = bpy.context.scene
    frames = sorted({round(key.co[0]) for curve in _curves(armature) for key in curve.keyframe_points})
    if not frames:
        raise SceneError(f"{armature.name} has no keyframes: give it an action, or choose Range of Motion")
    before = scene.frame_current, scene.frame_subframe
    with _restored(armature):
        try:
            for frame in frames[:: math.ceil(len(frames) / most)]:
                scene.frame_set(frame)
                yield f"frame {frame}"
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
    bones = armature.pose.bones
    before = [[tuple(getattr(bone, channel)) for channel in _CHANNELS] for bone in bones]
    position = armature.data.pose_position
    armature.data.pose_position = "POSE"
    try:
        yield
    finally:
        for bone, values in zip(bones, before, strict=True):
            for channel, value in zip(_CHANNELS, values, strict=True):
                setattr(bone, channel, value)
        armature.data.pose_position = position
        bpy.context.view_layer.update()


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
