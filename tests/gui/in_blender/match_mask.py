"""Preview, sliders, painting with live weights, undo and redo, Esc and Enter, in a real window."""

import math
import sys
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import dress
from driver import EXTENSION, Steps, Window, enable, record, start, until
from painting import begin_painting, look, painting

STROKE = [(-60 + 12 * i, 60 - 2 * i) for i in range(11)]


def weights() -> list[dict[str, float]]:
    return dress.weights("Dress")


def without_mask(rows: list[dict[str, float]]) -> list[dict[str, float]]:
    return [{name: value for name, value in row.items() if name != "Match Mask"} for row in rows]


def near(a: list[dict[str, float]], b: list[dict[str, float]]) -> bool:
    rows = zip(without_mask(a), without_mask(b), strict=True)
    return all(x.keys() == y.keys() and all(abs(x[name] - y[name]) < 1e-6 for name in x) for x, y in rows)


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    _, figure, garment = dress.build()
    bpy.context.scene.skinwright.transfer.source = figure
    with window.context():
        bpy.ops.ed.undo_push(message="Scene")
    yield from window.show_tab("Weights")
    look(window)
    yield 0.5

    bare = weights()
    with window.context():
        bpy.ops.skinwright.preview_match()
    yield from window.screenshot("preview")
    assert weights() == bare
    session = import_module(f"{EXTENSION}.match.session").current
    few = session.last_match.counts().tolist()
    bpy.context.scene.skinwright.transfer.softness = 0.25
    yield from window.screenshot("preview_slider")
    many = session.last_match.counts().tolist()
    assert many[0] > few[0], "the overlay did not follow the slider"
    record["few"], record["many"] = few, many
    bpy.context.scene.skinwright.transfer.softness = 1.0

    with window.context():
        bpy.ops.skinwright.paint_match_mask("INVOKE_DEFAULT")
    window.key("ESC")
    yield from until(lambda: painting() is None)
    assert weights() == bare, "Esc before the first stroke did not bring the weights back"

    yield from begin_painting(window)
    yield from window.screenshot("paint_begin")
    automatic = weights()
    assert any("Spine.3" in row for row in automatic)
    solved = len(painting().seconds)
    yield from window.stroke(STROKE, settle=0.1)
    yield from until(lambda: len(painting().seconds) > solved)
    yield from window.screenshot("painted")
    painted = weights()
    masked = sum(row["Match Mask"] < 0.25 for row in painted)
    assert masked > 20, f"the stroke painted {masked} vertices"
    assert not near(painted, automatic), "the weights did not follow the stroke"
    record["masked"] = masked

    window.key("Z", ctrl=True)
    yield from until(lambda: near(weights(), automatic))
    assert all(row["Match Mask"] == 0.5 for row in weights())
    window.key("Z", ctrl=True, shift=True)
    yield from until(lambda: near(weights(), painted))

    window.key("ESC")
    yield 0.5
    assert weights() == bare, "Esc did not bring the weights back"
    garment = bpy.data.objects["Dress"]
    assert painting() is None and garment.mode == "OBJECT" and not garment.vertex_groups

    yield from begin_painting(window)
    solved = len(painting().seconds)
    yield from window.stroke(STROKE, settle=0.1)
    yield from until(lambda: len(painting().seconds) > solved)
    kept = weights()
    window.key("RET")
    yield 0.5
    assert weights() == kept and bpy.data.objects["Dress"].mode == "OBJECT"
    record["live_seconds"] = solved

    for name in ("Spine.1", "Spine.2"):
        bone = bpy.data.objects["Rig"].pose.bones[name]
        bone.rotation_mode = "XYZ"
        bone.rotation_euler[2] = math.radians(25)
    bpy.context.scene.skinwright.overlay.kind = "STRETCH"
    yield from window.screenshot("stretch")
    bpy.context.scene.skinwright.overlay.kind = "INFLUENCES"
    yield from window.screenshot("influences")
    bpy.context.scene.skinwright.overlay.kind = "NONE"
    yield from window.screenshot("posed")


start(steps)
