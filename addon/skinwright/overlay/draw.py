"""Colours over the mesh in every 3D view; nothing of the scene is changed to draw them."""

import bpy
import gpu
import numpy as np
from bpy.app.handlers import load_pre, persistent
from bpy.types import SpaceView3D
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from . import colours, legend
from . import picture as preview
from .picture import Picture

# Towards the viewer by this part of the depth range, so that the mesh's own faces do not show through.
DEPTH_OFFSET = 5e-5
LIGHT = np.array([0.35, -0.5, 0.8], np.float32) / np.float32(1.0062)

_handles: list[object] = []
_kept: tuple[Picture, float, gpu.types.GPUBatch] | None = None


def _picture() -> Picture | None:
    context = bpy.context
    settings = context.scene.skinwright.overlay
    if settings.kind == "NONE" or not context.space_data.overlay.show_overlays:
        return None
    return preview.picture(context, settings.kind, context.scene.skinwright.transfer.to_params())


def _draw_mesh() -> None:
    picture = _picture()
    obj = bpy.data.objects.get(picture.object_name) if picture else None
    if picture is None or obj is None:
        return
    batch = _batch(picture, bpy.context.scene.skinwright.overlay.opacity)
    offset = Matrix.Identity(4)
    offset[2][3] = -DEPTH_OFFSET
    projection = gpu.matrix.get_projection_matrix()
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.blend_set("ALPHA")
    with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        gpu.matrix.load_projection_matrix(offset @ projection)
        gpu.matrix.multiply_matrix(obj.matrix_world)
        batch.draw(gpu.shader.from_builtin("SMOOTH_COLOR"))
    gpu.state.blend_set("NONE")
    gpu.state.depth_test_set("NONE")


def _batch(picture: Picture, opacity: float) -> gpu.types.GPUBatch:
    """Made anew only for another picture."""
    global _kept
    if _kept is None or _kept[0] is not picture or _kept[1] != opacity:
        # A little of the light that Solid shading has, or the shape could not be seen.
        shade = 0.72 + 0.28 * np.clip((picture.normals * LIGHT).sum(axis=1), -1, 1)
        rgba = np.empty((len(picture.values), 4), np.float32)
        rgba[:, :3], rgba[:, 3] = colours.of_values(picture.kind, picture.values) * shade[:, None], opacity
        content = {"pos": picture.positions, "color": rgba}
        shader = gpu.shader.from_builtin("SMOOTH_COLOR")
        _kept = (
            picture,
            opacity,
            batch_for_shader(shader, "TRIS", content, indices=picture.triangles.astype(np.int32)),
        )
    return _kept[2]


def _draw_legend() -> None:
    picture = _picture()
    if picture:
        legend.draw(picture)


@persistent
def _forget(*_arguments: object) -> None:
    """What is kept belongs to the file that is left."""
    global _kept
    _kept = None
    preview.forget()


def register() -> None:
    """Start drawing where there is a window; nothing is drawn while the overlay is off."""
    load_pre.append(_forget)
    if not bpy.app.background:
        _handles.append(SpaceView3D.draw_handler_add(_draw_mesh, (), "WINDOW", "POST_VIEW"))
        _handles.append(SpaceView3D.draw_handler_add(_draw_legend, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    """Stop drawing and drop what is kept."""
    while _handles:
        SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
    load_pre.remove(_forget)
    _forget()
