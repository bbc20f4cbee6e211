"""Blender is quit while something of ours goes on: `transfer`, `sculpt` or `mask`."""

import json
import sys
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import dress
import painting
import sculpting
from driver import EXTENSION, SHARE, Steps, Window, enable, record, start, until


def transfer(window: Window) -> Steps:
    _, figure, garment = dress.build(100_000, 60)
    bpy.context.scene.skinwright.transfer.source = figure
    bpy.context.scene.skinwright.transfer.smoothing_iterations = 150
    figure.display_type = garment.display_type = "BOUNDS"
    yield 0.5
    with window.context():
        assert bpy.ops.skinwright.transfer_weights("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    yield from until(lambda: import_module(f"{EXTENSION}.jobs").running.progress > 0)


def sculpt(window: Window) -> Steps:
    sculpting.character(window, 2500)
    yield from sculpting.begin(window)
    window.event("LEFTMOUSE", "PRESS")  # in the middle of a stroke
    yield 0.3


def mask(window: Window) -> Steps:
    _, figure, _ = dress.build(2500)
    bpy.context.scene.skinwright.transfer.source = figure
    painting.look(window)
    yield 0.3
    yield from painting.begin_painting(window)
    yield from window.stroke([(-60, 0), (0, 0), (60, 0)])


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    kind = sys.argv[-1]
    yield from {"transfer": transfer, "sculpt": sculpt, "mask": mask}[kind](window)
    record["kind"] = kind
    (SHARE / "out" / "record.json").write_text(json.dumps(record))
    bpy.ops.wm.quit_blender()
    yield 60.0
    raise AssertionError("Blender goes on")


start(steps)
