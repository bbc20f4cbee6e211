"""Preview, sliders, painting with live weights, undo and redo, Esc and Enter, in a real window."""

import math
import sys
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import dress
from driver import EXTENSION, SHARE, Steps, Window, enable, record, start

STROKE = [(-60 + 12 * i, 60 - 2 * i) for i in range(11)]


def weights() -> list[dict[str, float]]:
    return dress.weights("Dress")


def without_mask(rows: list[dict[str, float]]) -> list[dict[str, float]]:
    return [{name: value for name, value in row.items() if name != "Match Mask"} for row in rows]


def near(a: list[dict[str, float]], b: list[dict[str, float]]) -> bool:
    rows = zip(without_mask(a), without_mask(b), strict=True)
    return all(x.keys() == y.keys() and all(abs(x[name] - y[name]) < 1e-6 for name in x) for x, y in rows)


def brush(window: Window) -> None:
    """Debian's 4.3 comes without brushes."""
    with window.context():
        if bpy.context.tool_settings.weight_paint.brush is None:
            bpy.data.brushes.new("Paint", mode="WEIGHT_PAINT").asset_mark()
            bpy.ops.brush.asset_activate(asset_library_type="LOCAL", relative_asset_identifier="Brush/Paint")
        settings = bpy.context.tool_settings
        unified = getattr(settings.weight_paint, "unified_paint_settings", None) or settings.unified_paint_settings
        unified.use_unified_weight = unified.use_unified_size = unified.use_unified_strength = True
        unified.weight, unified.size, unified.strength = 0.0, 40, 1.0
        settings.weight_paint.brush.weight = 0.0


def painting():
    return import_module(f"{EXTENSION}.operators.paint_match_mask").SKINWRIGHT_OT_paint_match_mask.painting


def until(condition, seconds: float = 8.0) -> Steps:
    for _ in range(int(seconds / 0.05)):
        if condition():
            return
        yield 0.05
    raise AssertionError(f"waited {seconds} s in vain")


def look(window: Window) -> None:
    with window.context():
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_selected()
        bpy.context.region_data.view_distance *= 1.15
    view = window.area.spaces.active
    view.shading.type = "SOLID"
    view.overlay.show_floor = view.overlay.show_axis_x = view.overlay.show_axis_y = False
    view.show_region_toolbar = False


def begin_painting(window: Window) -> Steps:
    with window.context():
        bpy.ops.skinwright.paint_match_mask("INVOKE_DEFAULT")
    yield 0.3
    brush(window)
    yield from until(lambda: painting().seconds)
    yield 0.4


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    armature, figure, garment = dress.build()
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
    session = import_module(f"{EXTENSION}.match_session").current
    few = session.last_match.counts().tolist()
    bpy.context.scene.skinwright.transfer.relative_max_distance = 0.12
    yield from window.screenshot("preview_slider")
    many = session.last_match.counts().tolist()
    assert many[0] > few[0], "the overlay did not follow the slider"
    record["few"], record["many"] = few, many
    bpy.context.scene.skinwright.transfer.relative_max_distance = 0.05

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
    assert (SHARE / "out").exists()


start(steps)
