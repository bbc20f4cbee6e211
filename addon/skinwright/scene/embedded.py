"""Armatures made from other armatures with their bones in other places."""

from collections.abc import Mapping

import bpy
import numpy as np
from mathutils import Quaternion, Vector
from numpy.typing import NDArray

from . import editable
from .rest_bones import RestBones

CONFIDENCE = "skinwright_confidence"


def create(
    context: bpy.types.Context,
    name: str,
    source: bpy.types.Object,
    bones: RestBones,
    places: Mapping[str, tuple[NDArray[np.float32], NDArray[np.float32]]],
) -> bpy.types.Object:
    """A copy of armature `source` at the world's origin, each bone with its head and tail at `places`.

    Rolls follow the bones: each is turned as its direction is.
    """
    data = source.data.copy()
    data.name = name
    rig = bpy.data.objects.new(name, data)
    try:
        editable.collection(context).objects.link(rig)
        _shape(context, rig, bones, places)
    except BaseException:
        remove(rig)
        raise
    return rig


def remove(rig: bpy.types.Object) -> None:
    """Take an armature away that was made here."""
    data = rig.data
    bpy.data.objects.remove(rig)
    if data.users == 0:
        bpy.data.armatures.remove(data)


def _shape(
    context: bpy.types.Context,
    rig: bpy.types.Object,
    bones: RestBones,
    places: Mapping[str, tuple[NDArray[np.float32], NDArray[np.float32]]],
) -> None:
    """Place the bones in Edit mode; mode, selection and active object are then as before."""
    before, selected = context.view_layer.objects.active, list(context.selected_objects)
    if context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        _place(rig.data, bones, places)
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
        context.view_layer.objects.active = before
        for obj in selected:
            obj.select_set(True)


def _place(
    data: bpy.types.Armature,
    bones: RestBones,
    places: Mapping[str, tuple[NDArray[np.float32], NDArray[np.float32]]],
) -> None:
    axes = dict(zip(bones.names, bones.frames, strict=True))
    for bone in data.edit_bones:
        # Connected bones share a joint, and moving one end would move the other; symmetry would do the same.
        bone.use_connect = False
    for bone in data.edit_bones:
        head, tail = (Vector([float(x) for x in place]) for place in places[bone.name])
        if (tail - head).length < 1e-6:
            tail = head + Vector([float(x) for x in axes[bone.name][:3, 1]]) * 1e-3
        bone.head, bone.tail = head, tail
        old = Vector([float(x) for x in axes[bone.name][:3, 1]])
        up = Vector([float(x) for x in axes[bone.name][:3, 2]])
        turn: Quaternion = old.rotation_difference(tail - head)
        bone.align_roll(turn @ up)


def mark(rig: bpy.types.Object, confidence: Mapping[str, float], chosen: set[str]) -> None:
    """Keep the confidence of each bone as a custom property, and select the bones `chosen`."""
    for bone in rig.pose.bones:
        bone[CONFIDENCE] = round(confidence[bone.name], 3)
        owner = bone if bpy.app.version >= (5, 0, 0) else bone.bone
        owner.select = bone.name in chosen
