"""Small characters and garments, built in Blender."""

import bpy
import numpy as np


def mesh(name: str, positions, faces) -> bpy.types.Object:
    """An object of these vertices and faces, linked to the scene and selected by nobody."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(np.asarray(positions, float).tolist(), [], [list(map(int, face)) for face in faces])
    obj = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(obj)
    return obj


def grid(name: str, n: int = 8, size: float = 2.0, z: float = 0.0, quads: bool = True) -> bpy.types.Object:
    """A square of n x n vertices around the origin in the plane z, facing up."""
    x, y = np.meshgrid(*[np.linspace(-size / 2, size / 2, n)] * 2)
    positions = np.stack([x.ravel(), y.ravel(), np.full(n * n, z)], axis=1)
    first = (np.arange(n - 1)[None] + n * np.arange(n - 1)[:, None]).ravel()
    faces = np.stack([first, first + 1, first + n + 1, first + n], axis=1)
    if not quads:
        faces = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    return mesh(name, positions, faces)


def rig(name: str = "Rig", bones=("Arm.L", "Arm.R"), controls=("Control",)) -> bpy.types.Object:
    """An armature of upright bones along x; `controls` do not deform."""
    armature = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    bpy.context.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for index, bone in enumerate((*bones, *controls)):
        edit_bone = armature.data.edit_bones.new(bone)
        edit_bone.head, edit_bone.tail = (index, 0, 0), (index, 0, 1)
        edit_bone.use_deform = bone in bones
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def paint(obj: bpy.types.Object, **weights) -> None:
    """Groups with one weight a vertex; NaN stands for not a member. `__` in a name stands for a dot."""
    for name, values in weights.items():
        group = obj.vertex_groups.new(name=name.replace("__", "."))
        for index, value in enumerate(np.broadcast_to(values, len(obj.data.vertices)).tolist()):
            if value == value:
                group.add([index], value, "REPLACE")


def weights(obj: bpy.types.Object) -> list[dict[str, float]]:
    """What every vertex has, by the plainest way there is."""
    names = [group.name for group in obj.vertex_groups]
    return [{names[g.group]: g.weight for g in vertex.groups} for vertex in obj.data.vertices]


def dense(obj: bpy.types.Object, names) -> np.ndarray:
    """(V, len(names)) weights, 0 where not a member."""
    return np.array([[row.get(name, 0.0) for name in names] for row in weights(obj)])


def body(n: int = 12, armature: bpy.types.Object | None = None) -> bpy.types.Object:
    """A grid whose weights go from Arm.R at x = -1 to Arm.L at x = 1, with a group `pin` that is no bone."""
    armature = armature or rig()
    obj = grid("Body", n)
    t = np.array([v.co.x for v in obj.data.vertices]) / 2 + 0.5
    paint(obj, Arm__L=t, Arm__R=1 - t, pin=t * t)
    modifier = obj.modifiers.new("Armature", "ARMATURE")
    modifier.object = armature
    return obj


def limb(name, *, around=6, along=6, length=2.0, bones=("Upper", "Lower"), bound=True):
    """A capped tube along x on a chain of bones; with `bound`, weighted to them. Returns (mesh, armature)."""
    rig = bpy.data.objects.new(f"{name} Rig", bpy.data.armatures.new(f"{name} Rig"))
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    ends = np.linspace(0, length, len(bones) + 1)
    for index, bone in enumerate(bones):
        made = rig.data.edit_bones.new(bone)
        made.head, made.tail = (ends[index], 0, 0), (ends[index + 1], 0, 0)
        made.parent = rig.data.edit_bones.get(bones[index - 1]) if index else None
    bpy.ops.object.mode_set(mode="OBJECT")
    x, angle = np.linspace(0, length, along + 1), np.arange(around) * 2 * np.pi / around
    positions = [(u, 0.25 * np.cos(a), 0.25 * np.sin(a)) for u in x for a in angle] + [(0, 0, 0), (length, 0, 0)]
    faces, tips = [], (len(positions) - 2, len(positions) - 1)
    for j in range(around):
        k = (j + 1) % around
        faces += [(i * around + k, (i + 1) * around + k, (i + 1) * around + j, i * around + j) for i in range(along)]
        faces += [(tips[0], k, j), (tips[1], along * around + j, along * around + k)]
    obj = mesh(name, positions, faces)
    if bound:
        middle = (ends[:-1] + ends[1:]) / 2
        share = np.exp(-8 * (np.array(positions)[:, :1] - middle) ** 2)
        share /= share.sum(axis=1, keepdims=True)
        paint(obj, **{bone.replace(".", "__"): share[:, j] for j, bone in enumerate(bones)})
        obj.modifiers.new("Armature", "ARMATURE").object = rig
    return obj, rig


def select(*objects: bpy.types.Object) -> None:
    """Select these alone; the last becomes active."""
    bpy.context.view_layer.update()  # else its list may be that of some time ago
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[-1] if objects else None


def select_bone(armature: bpy.types.Object, name: str, chosen: bool) -> None:
    """Select a bone or not; the flag moved to the pose bone in Blender 5.0."""
    owner = armature.pose.bones[name] if bpy.app.version >= (5, 0, 0) else armature.data.bones[name]
    owner.select = chosen
