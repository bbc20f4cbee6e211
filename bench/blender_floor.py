"""Blender's Data Transfer on the benchmark's meshes, inside the bpy module."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from meshes import Mesh


def prepare(source: Mesh, target: Mesh) -> Callable[[], dict[str, Any]]:
    """Both meshes as objects, the source with its 60 vertex groups; the call transfers them."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    body, garment = _object("Body", source), _object("Garment", target)
    for j, column in enumerate(source.weights.T):
        group = body.vertex_groups.new(name=f"Bone {j}")
        for i in np.flatnonzero(column):
            group.add([int(i)], float(column[i]), "REPLACE")
    bpy.context.view_layer.update()

    def run() -> dict[str, Any]:
        with bpy.context.temp_override(object=body, active_object=body, selected_editable_objects=[garment, body]):
            bpy.ops.object.data_transfer(
                data_type="VGROUP_WEIGHTS",
                vert_mapping="POLYINTERP_NEAREST",
                layers_select_src="ALL",
                layers_select_dst="NAME",
            )
        return {}

    return run


def _object(name: str, mesh: Mesh) -> bpy.types.Object:
    data = bpy.data.meshes.new(name)
    data.from_pydata(mesh.positions.tolist(), [], mesh.triangles.tolist())
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    return obj
