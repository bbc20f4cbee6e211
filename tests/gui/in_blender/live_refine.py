"""Live refinement of a bent limb under a sleeve with transferred weights: posing, undo, playing, loading, deletion."""

import sys
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import numpy as np
from driver import EXTENSION, SHARE, Steps, Window, enable, record, start, until

AROUND, ALONG = 24, 40


def tube(name: str, radius: float, reach: float) -> bpy.types.Object:
    """A capped tube along X."""
    x = np.linspace(-reach, reach, ALONG + 1)
    angle = np.arange(AROUND) * 2 * np.pi / AROUND
    positions = [(u, radius * np.cos(a), radius * np.sin(a)) for u in x for a in angle]
    positions += [(-reach, 0, 0), (reach, 0, 0)]
    faces, ends = [], (len(positions) - 2, len(positions) - 1)
    for j in range(AROUND):
        k = (j + 1) % AROUND
        rows = [(i * AROUND, (i + 1) * AROUND) for i in range(ALONG)]
        faces += [(a + j, b + j, b + k, a + k) for a, b in rows]
        faces += [(ends[0], j, k), (ends[1], ALONG * AROUND + k, ALONG * AROUND + j)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(positions, [], faces)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(obj)
    return obj


def build() -> tuple[bpy.types.Object, bpy.types.Object, bpy.types.Object]:
    """Limb, its armature, and a sleeve around the joint without weights."""
    for other in list(bpy.data.objects):
        bpy.data.objects.remove(other)
    limb, sleeve = tube("Limb", 0.25, 1.0), tube("Sleeve", 0.27, 0.6)
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    upper, lower = (rig.data.edit_bones.new(name) for name in ("Upper", "Lower"))
    upper.head, upper.tail, lower.head, lower.tail = (-1, 0, 0), (0, 0, 0), (0, 0, 0), (1, 0, 0)
    lower.parent = upper
    bpy.ops.object.mode_set(mode="OBJECT")
    groups = [limb.vertex_groups.new(name=name) for name in ("Upper", "Lower")]
    for vertex in limb.data.vertices:
        t = min(max((vertex.co.x + 0.25) / 0.5, 0), 1)
        t = t * t * (3 - 2 * t)
        for group, value in zip(groups, (1 - t, t), strict=True):
            group.add([vertex.index], value, "REPLACE")
    limb.modifiers.new("Armature", "ARMATURE").object = rig
    rig.pose.bones["Lower"].rotation_mode = "XYZ"
    return limb, rig, sleeve


def only(*objects: bpy.types.Object) -> None:
    """Select these; the last is active."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[-1]


def moved(name: str) -> float:
    """How far the stand-in of a mesh is from what the Armature modifier shows."""
    stand_in = import_module(f"{EXTENSION}.scene.preview_object").of(name)
    if stand_in is None:
        return -1.0
    graph = bpy.context.evaluated_depsgraph_get()
    places = []
    for obj in (stand_in, bpy.data.objects[name]):
        mesh = obj.evaluated_get(graph).data
        places.append(np.empty(3 * len(mesh.vertices), np.float32))
        mesh.vertices.foreach_get("co", places[-1])
    return float(np.abs(places[0] - places[1]).max())


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    live = import_module(f"{EXTENSION}.refine.live")
    with window.context():
        limb, rig, sleeve = build()
        only(sleeve)
        bpy.context.scene.skinwright.transfer.source = limb
        assert bpy.ops.skinwright.transfer_weights() == {"FINISHED"}
        only(sleeve, limb)
        window.area.spaces.active.region_3d.view_perspective = "ORTHO"
        bpy.ops.view3d.view_axis(type="TOP")
        bpy.ops.view3d.view_all()
        window.area.spaces.active.region_3d.view_location.x += 0.6  # from under the sidebar
        bpy.ops.ed.undo_push(message="Scene")
        assert bpy.ops.skinwright.live_refine() == {"FINISHED"}
        only(rig)
        bpy.ops.object.mode_set(mode="POSE")
        # From Blender 5.0 on it is the pose bone that is selected.
        for bone in rig.pose.bones if bpy.app.version >= (5, 0, 0) else rig.data.bones:
            bone.select = bone.name == "Lower"
        rig.data.bones.active = rig.data.bones["Lower"]
        bpy.ops.ed.undo_push(message="Pose mode")
    yield from window.show_tab("Weights")
    yield from window.screenshot("rest")

    # Posing as an artist does: R Z 110 Enter.
    for key, sign in (("R", "r"), ("Z", "z"), ("ONE", "1"), ("ONE", "1"), ("ZERO", "0")):
        window.event(key, "PRESS", unicode=sign)
        window.event(key, "RELEASE")
        yield 0.15
    yield from window.screenshot("while_turning")
    record["while turning"] = moved("Limb")
    window.key("RET")
    yield 0.5
    yield from window.screenshot("posed")
    record["posed"], record["sleeve"] = moved("Limb"), moved("Sleeve")
    assert record["posed"] > 0.02 and record["sleeve"] > 0.01, record

    window.key("Z", ctrl=True)
    yield 0.8
    assert live.current is not None
    yield from until(lambda: 0 <= moved("Limb") < 1e-4)
    window.key("Z", ctrl=True, shift=True)
    yield 0.8
    yield from until(lambda: moved("Limb") > 0.02)
    yield from window.screenshot("redone")

    # Playing.
    rig = bpy.data.objects["Rig"]
    bone = rig.pose.bones["Lower"]
    for frame, degrees in ((1, 0), (20, 120), (40, 0)):
        bone.rotation_euler = (0, 0, np.radians(degrees))
        bone.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_end = 40
    seen = []
    with window.context():
        bpy.ops.screen.animation_play()
    for _ in range(30):
        yield 0.1
        seen.append((bpy.context.scene.frame_current, moved("Limb")))
    window.shoot("playing")
    with window.context():
        bpy.ops.screen.animation_cancel(restore_frame=False)
    record["played"] = seen
    assert len({frame for frame, _ in seen}) > 2 and max(by for _, by in seen) > 0.02, seen

    # Loading another file ends it; the saved one holds no stand-in.
    path = str(SHARE / "out" / "limb.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    yield 1.0
    assert live.current is None
    assert sorted(obj.name for obj in bpy.data.objects) == ["Limb", "Rig", "Sleeve"], list(bpy.data.objects)

    # So does deleting the mesh.
    with window.context():
        bpy.ops.object.mode_set(mode="OBJECT")
        only(bpy.data.objects["Limb"])
        assert bpy.ops.skinwright.live_refine() == {"FINISHED"}
        bpy.data.objects.remove(bpy.data.objects["Limb"])
        bpy.context.scene.frame_set(15)
    yield 0.5
    assert live.current is None
    assert sorted(obj.name for obj in bpy.data.objects) == ["Rig", "Sleeve"], list(bpy.data.objects)


if __name__ == "__main__":
    start(steps)
