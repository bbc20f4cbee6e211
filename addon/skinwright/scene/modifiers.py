"""What each kind of modifier does to a mesh: which keep its vertices, which move them, which change its weights."""

import bpy

# These keep every vertex and its index. All others, Geometry Nodes too, may change them.
KEEPS_VERTICES = {
    "ARMATURE",
    "CAST",
    "CLOTH",
    "CORRECTIVE_SMOOTH",
    "CURVE",
    "DATA_TRANSFER",
    "DISPLACE",
    "HOOK",
    "LAPLACIANDEFORM",
    "LAPLACIANSMOOTH",
    "LATTICE",
    "MESH_CACHE",
    "MESH_DEFORM",
    "NORMAL_EDIT",
    "SHRINKWRAP",
    "SIMPLE_DEFORM",
    "SMOOTH",
    "SOFT_BODY",
    "SURFACE_DEFORM",
    "UV_PROJECT",
    "UV_WARP",
    "VERTEX_WEIGHT_EDIT",
    "VERTEX_WEIGHT_MIX",
    "VERTEX_WEIGHT_PROXIMITY",
    "VOLUME_DISPLACE",
    "WARP",
    "WAVE",
    "WEIGHTED_NORMAL",
}
_MOVES_NOTHING = {
    "DATA_TRANSFER",
    "NORMAL_EDIT",
    "UV_PROJECT",
    "UV_WARP",
    "VERTEX_WEIGHT_EDIT",
    "VERTEX_WEIGHT_MIX",
    "VERTEX_WEIGHT_PROXIMITY",
    "WEIGHTED_NORMAL",
}
_WRITES_WEIGHTS = {"VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY"}
# They draw the same shape with other vertices, so nothing is missed without them. A Mirror is looked at by itself.
_REFINES = {
    "BEVEL",
    "DECIMATE",
    "EDGE_SPLIT",
    "MASK",
    "MIRROR",
    "SOLIDIFY",
    "SUBSURF",
    "TRIANGULATE",
    "WELD",
    "WIREFRAME",
}


def shown(obj: bpy.types.Object) -> list[bpy.types.Modifier]:
    """The modifiers that are on in the viewport, first to last."""
    return [modifier for modifier in obj.modifiers if modifier.show_viewport]


def used(obj: bpy.types.Object) -> list[bpy.types.Modifier]:
    """The modifiers that are on in the viewport or in renders, first to last."""
    return [modifier for modifier in obj.modifiers if modifier.show_viewport or modifier.show_render]


def welded(obj: bpy.types.Object) -> float:
    """Up to which distance Weld modifiers make one vertex of several, in the mesh's own units."""
    return max((m.merge_threshold for m in used(obj) if m.type == "WELD" and m.mode == "ALL"), default=0.0)


def keeps_vertices(modifier: bpy.types.Modifier) -> bool:
    """Whether each vertex is still the vertex of this index afterwards."""
    return modifier.type in KEEPS_VERTICES


def moves(modifier: bpy.types.Modifier) -> bool:
    """Whether it may move vertices or make others; the armature's pose is not meant."""
    return modifier.type not in _MOVES_NOTHING | {"ARMATURE"}


def plays_a_file(modifier: bpy.types.Modifier) -> bool:
    """Whether it takes the shape from a cache on disk."""
    if modifier.type == "MESH_CACHE":
        return bool(modifier.filepath) and modifier.factor > 0
    return modifier.type == "MESH_SEQUENCE_CACHE" and modifier.cache_file is not None


def transfers_weights(modifier: bpy.types.Modifier) -> bool:
    """Whether it is a Data Transfer that writes vertex groups."""
    if modifier.type != "DATA_TRANSFER" or not modifier.use_vert_data:
        return False
    return "VGROUP_WEIGHTS" in modifier.data_types_verts


def changes_weights(modifier: bpy.types.Modifier) -> bool:
    """Whether it may change vertex groups."""
    return modifier.type in _WRITES_WEIGHTS or transfers_weights(modifier)


def written_group(modifier: bpy.types.Modifier) -> str:
    """The group that a Vertex Weight modifier writes, or nothing."""
    if modifier.type == "VERTEX_WEIGHT_MIX":
        return modifier.vertex_group_a
    return modifier.vertex_group if modifier.type in _WRITES_WEIGHTS else ""


def hides_shape(modifier: bpy.types.Modifier) -> bool:
    """Whether it makes a shape that no vertex of the original mesh stands for."""
    return not keeps_vertices(modifier) and modifier.type not in _REFINES
