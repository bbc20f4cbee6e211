"""Limbs of three bones with known weights: an armature and a tube, in one mesh or two."""

import bpy
import builders
import numpy as np

ARM = ("Upper.L", "Lower.L", "Hand.L")


def limb(name, names=ARM, *, length=3.0, radius=0.3, around=12, along=24, at=(0, 0, 0), part=None):
    """An armature of three bones along z and a tube on it; `part` keeps a share of the rings in a mesh of its own."""
    rig = bpy.data.objects.new(f"{name} Rig", bpy.data.armatures.new(name))
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    parent = None
    for index, bone in enumerate(names):
        edit_bone = rig.data.edit_bones.new(bone)
        edit_bone.head, edit_bone.tail = (0, 0, index * length / 3), (0, 0, (index + 1) * length / 3)
        edit_bone.parent, parent = parent, edit_bone
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.location = at
    parts = [(0, along)] if part is None else [(0, part), (part, along)]
    meshes = [_tube(f"{name} {k}", rig, length, radius, around, along, rings) for k, rings in enumerate(parts)]
    bpy.context.view_layer.update()
    return rig, meshes


def _tube(name, rig, length, radius, around, along, rings):
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    heights = np.linspace(0, length, along + 1)[rings[0] : rings[1] + 1]
    positions = [(radius * np.cos(a), 0.7 * radius * np.sin(a), z) for z in heights for a in angle]
    quad = [
        (k * around + s, k * around + (s + 1) % around, (k + 1) * around + (s + 1) % around, (k + 1) * around + s)
        for k in range(len(heights) - 1)
        for s in range(around)
    ]
    obj = builders.mesh(name, positions, quad)
    obj.parent = rig
    obj.modifiers.new("Armature", "ARMATURE").object = rig
    return obj


def truth(obj, length):
    """(V, 3): each bone's share falls linearly around the middle of its neighbours."""
    height = np.array([vertex.co.z for vertex in obj.data.vertices]) / length * 3
    shares = np.stack([np.clip(1 - abs(height - 0.5 - j), 0, 1) for j in range(3)], 1)
    shares[height < 0.5], shares[height > 2.5] = (1, 0, 0), (0, 0, 1)
    return shares


def error_of(obj, names, length):
    return 0.5 * np.abs(builders.dense(obj, names) - truth(obj, length)).sum(1)
