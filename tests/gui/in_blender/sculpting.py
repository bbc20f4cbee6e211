"""A posed character, and a brush on it."""

from __future__ import annotations

import math
from importlib import import_module

import bpy
import dress
import numpy as np
from driver import EXTENSION, Steps, Window, until
from painting import look


def character(window: Window, vertices: int, bones: int = 6) -> bpy.types.Object:
    """A figure of about so many vertices with a bent spine, in place of what is there; it is the active object."""
    armature, figure, garment = dress.build(100, bones)
    for obj in (figure, garment):
        bpy.data.objects.remove(obj)
    side = round(vertices**0.5)
    obj = dress.tube("Body", np.full(side, 0.3), 0.0, dress.HEIGHT, side)
    z = np.repeat(np.linspace(0, dress.HEIGHT, side), side)
    for bone in range(bones):
        weight = np.clip(1 - np.abs(z / dress.HEIGHT * bones - bone - 0.5), 0, 1)
        group = obj.vertex_groups.new(name=f"Spine.{bone}")
        for value in np.unique(weight[weight > 0]):
            group.add(np.flatnonzero(weight == value).tolist(), float(value), "REPLACE")
    obj.modifiers.new("Armature", "ARMATURE").object = armature
    bent = armature.pose.bones[f"Spine.{bones // 2}"]
    bent.rotation_mode, bent.rotation_euler = "XYZ", (0, 0, math.radians(45))
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    look(window)
    with window.context():
        bpy.ops.ed.undo_push(message="Scene")
    return obj


def session():
    return import_module(f"{EXTENSION}.sculpt.session").current


def positions(name: str = "Body") -> np.ndarray:
    """(V, 3) of the mesh at rest, by the public API."""
    return np.array([vertex.co for vertex in bpy.data.objects[name].data.vertices], np.float32)


def brush(window: Window, size: int) -> None:
    """A brush that grabs; made here, as Debian's 4.3 comes without brushes."""
    with window.context():
        settings = bpy.context.tool_settings
        if "Test Grab" not in bpy.data.brushes:
            grab = bpy.data.brushes.new("Test Grab", mode="SCULPT")
            setattr(grab, "sculpt_brush_type" if bpy.app.version >= (5, 0, 0) else "sculpt_tool", "GRAB")
            grab.asset_mark()
        bpy.ops.brush.asset_activate(asset_library_type="LOCAL", relative_asset_identifier="Brush/Test Grab")
        unified = getattr(settings.sculpt, "unified_paint_settings", None) or settings.unified_paint_settings
        unified.use_unified_size = True
        unified.size = size


def begin(window: Window, desparsify: bool = True, size: int = 70) -> Steps:
    """Start the operator; returns once it runs and a brush is in hand."""
    bpy.context.scene.skinwright.sculpt.add_candidates = desparsify
    with window.context():
        bpy.ops.skinwright.sculpt_weights("INVOKE_DEFAULT")
    yield from until(lambda: session() is not None)
    brush(window, size)
    yield 0.8
