"""A long transfer shows its progress, Esc stops it with nothing written, left alone it ends; then the redo panel."""

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
    _, figure, garment = dress.build(100_000, 60)
    bpy.context.scene.skinwright.transfer.source = figure
    bpy.context.scene.skinwright.transfer.smoothing_iterations = 150
    # Without a graphics card, drawing the mesh once takes as long as the transfer.
    figure.display_type = garment.display_type = "BOUNDS"
    with window.context():
        bpy.ops.ed.undo_push(message="Scene")
    yield from window.show_tab("Weights")
    look(window)
    yield 0.5
    window.event("MOUSEMOVE")
    yield 0.3

    with window.context():
        assert bpy.ops.skinwright.transfer_weights("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    runner = jobs.running
    window.key("ESC")
    yield from until(lambda: jobs.running is None)
    assert runner.result is None and not garment.vertex_groups, "Esc came too late or something was written"

    # A script deletes the target meanwhile: a sentence, and nothing goes on.
    copy = garment.copy()
    copy.data = garment.data.copy()
    bpy.context.collection.objects.link(copy)
    bpy.context.view_layer.update()
    for other in (copy, garment):
        other.select_set(other == copy)
    bpy.context.view_layer.objects.active = copy
    with window.context():
        assert bpy.ops.skinwright.transfer_weights("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    bpy.data.objects.remove(copy)
    yield from until(lambda: jobs.running is None, 60)
    last = import_module(f"{EXTENSION}.reporting").last
    assert last.failed and "was deleted meanwhile, so nothing was written" in last.sentence, last
    window.key("ESC")  # the error's popup
    yield 0.3
    garment.select_set(True)
    bpy.context.view_layer.objects.active = garment

    with window.context():
        bpy.ops.skinwright.transfer_weights("INVOKE_DEFAULT", True)
    seen = []
    shot = False
    while jobs.running is not None:
        seen.append(jobs.running.progress)
        if not shot and seen[-1] > 0:
            window.shoot("progress")
            shot = True
        yield 0.02
    assert seen == sorted(seen) and seen[-1] > 0, seen
    assert len(garment.vertex_groups) > 10
    record["progress"] = seen

    _, figure, garment = dress.build(2500)
    bpy.context.scene.skinwright.transfer.source = figure
    bpy.context.scene.skinwright.transfer.smoothing_iterations = 0
    bpy.context.scene.skinwright.overlay.kind = "INFLUENCES"
    look(window)
    yield 0.3
    with window.context():
        bpy.ops.ed.undo_push(message="Scene")
        assert bpy.ops.skinwright.transfer_weights("INVOKE_DEFAULT", True) == {"FINISHED"}
    assert most_influences() > 1
    yield 0.5
    with window.context():
        bpy.context.window_manager.operators[-1].properties.max_influences = 1
        bpy.ops.ed.undo_redo()
    yield 0.5
    assert most_influences() == 1, "changing the redo panel did not repeat the transfer"
    window.event("MOUSEMOVE")
    yield 0.2
    with window.context():
        bpy.ops.screen.redo_last("INVOKE_DEFAULT")
    yield from window.screenshot("redo_panel")
    garment = bpy.data.objects["Dress"]
    with window.context():
        bpy.ops.skinwright.check_weights("INVOKE_DEFAULT", True)
    record["selected"] = sum(vertex.select for vertex in garment.data.vertices)


def most_influences() -> int:
    return max(map(len, dress.weights("Dress")))


start(steps)
