"""The only code that touches Blender's data: numpy arrays out, numpy arrays in."""

from . import armature, attributes, changes, deformation, depth, error, mask, mesh, poses, vertex_groups

__all__ = [
    "armature",
    "attributes",
    "changes",
    "deformation",
    "depth",
    "error",
    "mask",
    "mesh",
    "poses",
    "vertex_groups",
]
