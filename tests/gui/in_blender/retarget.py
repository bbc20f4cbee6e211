"""Retargeting from the panel: bone map, landmarks, colours, undo and redo; Esc stops it with nothing written."""

import sys
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import dress
import numpy as np
from driver import EXTENSION, Steps, Window, enable, record, start, until
from painting import look
from panels import open_only, ours

BONES = 6


def other_character(rings: int, around: int, place: float) -> bpy.types.Object:
    """A thinner and taller figure with the same bones and no weights."""
    rig = bpy.data.objects["Rig"].copy()
    rig.data = rig.data.copy()
    rig.name = "Other Rig"
    bpy.context.collection.objects.link(rig)
    mesh = dress.tube("Other", np.full(rings, 0.2), 0.0, dress.HEIGHT, around)
    for obj in (rig, mesh):
        obj.scale[2] = 1.2
        obj.location[0] = place
    mesh.modifiers.new("Armature", "ARMATURE").object = rig
    bpy.context.view_layer.update()
    return mesh


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    _, figure, garment = dress.build(2500, BONES)
    bpy.data.objects.remove(garment)
    other = other_character(60, 40, 1.2)
    settings = bpy.context.scene.skinwright.retarget
    settings.source = bpy.data.objects["Rig"]
    settings.method, settings.show_correspondence = "BIHARMONIC", True
    for obj in bpy.data.objects:
        obj.select_set(obj == other)
    bpy.context.view_layer.objects.active = other
    open_only("retarget_panel", ours())
    yield from window.show_tab("Weights")
    look(window)
    yield 0.5
    with window.context():
        assert bpy.ops.skinwright.match_bones() == {"FINISHED"}
        assert bpy.ops.skinwright.landmark_add() == {"FINISHED"}
        entry = settings.landmarks.add()
        entry.name = "Chin"
        entry.put("source", figure, 17)
        bpy.data.objects["Landmark 1 Source"].location = (0.3, 0, 1)
        bpy.data.objects["Landmark 1 Target"].location = (1.4, 0, 1.2)
        other.select_set(True)
        bpy.context.view_layer.objects.active = other
        bpy.ops.ed.undo_push(message="Scene")
        assert bpy.ops.skinwright.retarget_weights("INVOKE_DEFAULT", True) == {"FINISHED"}
    assert len(other.vertex_groups) == BONES
    assert window.area.spaces.active.shading.color_type == "VERTEX"
    yield from window.screenshot("retarget")
    window.event("MOUSEMOVE")
    yield 0.2
    window.key("Z", ctrl=True)
    yield from until(lambda: not bpy.data.objects["Other"].vertex_groups)
    assert "Correspondence" not in bpy.data.objects["Other"].data.attributes
    window.key("Z", ctrl=True, shift=True)
    yield from until(lambda: len(bpy.data.objects["Other"].vertex_groups) == BONES)

    large = other_character(800, 150, 3.0)
    large.display_type = "BOUNDS"
    bpy.context.scene.skinwright.retarget.method = "SKELETON"
    for obj in bpy.data.objects:
        obj.select_set(obj == large)
    bpy.context.view_layer.objects.active = large
    yield 0.3
    jobs = import_module(f"{EXTENSION}.jobs")
    with window.context():
        assert bpy.ops.skinwright.retarget_weights("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    runner = jobs.running
    window.key("ESC")
    yield from until(lambda: jobs.running is None, 60)
    assert runner.result is None and not large.vertex_groups, "Esc came too late or something was written"
    record["bones"] = len(bpy.context.scene.skinwright.retarget.bone_map)


if __name__ == "__main__":
    start(steps)
