"""The pictures of the manual: the panels at work, and what settings do, in a real window. MakeHuman's body, CC0 1.0."""

import math
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
from driver import SHARE, Steps, Window, enable, start
from mathutils import Quaternion, Vector

FRONT, SIDE = Quaternion((0.7071, 0.7071, 0, 0)), Quaternion((0.612, 0.612, 0.354, 0.354))
COLOURS = {"mh_female_body": (0.80, 0.60, 0.50, 1), "helper_skirt": (0.25, 0.42, 0.62, 1)}
COLOURS["F_Dress_03"] = (0.45, 0.55, 0.40, 1)
BODY, SKIRT, DRESS = "mh_female_body", "helper_skirt", "F_Dress_03"


def load() -> None:
    """The body with its armature, and garments without weights on the same armature."""
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()
    imported("body")
    for name in (SKIRT, DRESS):
        others = [obj for obj in imported(name) if obj.name != name]
        garment = bpy.data.objects[name]
        world = garment.matrix_world.copy()
        garment.parent = None
        garment.matrix_world = world
        garment.vertex_groups.clear()
        garment.modifiers.clear()
        for other in others:
            bpy.data.objects.remove(other)
    rig().animation_data_clear()
    rig().hide_set(True)
    for name, colour in COLOURS.items():
        bpy.data.objects[name].color = colour
    for obj in bpy.data.objects:
        if obj.type == "EMPTY" or obj.name.startswith("Icosphere"):
            obj.hide_set(True)


def imported(name: str) -> set[bpy.types.Object]:
    """Imports a file; returns what has come."""
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=str(SHARE / f"{name}.glb"))
    return set(bpy.data.objects) - before


def rig() -> bpy.types.Object:
    return next(obj for obj in bpy.data.objects if obj.type == "ARMATURE")


def wear(window: Window, name: str) -> None:
    """Only this garment is shown, selected and active; nothing is posed or weighted."""
    with window.context():
        if bpy.context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        for garment in (SKIRT, DRESS):
            obj = bpy.data.objects[garment]
            obj.hide_set(garment != name)
            obj.select_set(garment == name)
            obj.vertex_groups.clear()
            obj.modifiers.clear()
        bpy.data.objects[BODY].select_set(False)
        bpy.context.view_layer.objects.active = bpy.data.objects[name]
    pose({})
    settings = bpy.context.scene.skinwright.transfer
    for key in settings.bl_rna.properties.keys():
        if settings.is_property_set(key) and key not in ("rna_type", "name"):
            settings.property_unset(key)
    settings.source = bpy.data.objects[BODY]


def pose(turns: dict[str, tuple[float, float, float]]) -> None:
    """Bones turned by degrees around the armature's axes, parents first."""
    armature = rig()
    for bone in armature.pose.bones:
        bone.matrix_basis.identity()
    bpy.context.view_layer.update()
    for name, degrees in turns.items():
        bone = armature.pose.bones[name]
        turn = Quaternion((1, 0, 0), math.radians(degrees[0])) @ Quaternion((0, 1, 0), math.radians(degrees[1]))
        turn = turn @ Quaternion((0, 0, 1), math.radians(degrees[2]))
        turned = (turn.to_matrix() @ bone.matrix.to_3x3()).to_4x4()
        turned.translation = bone.matrix.translation
        bone.matrix = turned
        bpy.context.view_layer.update()


STEP = {"thigh_l": (-70, 0, 0), "calf_l": (60, 0, 0)}


def look(window: Window, height: float, distance: float, rotation: Quaternion = FRONT) -> None:
    space = window.area.spaces.active
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    space.overlay.show_cursor = space.overlay.show_object_origins = space.overlay.show_outline_selected = False
    space.overlay.show_relationship_lines = space.overlay.show_text = False
    space.shading.show_cavity, space.shading.color_type = True, "OBJECT"
    view = space.region_3d
    view.view_perspective = "ORTHO"
    view.view_rotation = rotation
    view.view_location = Vector((0, 0, height))
    view.view_distance = distance


def transfer(window: Window, **settings: object) -> None:
    with window.context():
        bpy.ops.skinwright.transfer_weights(**settings)


def crop(window: Window, name: str) -> None:
    """The middle of the view, without panels."""
    region, whole = window.region(), window.window.height
    wide, high = region.height * 9 // 20, region.height - 80
    left = region.x + (region.width - wide) // 2
    geometry = f"{wide}x{high}+{left}+{whole - region.y - region.height + 70}"
    path = str(SHARE / "out" / f"{name}.png")
    subprocess.run(["convert", path, "-crop", geometry, "+repage", path], check=True)


def row(name: str, parts: list[str]) -> None:
    """Pictures beside each other, in place of the single ones; the page says what each shows."""
    files = [SHARE / "out" / f"{part}.png" for part in parts]
    subprocess.run(["convert", *map(str, files), "+append", str(SHARE / "out" / f"{name}.png")], check=True)
    for file in files:
        file.unlink()


def previews(window: Window, name: str, key: str, values: list[float]) -> Steps:
    """The match under several values of a threshold."""
    parts = []
    bpy.context.scene.skinwright.transfer.method = "PAPER"
    for number, value in enumerate(values):
        setattr(bpy.context.scene.skinwright.transfer, key, value)
        with window.context():
            bpy.ops.skinwright.show_overlay(kind="MATCH")
        yield from window.screenshot(f"{name}{number}")
        crop(window, f"{name}{number}")
        parts.append(f"{name}{number}")
    with window.context():
        bpy.ops.skinwright.show_overlay(kind="NONE")
    row(name, parts)


def posed(window: Window, name: str, cases: list[dict], turns: dict) -> Steps:
    """A garment in a pose after transfers with several settings."""
    parts = []
    for number, settings in enumerate(cases):
        pose({})
        transfer(window, **settings)
        pose(turns)
        yield from window.screenshot(f"{name}{number}")
        crop(window, f"{name}{number}")
        parts.append(f"{name}{number}")
    pose({})
    row(name, parts)


def panels(window: Window) -> Steps:
    """Before and after the first transfer, with the sidebar."""
    window.area.spaces.active.show_region_toolbar = False
    yield from window.show_tab("Weights")
    wear(window, SKIRT)
    look(window, 0.85, 2.6, SIDE)
    yield from window.screenshot("transfer_before")
    transfer(window)
    pose(STEP)
    yield from window.screenshot("transfer_after")
    with window.context():
        bpy.ops.skinwright.show_overlay(kind="STRETCH")
    yield from window.screenshot("overlay_stretch")
    with window.context():
        bpy.ops.skinwright.show_overlay(kind="INFLUENCES")
    yield from window.screenshot("overlay_bones")
    with window.context():
        bpy.ops.skinwright.show_overlay(kind="NONE")


def options(window: Window) -> Steps:
    """What the settings of the transfer do."""
    window.area.spaces.active.show_region_ui = False
    wear(window, SKIRT)
    look(window, 0.6, 2.2, SIDE)
    yield 0.5
    yield from previews(window, "option_distance", "relative_max_distance", [0.01, 0.05, 0.15])
    wear(window, DRESS)
    look(window, 0.9, 2.4, SIDE)
    yield from previews(window, "option_angle", "max_normal_angle", [math.radians(angle) for angle in (5, 35, 80)])
    wear(window, SKIRT)
    look(window, 0.7, 2.4, SIDE)
    smoothness = [{"relative_smoothness_length": length, "method": "PAPER"} for length in (0.0, 0.05, 0.3)]
    yield from posed(window, "option_smoothness", smoothness, STEP)
    yield from posed(window, "option_softness", [{"softness": softness} for softness in (0.2, 0.7, 3.0)], STEP)
    yield from posed(window, "option_limit", [{"max_influences": 1}, {"max_influences": 2}, {}], STEP)
    yield from posed(window, "option_method", [{"method": "PAPER"}, {"method": "CONFIDENCE"}], STEP)


def languages(window: Window) -> Steps:
    """The sidebar in other languages, where this Blender has them."""
    window.area.spaces.active.show_region_ui = True
    view = bpy.context.preferences.view
    for locale in ("ja_JP", "zh_HANS", "ko_KR"):
        try:
            view.language = locale
        except TypeError:
            continue
        view.use_translate_interface = view.use_translate_tooltips = True
        yield from window.screenshot(f"language_{locale}")
    view.language = "en_US"


def steps(window: Window) -> Steps:
    yield 1.0
    enable()
    with window.context():
        load()
    yield 0.5
    yield from panels(window)
    yield from languages(window)
    yield from options(window)


start(steps)
