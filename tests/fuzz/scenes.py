"""Random scenes for the fuzzers, and what must hold in each of them."""

import importlib
import os
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("BLENDER_USER_RESOURCES", tempfile.mkdtemp(prefix="skinwright-fuzz-"))
sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1] / "support")]

import bpy  # noqa: E402
import builders  # noqa: E402
import extension  # noqa: E402
import numpy as np  # noqa: E402

addon = extension.enable()


def part(name):
    """A module of the add-on."""
    return importlib.import_module(f"{addon.__name__}.{name}")


weight_state = part("scene.weight_state")


def dress(rng):
    """A body on a rig, one to three garments, with the odd thing wrong. Returns (body, garments)."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = builders.rig(bones=("Arm.L", "Arm.R", "Spine"))
    body = builders.body(int(rng.integers(3, 9)), rig)
    garments = []
    for number in range(int(rng.integers(1, 4))):
        coat = builders.grid(
            f"Coat {number}", int(rng.integers(2, 8)), size=rng.uniform(0.3, 2.5), z=rng.uniform(0, 0.2)
        )
        garments.append(coat)
        if rng.random() < 0.5:
            builders.paint(coat, Arm__L=rng.random(), Arm__R=rng.random(), pin=rng.random())
        if rng.random() < 0.5:
            coat.modifiers.new("Armature", "ARMATURE").object = rig
        spoil(coat, rng)
    if rng.random() < 0.15:
        spoil(body, rng)
    if rng.random() < 0.9:
        bpy.context.scene.skinwright.transfer.source = body
    builders.select(*garments)
    if rng.random() < 0.3:
        rig.pose.bones["Arm.L"].rotation_mode = "XYZ"
        rig.pose.bones["Arm.L"].rotation_euler = rng.normal(size=3)
    bpy.context.view_layer.update()
    return body, garments


def spoil(obj, rng):
    """Sometimes one of what real files have."""
    match int(rng.integers(16)):
        case 0:
            obj.location.z = 1000
        case 1:
            obj.scale = (1, -1, 1)
        case 2:
            obj.scale = (1, 0, 1)
        case 3:
            obj.data.vertices[0].co.x = float("nan")
        case 4:
            obj.data.clear_geometry()
        case 5:
            obj.hide_viewport = True
        case 6 if obj.vertex_groups:
            obj.vertex_groups[0].add([0], float("nan"), "REPLACE")
        case 7 if obj.vertex_groups:
            obj.vertex_groups[0].lock_weight = True
        case 8:
            obj.modifiers.new("Mirror", "MIRROR")
        case 9:
            obj.shape_key_add(name="Basis")
        case 10:
            obj.skinwright.mask_group = "gone"
        case 11:
            twin = obj.copy()
            bpy.context.collection.objects.link(twin)


def digests(objects):
    """State of every mesh among them, by name."""
    return {obj.name: weight_state.capture(obj).digest() for obj in objects if obj.type == "MESH"}


def check_sound(objects, before):
    """Weights of what has changed are numbers from 0 to 1."""
    for obj in objects:
        state = weight_state.capture(obj)
        if state.digest() != before.get(obj.name):
            assert np.isfinite(state.values).all(), f"{obj.name} has a weight that is not a number"
            assert state.values.min(initial=0) >= 0 and state.values.max(initial=0) <= 1 + 1e-6, obj.name
