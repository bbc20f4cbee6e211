"""The line from an explained vertex to its closest point on the source."""

import bpy
import gpu
from gpu_extras.batch import batch_for_shader

from ..match import explain

_LINE = (1.0, 0.9, 0.2, 1.0)


def draw() -> None:
    """Over everything, as the closest point may lie within."""
    found = explain.current
    if found is None or found.object_name not in bpy.data.objects:
        return
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", 3.0 * bpy.context.preferences.system.ui_scale)
    shader.uniform_float("color", _LINE)
    gpu.state.depth_test_set("NONE")
    batch_for_shader(shader, "LINES", {"pos": [found.position, found.closest]}).draw(shader)
    points = gpu.shader.from_builtin("UNIFORM_COLOR")
    points.uniform_float("color", _LINE)
    gpu.state.point_size_set(9.0)
    batch_for_shader(points, "POINTS", {"pos": [found.position, found.closest]}).draw(points)
