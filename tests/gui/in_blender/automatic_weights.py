"""Automatic weights from the parent menu's entry: progress, Esc with nothing written, the result, and one undo step."""

import sys
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import dress
from driver import EXTENSION, Steps, Window, enable, record, start, until
from painting import look

# Fine enough that Esc finds the work going on, on a fast machine too.
FINE = 256


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    jobs = import_module(f"{EXTENSION}.jobs")
    rig, _, garment = dress.build(60_000, 40)
    garment.modifiers.clear()
    garment.display_type = "BOUNDS"
    with window.context():
        bpy.ops.ed.undo_push(message="Scene")
    yield from window.show_tab("Weights")
    look(window)
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in (rig, garment))
    bpy.context.view_layer.objects.active = rig
    window.event("MOUSEMOVE")
    yield 0.3

    with window.context():
        assert bpy.ops.skinwright.automatic_weights("INVOKE_DEFAULT", resolution=FINE) == {"RUNNING_MODAL"}
    runner = jobs.running
    window.key("ESC")
    yield from until(lambda: jobs.running is None)
    assert runner.result is None and untouched(garment), "Esc came too late or something was written"

    with window.context():
        assert bpy.ops.skinwright.automatic_weights("INVOKE_DEFAULT", True, resolution=FINE) == {"RUNNING_MODAL"}
    seen, shot = [], False
    while jobs.running is not None:
        seen.append(jobs.running.progress)
        if not shot and seen[-1] > 0:
            window.shoot("progress")
            shot = True
        yield 0.02
    assert seen == sorted(seen) and seen[-1] > 0, seen
    record["progress"] = seen
    garment = bpy.data.objects["Dress"]
    record["groups"] = len(garment.vertex_groups)
    assert garment.parent == bpy.data.objects[rig.name] and [m.type for m in garment.modifiers] == ["ARMATURE"]

    yield 0.5
    window.event("MOUSEMOVE")
    window.key("Z", ctrl=True)
    yield from until(lambda: untouched(bpy.data.objects["Dress"]))
    window.key("Z", ctrl=True, shift=True)
    yield from until(lambda: len(bpy.data.objects["Dress"].vertex_groups) == record["groups"])


def untouched(obj: bpy.types.Object) -> bool:
    return not obj.vertex_groups and not obj.modifiers and obj.parent is None


start(steps)
