"""Checking with a progress bar and Esc; the offenders over the mesh, the worst pose in the panel and on the figure."""

import sys
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import dress
from driver import EXTENSION, Steps, Window, enable, record, start, until
from painting import look


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    jobs = import_module(f"{EXTENSION}.jobs")
    shown = import_module(f"{EXTENSION}.check.shown")
    armature, figure, garment = dress.build(2500)
    bpy.context.scene.skinwright.transfer.source = figure
    yield from window.show_tab("Weights")
    look(window)
    yield 0.3
    with window.context():
        assert bpy.ops.skinwright.transfer_weights() == {"FINISHED"}
    group = garment.vertex_groups["Spine.1"]
    group.add(range(0, len(garment.data.vertices), 37), 1.0, "REPLACE")
    before = [vertex.select for vertex in garment.data.vertices]

    with window.context():
        bpy.ops.skinwright.check_weights("INVOKE_DEFAULT", True)
    assert jobs.running is not None, "the check was over before the window lived again"
    window.key("ESC")
    yield from until(lambda: jobs.running is None)
    assert shown.of(garment) is None, "Esc came too late"

    with window.context():
        bpy.ops.skinwright.check_weights("INVOKE_DEFAULT", True)
    yield from until(lambda: jobs.running is None, 60)
    result = shown.of(garment)
    assert result.any_fault().any() and result.worst
    assert [vertex.select for vertex in garment.data.vertices] == before
    bpy.context.scene.skinwright.overlay.kind = "FAULTS"
    window.region("UI").active_panel_category = "Weights"
    yield from window.screenshot("faults")
    with window.context():
        assert bpy.ops.skinwright.show_worst_pose() == {"FINISHED"}
    yield from window.screenshot("worst_pose")
    assert any(tuple(bone.rotation_quaternion) != (1, 0, 0, 0) for bone in armature.pose.bones)
    record["worst"] = result.worst.name


start(steps)
