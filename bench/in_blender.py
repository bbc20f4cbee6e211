"""The benchmark's meshes inside the bpy module: our add-on, and Blender's own Data Transfer as the floor."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from meshes import Mesh

Run = Callable[[], dict[str, Any]]


def data_transfer(source: Mesh, target: Mesh) -> Run:
    """Nearest point on the surface; inpaints nothing."""
    body, garment = _dressed(source, target)

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


def add_on(source: Mesh, target: Mesh) -> Run:
    """What the operator runs: read, compute, write. The garment starts without groups each time."""
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "addon"))
    import skinwright
    from skinwright.transfer import TransferParams, transfer_weights

    body, garment = _dressed(source, target)
    skinwright.register()

    def run() -> dict[str, Any]:
        report = transfer_weights(bpy.context, body, [garment], TransferParams())
        garment.vertex_groups.clear()
        return {"seconds": report.garments[0].seconds}

    return run


def _dressed(source: Mesh, target: Mesh) -> tuple[bpy.types.Object, bpy.types.Object]:
    """Both meshes as objects; the body with its 60 groups and the armature that they name bones of."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    body, garment = _object("Body", source), _object("Garment", target)
    for j, column in enumerate(source.weights.T):
        group = body.vertex_groups.new(name=f"Bone {j}")
        for i in np.flatnonzero(column):
            group.add([int(i)], float(column[i]), "REPLACE")
    rig = _armature([group.name for group in body.vertex_groups])
    for obj in (body, garment):
        obj.modifiers.new("Armature", "ARMATURE").object = rig
    bpy.context.view_layer.update()
    return body, garment


def _object(name: str, mesh: Mesh) -> bpy.types.Object:
    data = bpy.data.meshes.new(name)
    data.from_pydata(mesh.positions.tolist(), [], mesh.triangles.tolist())
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def _armature(names: list[str]) -> bpy.types.Object:
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for name in names:
        rig.data.edit_bones.new(name).tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    return rig
