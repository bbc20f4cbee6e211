"""A figure of two legs and hips on a small rig, and garments for it; metres, facing -Y, its left is +X."""

import bpy
import builders
import numpy as np
from mathutils import Matrix

BONES = ["Hips", "Leg.L", "Shin.L", "Leg.R", "Shin.R"]
_ENDS = {
    "Hips": ((0, 0, 1.0), (0, 0, 1.3), None),
    "Leg.L": ((0.12, 0, 1.0), (0.12, 0, 0.5), "Hips"),
    "Shin.L": ((0.12, 0, 0.5), (0.12, 0, 0), "Leg.L"),
    "Leg.R": ((-0.12, 0, 1.0), (-0.12, 0, 0.5), "Hips"),
    "Shin.R": ((-0.12, 0, 0.5), (-0.12, 0, 0), "Leg.R"),
}


def rig(names=None, name: str = "Rig") -> bpy.types.Object:
    """The rig; `names` maps the plain names of BONES to others."""
    names = names or {}
    ends = {names.get(bone, bone): (head, tail, names.get(up, up)) for bone, (head, tail, up) in _ENDS.items()}
    return bones(ends, name)


def bones(ends: dict, name: str = "Rig") -> bpy.types.Object:
    """An armature of bones {name: (head, tail, parent or None)}."""
    armature = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    bpy.context.collection.objects.link(armature)
    builders.select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    for bone, (head, tail, parent) in ends.items():
        edit_bone = armature.data.edit_bones.new(bone)
        edit_bone.head, edit_bone.tail = head, tail
        if parent:
            edit_bone.parent = armature.data.edit_bones[parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def tube(x: float, low: float, high: float, radius, n: int = 24, rings: int = 20):
    """Vertices (V, 3) and quads of an upright open tube; `radius` below and above, or one for both."""
    r0, r1 = np.broadcast_to(radius, 2)
    t, a = np.linspace(0, 1, rings + 1), 2 * np.pi * np.arange(n) / n
    r = (r0 + (r1 - r0) * t)[:, None]
    z = np.broadcast_to((low + (high - low) * t)[:, None], (rings + 1, n))
    positions = np.stack([x + r * np.cos(a), r * np.sin(a), z], axis=-1).reshape(-1, 3)
    first, k = np.arange(rings * n), np.tile((np.arange(n) + 1) % n, rings)
    ring = first // n * n
    return positions, np.stack([first, ring + k, ring + n + k, first + n], axis=1)


def joined(*parts):
    """Several (vertices, faces) as one."""
    positions, faces, start = [], [], 0
    for vertices, quads in parts:
        positions.append(vertices)
        faces += [[int(i) + start for i in quad] for quad in quads]
        start += len(vertices)
    return np.concatenate(positions), faces


def weights_at(positions) -> np.ndarray:
    """(V, 5) a plain symmetric skinning of points, over BONES."""
    x, _, z = np.asarray(positions, float).T
    hips, shin = _step((z - 0.9) / 0.2), 1 - _step((z - 0.42) / 0.16)
    left = _step((x + 0.02) / 0.04)
    columns = [hips]
    for side in (left, 1 - left):
        columns += [(1 - hips) * side * (1 - shin), (1 - hips) * side * shin]
    return np.stack(columns, axis=1)


def _step(t):
    t = np.clip(t, 0, 1)
    return t * t * (3 - 2 * t)


def paint(obj: bpy.types.Object, weights, names=BONES) -> None:
    """Weights (V, B) over `names`; 0 is no member."""
    for name, column in zip(names, np.asarray(weights).T, strict=True):
        group = obj.vertex_groups.get(name) or obj.vertex_groups.new(name=name)
        for value in np.unique(column[column > 0]).tolist():
            group.add(np.flatnonzero(column == value).tolist(), value, "REPLACE")


def bind(obj: bpy.types.Object, armature: bpy.types.Object) -> bpy.types.ArmatureModifier:
    """An Armature modifier."""
    modifier = obj.modifiers.new("Armature", "ARMATURE")
    modifier.object = armature
    return modifier


def body(armature: bpy.types.Object | None = None, names=BONES) -> bpy.types.Object:
    """The figure, weighted and bound."""
    positions, faces = joined(
        tube(0.12, 0, 1.0, (0.08, 0.1)), tube(-0.12, 0, 1.0, (0.08, 0.1)), tube(0, 0.95, 1.3, (0.24, 0.2), 48, 10)
    )
    obj = builders.mesh("Body", positions, faces)
    paint(obj, weights_at(positions), names)
    bind(obj, armature or rig())
    return obj


def trousers(name: str = "Trousers", low: float = 0.05, high: float = 0.98) -> bpy.types.Object:
    """Two tubes a centimetre off the legs."""
    return builders.mesh(name, *joined(tube(0.12, low, high, (0.09, 0.11)), tube(-0.12, low, high, (0.09, 0.11))))


def skirt(name: str = "Skirt", n: int = 64, rings: int = 24) -> bpy.types.Object:
    """One wide tube, half of it too far from the legs to match."""
    return builders.mesh(name, *tube(0, 0.45, 1.2, (0.34, 0.25), n, rings))


def part(obj: bpy.types.Object, name: str, keep) -> bpy.types.Object:
    """A mesh of the faces whose centre `keep` takes, with the weights of `obj`."""
    positions = rest(obj)
    faces = [list(p.vertices) for p in obj.data.polygons if keep(positions[list(p.vertices)].mean(axis=0))]
    used = sorted({i for face in faces for i in face})
    number = {i: k for k, i in enumerate(used)}
    made = builders.mesh(name, positions[used], [[number[i] for i in face] for face in faces])
    names = [group.name for group in obj.vertex_groups]
    if names:
        paint(made, builders.dense(obj, names)[used], names)
    return made


def rest(obj: bpy.types.Object) -> np.ndarray:
    """(V, 3) the mesh's own positions in the world."""
    bpy.context.view_layer.update()
    return np.array([obj.matrix_world @ v.co for v in obj.data.vertices])


def shown(obj: bpy.types.Object) -> np.ndarray:
    """(V, 3) evaluated positions in the world."""
    bpy.context.view_layer.update()
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([evaluated.matrix_world @ v.co for v in evaluated.data.vertices])


def turn(armature: bpy.types.Object, bone: str, degrees: float, axis: str = "X") -> None:
    """Turn a bone about a world axis through its head."""
    bpy.context.view_layer.update()
    pose = armature.pose.bones[bone]
    now = armature.matrix_world @ pose.matrix
    head = Matrix.Translation(now.translation)
    turned = head @ Matrix.Rotation(np.radians(degrees), 4, axis) @ head.inverted() @ now
    pose.matrix = armature.matrix_world.inverted() @ turned
    bpy.context.view_layer.update()


def blended(armature: bpy.types.Object, positions, weights, names=BONES) -> np.ndarray:
    """(V, 3) where linear blending of these weights takes points, by NumPy alone."""
    world = np.array(armature.matrix_world)
    homogeneous = np.c_[positions, np.ones(len(positions))]
    moved = np.zeros((len(positions), 3))
    for name, column in zip(names, np.asarray(weights).T, strict=True):
        bone = armature.pose.bones[name]
        matrix = world @ np.array(bone.matrix @ bone.bone.matrix_local.inverted()) @ np.linalg.inv(world)
        moved += column[:, None] * (homogeneous @ matrix.T)[:, :3]
    return moved
