"""The order of a mesh's modifiers: which shape it before the pose, and where in the stack an armature belongs."""

from collections.abc import Sequence

import bpy

from . import armature, carried, modifier_inputs, modifiers, shapes

# Modifiers that take the shape of other objects; all others look at their places at most.
_FOLLOWS_A_SHAPE = {"BOOLEAN", "CURVE", "LATTICE", "MESH_DEFORM", "NODES", "SHRINKWRAP", "SURFACE_DEFORM"}
# They shape by places and axes that stay where they are: what they do to a mesh at rest, they do not to its pose.
_FIXED_IN_SPACE = {
    "ARRAY",
    "BOOLEAN",
    "CAST",
    "CURVE",
    "HOOK",
    "LAPLACIANDEFORM",
    "LATTICE",
    "MESH_DEFORM",
    "SCREW",
    "SHRINKWRAP",
    "SIMPLE_DEFORM",
    "SURFACE_DEFORM",
    "VOLUME_DISPLACE",
    "WARP",
}
# Nodes that only compute values, or set what is no place, by the beginning of their names.
_KEEP_PLACES = (
    "FunctionNode",
    "GeometryNodeGroup",
    "GeometryNodeInput",
    "GeometryNodeSetMaterial",
    "GeometryNodeSetShadeSmooth",
    "GeometryNodeStoreNamedAttribute",
    "NodeFrame",
    "NodeGroup",
    "NodeReroute",
    "ShaderNode",
)
# Moves are rounding below this part of the mesh's size, and what shapes a pose by less is not worth a word.
_LEAST = 1e-5
_MUCH = 5e-3
# They react to the pose, so it comes first.
_REACTS = {"CLOTH", "CORRECTIVE_SMOOTH", "SOFT_BODY"}


def place_of_armature(obj: bpy.types.Object, sources: Sequence[bpy.types.Object]) -> int:
    """Where an armature that the `sources` follow belongs: after mirroring and what fits the mesh in space, which need
    the rest shape, and before all that builds on the pose or follows it."""
    place = 0
    reacts = False
    for index, modifier in enumerate(obj.modifiers):
        reacts = reacts or modifier.type in _REACTS
        if modifier.type == "MIRROR" or (not reacts and _shapes_at_rest(obj, modifier, sources, _LEAST)):
            place = index + 1
    return place


def shaping_the_pose(obj: bpy.types.Object, sources: Sequence[bpy.types.Object]) -> list[bpy.types.Modifier]:
    """The modifiers that shape what an armature has posed by places that do not move with it."""
    posed = armature.deforms_as_parent(obj) and obj.parent.type == "ARMATURE"
    found = []
    for modifier in obj.modifiers:
        if posed and modifier.type != "ARRAY" and _shapes_at_rest(obj, modifier, sources, _MUCH):
            found.append(modifier)
        posed = posed or (modifier.type == "ARMATURE" and bool(modifier.object) and modifier.show_viewport)
    return found


def move(obj: bpy.types.Object, name: str, place: int) -> None:
    """Move a modifier up the stack to this place. A new one need not be the last: Blender keeps some at the end."""
    index = obj.modifiers.find(name)
    obj.modifiers.move(index, min(place, index))


def follows_pose(modifier: bpy.types.Modifier, sources: Sequence[bpy.types.Object]) -> list[bpy.types.Object]:
    """The objects it looks at whose pose, or place, changes with that of the sources."""
    return [other for other in modifier_inputs.objects(modifier) if _moves(other, modifier, sources)]


def _moves(other: bpy.types.Object, modifier: bpy.types.Modifier, sources: Sequence[bpy.types.Object]) -> bool:
    """Whether a pose changes what the modifier sees of the object."""
    if other.type == "ARMATURE":
        return modifier_inputs.names_a_bone(modifier)
    if carried.is_carried(other, sources):
        return True
    return modifier.type in _FOLLOWS_A_SHAPE and carried.is_deformed(other, sources)


def _shapes_at_rest(
    obj: bpy.types.Object, modifier: bpy.types.Modifier, sources: Sequence[bpy.types.Object], least: float
) -> bool:
    """Whether it fits the mesh by places that no pose moves, and so is part of its rest shape."""
    if not modifier.show_viewport or not _is_fixed(modifier) or follows_pose(modifier, sources):
        return False
    if modifiers.keeps_vertices(modifier) or modifier.type == "NODES":
        return shapes.is_moved_by(obj, modifier, least)
    return True


def _is_fixed(modifier: bpy.types.Modifier) -> bool:
    """By its kind: a Displace along the normals builds on the pose, one along an axis or by places does not."""
    if modifier.type == "DISPLACE":
        by_place = modifier.texture is not None and modifier.texture_coords != "UV"
        return by_place or modifier.direction not in ("NORMAL", "CUSTOM_NORMAL")
    if modifier.type == "NODES":
        return modifier.node_group is not None and not all(map(_keeps_places, _nodes(modifier.node_group)))
    return modifier.type in _FIXED_IN_SPACE


def _nodes(tree: bpy.types.NodeTree) -> list[bpy.types.Node]:
    return [node for each in modifier_inputs.trees(tree) for node in each.nodes]


def _keeps_places(node: bpy.types.Node) -> bool:
    """Whether it surely moves no vertex, as those that Shade Auto Smooth adds; all others are tried."""
    return node.bl_idname.startswith(_KEEP_PLACES)
