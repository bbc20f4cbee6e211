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


def characters(rng):
    """One to three limbs on a rig, and a donor with another, with the odd thing wrong. Returns (donor mesh, limbs)."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    donor, rig = builders.limb("Donor", bones=("Upper.L", "Lower.L", "Hand.L")[: int(rng.integers(1, 4))])
    bones = ("Upper.L", "Lower.L", "Hand.L")[: int(rng.integers(1, 4))]
    limbs = []
    for number in range(int(rng.integers(1, 4))):
        shape = {"around": int(rng.integers(3, 9)), "along": int(rng.integers(2, 9)), "length": rng.uniform(0.5, 5)}
        obj, own = builders.limb(f"Limb {number}", bones=bones, bound=bool(rng.random() < 0.7), **shape)
        if rng.random() < 0.5 and number:
            for modifier in obj.modifiers:
                modifier.object = bpy.data.objects["Limb 0 Rig"]
        own.pose.bones[0].rotation_mode = "XYZ"
        own.pose.bones[0].rotation_euler = rng.normal(size=3) * (rng.random() < 0.4)
        if rng.random() < 0.1:
            own.scale = rng.choice([-1, 0, 1, 2], 3)
        limbs.append(obj)
        if rng.random() < 0.4:
            spoil(obj, rng)
    if rng.random() < 0.15:
        spoil(donor, rng)
    settings = bpy.context.scene.skinwright
    settings.retarget.source = rig if rng.random() < 0.9 else None
    settings.transfer.source = donor
    builders.select(*[obj for obj in limbs if obj.visible_get()])
    bpy.context.scene.frame_end = int(rng.integers(1, 4))
    bpy.context.view_layer.update()
    return donor, limbs


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


def state(folder):
    """Everything that an operation may write: objects, weights, shapes, keys, drivers, modifiers, colors, and the files
    in a folder by name."""
    meshes = [obj for obj in bpy.data.objects if obj.type == "MESH"]
    shapes = {}
    for obj in meshes:
        keys = obj.data.shape_keys
        blocks = {} if keys is None else {key.name: coordinates(key.data) for key in keys.key_blocks}
        animated = keys.animation_data if blocks else None
        drivers = [curve.driver.expression for curve in animated.drivers] if animated else []
        colors = [attribute.name for attribute in obj.data.attributes if attribute.data_type == "FLOAT_COLOR"]
        marks = (sorted({*obj.keys()} - {"skinwright"}), obj.skinwright.mask_group)
        shapes[obj.name] = (coordinates(obj.data.vertices), blocks, drivers, colors, marks)
    follows = {
        obj.name: (
            [(m.name, m.type, m.show_viewport) for m in obj.modifiers],
            [constraint.mute for constraint in obj.constraints],
            (obj.parent and obj.parent.name, obj.parent_type, obj.parent_bone, str(obj.matrix_basis)),
        )
        for obj in bpy.data.objects
    }
    lists = [sorted(item.name for item in getattr(bpy.data, kind)) for kind in ("meshes", "armatures", "shape_keys")]
    return digests(meshes), shapes, follows, lists, sorted(os.listdir(folder)), bpy.context.mode


def coordinates(points):
    found = np.empty(3 * len(points), np.float32)
    points.foreach_get("co", found)
    return found.tobytes()


def differing(before, after):
    """Which parts of the state, and for which object."""
    parts = ("weights", "shapes", "follows", "data", "files", "mode")
    found = []
    for part, one, other in zip(parts, before, after, strict=True):
        if one != other and isinstance(one, dict):
            found += [f"{part} of {name}" for name in sorted({*one, *other}) if one.get(name) != other.get(name)]
        elif one != other:
            found.append(part)
    return ", ".join(found)
