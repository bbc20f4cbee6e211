"""A figure with a spine of bones and a dress that fits at the top, flares below, and has a loose buckle."""

from __future__ import annotations

import bpy
import numpy as np

HEIGHT = 2.0


def tube(name: str, radius: np.ndarray, low: float, high: float, around: int) -> bpy.types.Object:
    """A tube of one ring a radius, from `low` to `high`."""
    rings = len(radius)
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    z = np.linspace(low, high, rings)
    positions = np.stack(
        [np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle)), np.repeat(z[:, None], around, 1)], axis=-1
    ).reshape(-1, 3)
    ring, side = np.arange(rings - 1)[:, None] * around, np.arange(around)
    following = (side + 1) % around
    quads = np.stack([ring + side, ring + following, ring + around + following, ring + around + side], axis=-1)
    return from_arrays(name, positions, quads.reshape(-1, 4))


def from_arrays(name: str, positions: np.ndarray, quads: np.ndarray) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", positions.astype(np.float32).ravel())
    mesh.loops.add(quads.size)
    mesh.loops.foreach_set("vertex_index", quads.astype(np.int32).ravel())
    mesh.polygons.add(len(quads))
    mesh.polygons.foreach_set("loop_start", np.arange(0, quads.size, 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    mesh.validate()
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(obj)
    return obj


def rig(bones: int) -> bpy.types.Object:
    armature = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    parent = None
    for bone in range(bones):
        edit_bone = armature.data.edit_bones.new(f"Spine.{bone}")
        edit_bone.head, edit_bone.tail = (0, 0, bone * HEIGHT / bones), (0, 0, (bone + 1) * HEIGHT / bones)
        edit_bone.parent, parent = parent, edit_bone
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def body(armature: bpy.types.Object, bones: int) -> bpy.types.Object:
    obj = tube("Body", np.full(100, 0.3), 0.0, HEIGHT, 100)
    z = np.repeat(np.linspace(0, HEIGHT, 100), 100)
    for bone in range(bones):
        weight = np.clip(1 - np.abs(z / HEIGHT * bones - bone - 0.5), 0, 1)
        group = obj.vertex_groups.new(name=f"Spine.{bone}")
        for value in np.unique(weight[weight > 0]):
            group.add(np.flatnonzero(weight == value).tolist(), float(value), "REPLACE")
    obj.modifiers.new("Armature", "ARMATURE").object = armature
    return obj


def dress(vertices: int) -> bpy.types.Object:
    """About so many vertices, a third of them too far from the body; the last four are the buckle."""
    rings = around = round(vertices**0.5)
    t = np.linspace(0, 1, rings)
    flare = np.clip(0.45 - t, 0, None) * 0.9
    obj = tube("Dress", 0.32 + flare, 0.25, 1.8, around)
    buckle = from_arrays(
        "Buckle",
        np.array([(-0.1, -0.62, 1.2), (0.1, -0.62, 1.2), (0.1, -0.62, 1.35), (-0.1, -0.62, 1.35)]),
        np.array([[0, 1, 2, 3]]),
    )
    bpy.context.view_layer.update()  # else its list may be that of some time ago
    for other in bpy.context.view_layer.objects:
        other.select_set(other in (obj, buckle))
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.join()
    return obj


def build(vertices: int = 2500, bones: int = 4) -> tuple[bpy.types.Object, bpy.types.Object, bpy.types.Object]:
    """Replaces what is in the scene; gives armature, body and dress, the dress active."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    armature = rig(bones)
    figure = body(armature, bones)
    garment = dress(vertices)
    garment.modifiers.new("Armature", "ARMATURE").object = armature
    return armature, figure, garment


def weights(name: str) -> list[dict[str, float]]:
    """By the public API, so that what the add-on remembers cannot be taken for what is there."""
    obj = bpy.data.objects[name]
    names = [group.name for group in obj.vertex_groups]
    return [{names[member.group]: member.weight for member in vertex.groups} for vertex in obj.data.vertices]
