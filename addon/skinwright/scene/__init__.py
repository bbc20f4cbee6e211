"""The only code that touches Blender's data: numpy arrays out, numpy arrays in."""

from . import (
    armature,
    attributes,
    changes,
    corrective,
    deformation,
    depth,
    editable,
    error,
    mask,
    mesh,
    poses,
    rest_bones,
    rest_shape,
    sculpting,
    vertex_groups,
)

__all__ = [
    "armature",
    "attributes",
    "changes",
    "corrective",
    "deformation",
    "depth",
    "editable",
    "error",
    "mask",
    "mesh",
    "poses",
    "rest_bones",
    "rest_shape",
    "sculpting",
    "vertex_groups",
]
