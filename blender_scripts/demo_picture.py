"""The demo's picture: two figures side by side in one scene, lit, labelled and rendered with Cycles on the CPU."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from demo_scene import Character
from mathutils import Vector

_RESOLUTION = (1200, 820)
_COLOURS = {"Body": (0.62, 0.42, 0.32), "Tights": (0.045, 0.05, 0.06)}
_CHECKS = ((0.30, 0.025, 0.045), (0.72, 0.62, 0.50))
_GROUND = (0.80, 0.79, 0.77)
YAW = -0.2  # both figures turn a little aside, radians, so that the lifted knee is seen
_INK = (0.05, 0.05, 0.06)
_FEET = -0.82  # the base mesh stands with its feet at this height, metres


def dress(character: Character) -> None:
    """Materials, and a smooth surface for the render: neither touches vertices or weights."""
    skirt = character.garments["Skirt"]
    skirt.data.materials.append(_checked_cloth("Skirt", _CHECKS))
    _lay_checks(skirt)
    for part, obj in {"Body": character.body, **character.garments}.items():
        if part in _COLOURS:
            obj.data.materials.append(_material(part, _COLOURS[part]))
        smooth = obj.modifiers.new("Subdivision", "SUBSURF")
        smooth.levels, smooth.render_levels = 0, 1
    thickness = skirt.modifiers.new("Thickness", "SOLIDIFY")
    thickness.thickness, thickness.offset = 0.004, 1


def set_stage(labels: dict[str, float]) -> None:
    """Ground, three lights, a camera that sees both figures, and a label under each (text: x in metres)."""
    _ground()
    for text, x in labels.items():
        _label(text, x)
    _light("Key", (-2.6, -3.6, 3.0), 260, 1.6)
    _light("Fill", (3.4, -3.0, 1.2), 70, 3.0)
    _light("Rim", (0.8, 3.0, 2.6), 220, 1.2)
    _camera()


def render(path: Path, samples: int) -> None:
    """Render to `path` with Cycles on the CPU: it needs no graphics card and no display."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.use_denoising = True
    scene.cycles.denoising_quality = "FAST" if samples < 32 else "HIGH"  # a tenth of the time for a draft
    scene.cycles.max_bounces = 3
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "AgX - Medium High Contrast"
    scene.render.resolution_x, scene.render.resolution_y = _RESOLUTION
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(path)
    with _silence():
        bpy.ops.render.render(write_still=True)


@contextmanager
def _silence() -> Iterator[None]:
    """Cycles writes a line to the standard output for every step, past Python."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def _material(name: str, colour: tuple[float, float, float]) -> bpy.types.Material:
    material = bpy.data.materials.get(name)
    if material is None:
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        material.diffuse_color = (*colour, 1)
        nodes, links = material.node_tree.nodes, material.node_tree.links
        output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
        shader = nodes.new("ShaderNodeBsdfDiffuse")  # a third of the render time of Blender's principled shader
        shader.inputs["Color"].default_value = (*colour, 1)
        links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    return material


def _lay_checks(skirt: bpy.types.Object) -> None:
    """Texture coordinates that lie evenly round the rest shape, so that every stretch of the cloth shows."""
    mesh = skirt.data
    x, y, z = np.array([vertex.co for vertex in mesh.vertices]).T
    corners = np.array([loop.vertex_index for loop in mesh.loops])
    around = (np.arctan2(x, -y) / (2 * np.pi))[corners].reshape(-1, 4)  # every polygon of the base mesh is a quad
    around = np.where(around.max(1, keepdims=True) - around > 0.5, around + 1, around).ravel()  # across the back seam
    layer = mesh.uv_layers.new(name="Cloth")
    layer.data.foreach_set("uv", np.column_stack([around * 28, z[corners] * 16]).astype(np.float32).ravel())


def _checked_cloth(name: str, colours: tuple[tuple[float, float, float], ...]) -> bpy.types.Material:
    material = bpy.data.materials.get(name)
    if material is None:
        material = _material(name, colours[0])
        nodes, links = material.node_tree.nodes, material.node_tree.links
        coordinates, checker = nodes.new("ShaderNodeUVMap"), nodes.new("ShaderNodeTexChecker")
        checker.inputs["Scale"].default_value = 1
        for socket, colour in zip(("Color1", "Color2"), colours, strict=True):
            checker.inputs[socket].default_value = (*colour, 1)
        shader = next(node for node in nodes if node.type == "BSDF_DIFFUSE")
        links.new(coordinates.outputs["UV"], checker.inputs["Vector"])
        links.new(checker.outputs["Color"], shader.inputs["Color"])
    return material


def _add(name: str, data: bpy.types.ID | None, location: tuple[float, float, float]) -> bpy.types.Object:
    obj = bpy.data.objects.new(name, data)
    obj.location = location
    bpy.context.scene.collection.objects.link(obj)
    return obj


def _ground() -> None:
    """A floor that curves up behind the figures, so that no horizon is seen."""
    profile = [(-6, 0), (1.6, 0), (2.2, 0.10), (2.7, 0.42), (3.0, 1.0), (3.0, 6)]
    vertices = [(x, y, _FEET + z) for x in (-12, 12) for y, z in profile]
    n = len(profile)
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata(vertices, [], [(i, i + n, i + n + 1, i + 1) for i in range(n - 1)])
    mesh.shade_smooth()
    mesh.materials.append(_material("Ground", _GROUND))
    smooth = _add("Ground", mesh, (0, 0, 0)).modifiers.new("Subdivision", "SUBSURF")
    smooth.levels = smooth.render_levels = 3


def _label(text: str, x: float) -> None:
    curve = bpy.data.curves.new(f"Label {text}", "FONT")
    curve.body, curve.size, curve.align_x, curve.extrude = text, 0.11, "CENTER", 0.001
    curve.materials.append(_material("Label", _INK))
    _add(f"Label {text}", curve, (x, -0.62, _FEET + 0.045)).rotation_euler = (1.47, 0, 0)


def _light(name: str, location: tuple[float, float, float], watts: float, size: float) -> None:
    light = bpy.data.lights.new(name, "AREA")
    light.energy, light.size = watts, size
    obj = _add(name, light, location)
    obj.rotation_euler = (Vector((0, 0, 0)) - obj.location).to_track_quat("-Z", "Y").to_euler()


def _camera() -> None:
    camera = bpy.data.cameras.new("Camera")
    camera.lens, camera.sensor_width = 92, 36
    eye, looked_at = Vector((0, -7.4, 0.75)), Vector((0.02, 0, 0.06))
    obj = _add("Camera", camera, eye)
    obj.rotation_euler = (looked_at - eye).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.camera = obj
