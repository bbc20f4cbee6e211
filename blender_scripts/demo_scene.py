"""Builds a MakeHuman character in Blender: armature, skinned body, garments without weights, and a hard pose."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from makehuman import BaseMesh, Bone, Part
from mathutils import Matrix, Vector

GARMENTS = {"Skirt": "helper-skirt", "Tights": "helper-tights"}

# A knee lifted high to the side and a raised arm: where each bone points in the armature's space, in which the
# character faces -Y and its left is +X.
HARD_POSE = {
    "thigh_l": (0.90, -0.45, 0.0),
    "calf_l": (0.45, -0.20, -1.0),
    "thigh_r": (-0.10, 0.15, -1.0),
    "calf_r": (-0.05, 0.20, -1.0),
    "upperarm_r": (-0.80, -0.25, 0.55),
    "lowerarm_r": (-0.30, -0.40, 1.0),
    "upperarm_l": (0.62, 0.20, -0.45),
    "lowerarm_l": (0.45, -0.50, -0.60),
}


@dataclass(frozen=True)
class Character:
    """The Blender objects of one dressed figure."""

    rig: bpy.types.Object
    body: bpy.types.Object
    garments: dict[str, bpy.types.Object]


def build_character(base: BaseMesh, label: str) -> Character:
    """Armature, body with its painted weights, and garments that hang on the armature without any weight."""
    collection = bpy.data.collections.new(label)
    bpy.context.scene.collection.children.link(collection)
    rig = _build_armature(base.bones, f"Rig ({label})", collection)
    names = [bone.name for bone in base.bones]
    body_part = base.part("body", "helper-l-eye", "helper-r-eye")
    body = _build_mesh(body_part, f"Body ({label})", rig, collection)
    write_weights(body, names, body_part.weights)
    garments = {
        name: _build_mesh(base.part(group), f"{name} ({label})", rig, collection) for name, group in GARMENTS.items()
    }
    bpy.context.view_layer.update()
    return Character(rig, body, garments)


def write_weights(obj: bpy.types.Object, names: list[str], weights: np.ndarray) -> None:
    """Replace the object's vertex groups by these rows (V, B)."""
    obj.vertex_groups.clear()
    for name, column in zip(names, weights.T, strict=True):
        group = obj.vertex_groups.new(name=name)
        for i in np.flatnonzero(column):
            group.add([int(i)], float(column[i]), "REPLACE")


def read_weights(obj: bpy.types.Object, names: list[str]) -> np.ndarray:
    """Rows (V, B) in the order of `names`; groups that are no bones are left out."""
    column = {obj.vertex_groups[name].index: j for j, name in enumerate(names) if name in obj.vertex_groups}
    weights = np.zeros((len(obj.data.vertices), len(names)))
    for vertex in obj.data.vertices:
        for element in vertex.groups:
            if element.group in column:
                weights[vertex.index, column[element.group]] = element.weight
    return weights


def transfer_nearest_point(source: bpy.types.Object, target: bpy.types.Object) -> None:
    """Blender's own Data Transfer: every vertex takes the weights of the nearest point of the source's surface."""
    with bpy.context.temp_override(object=source, active_object=source, selected_editable_objects=[target, source]):
        bpy.ops.object.data_transfer(
            data_type="VGROUP_WEIGHTS",
            vert_mapping="POLYINTERP_NEAREST",
            layers_select_src="ALL",
            layers_select_dst="NAME",
            mix_mode="REPLACE",
        )


def pose(rig: bpy.types.Object, directions: dict[str, tuple[float, float, float]]) -> None:
    """Turn each named bone so that it points along a direction of the armature's space, parents first."""
    for name, direction in directions.items():
        bone = rig.pose.bones[name]
        turn = bone.vector.rotation_difference(Vector(direction)).to_matrix().to_4x4()
        joint = Matrix.Translation(bone.head)
        bone.matrix = joint @ turn @ joint.inverted() @ bone.matrix
        bpy.context.view_layer.update()


def look_at(character: Character) -> None:
    """Let the file open in the camera's view, the body picked as source, a garment active, the sidebar at our tab."""
    scene = bpy.context.scene
    scene.skinwright.transfer.source = character.body
    scene["skinwright_show_tab"] = True
    garment = next(iter(character.garments.values()))
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj == garment)
    bpy.context.view_layer.objects.active = garment
    for screen in bpy.data.screens:
        for area in (area for area in screen.areas if area.type == "VIEW_3D"):
            area.spaces.active.region_3d.view_perspective = "CAMERA"
            area.spaces.active.show_region_ui = True


def _build_armature(bones: list[Bone], name: str, collection: bpy.types.Collection) -> bpy.types.Object:
    rig = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in bones:
        edit_bone = rig.data.edit_bones.new(bone.name)
        edit_bone.head, edit_bone.tail, edit_bone.roll = bone.head, bone.tail, bone.roll
        edit_bone.parent = rig.data.edit_bones.get(bone.parent)
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.show_in_front = True
    return rig


def _build_mesh(part: Part, name: str, rig: bpy.types.Object, collection: bpy.types.Collection) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(part.positions.tolist(), [], part.polygons)
    mesh.shade_smooth()
    obj = bpy.data.objects.new(name, mesh)
    collection.objects.link(obj)
    obj.parent = rig
    obj.modifiers.new("Armature", "ARMATURE").object = rig
    return obj
