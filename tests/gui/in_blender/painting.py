"""A brush on the match mask."""

from __future__ import annotations

from importlib import import_module

import bpy
from driver import EXTENSION, Steps, Window, until


def brush(window: Window) -> None:
    """A brush where Blender has none: Debian's 4.3 comes without. Of its settings only the size is changed."""
    with window.context():
        settings = bpy.context.tool_settings
        if settings.weight_paint.brush is None:
            bpy.data.brushes.new("Paint", mode="WEIGHT_PAINT").asset_mark()
            bpy.ops.brush.asset_activate(asset_library_type="LOCAL", relative_asset_identifier="Brush/Paint")
        unified = getattr(settings.weight_paint, "unified_paint_settings", None) or settings.unified_paint_settings
        (unified if unified.use_unified_size else settings.weight_paint.brush).size = 40


def press(window: Window, value: str) -> None:
    """The panel's button for what the brush paints."""
    with window.context():
        assert bpy.ops.skinwright.mask_brush("INVOKE_DEFAULT", value=value) == {"FINISHED"}


def painting():
    return import_module(f"{EXTENSION}.operators.match.paint_mask").SKINWRIGHT_OT_paint_match_mask.painting


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
    press(window, "INPAINT")
    yield from until(lambda: painting().seconds)
    yield 0.4
