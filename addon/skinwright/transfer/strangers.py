"""Groups of a character whose weights count for nothing, as no deforming bone has their name."""

from collections.abc import Sequence

import bpy
import numpy as np

from .. import csr
from ..scene import armature, vertex_groups

# A group is taken for a bone's if, for this share of its vertices, it is what their weights lack to sum to 1.
_MOST_OF_IT = 0.5
_CLOSE = 0.01
_NAMED = 3


def warnings(objects: Sequence[bpy.types.Object], rigs: Sequence[bpy.types.Object], bones: Sequence[str]) -> list[str]:
    """A sentence per group of a character's meshes `objects`, whose deforming bones with weights are `bones`."""
    if not rigs:
        return []
    found = [(obj, name, count) for obj in objects for name, count in _completing(obj, bones)]
    return [_sentence(obj, rigs, name, count) for obj, name, count in found][:_NAMED]


def _completing(obj: bpy.types.Object, bones: Sequence[str]) -> list[tuple[str, int]]:
    """The groups that would complete rows of deforming weights, and at how many vertices, most first."""
    sums = csr.row_sums(vertex_groups.read(obj, bones))
    lacking = sums < 1 - _CLOSE
    names = [group.name for group in obj.vertex_groups if group.name not in bones]
    if not lacking.any() or not names:
        return []
    rows = vertex_groups.read(obj, names)
    vertex = csr.entry_vertices(rows)
    has_weight = rows.values > 1e-3
    whole = (sums + csr.row_sums(rows))[vertex], sums[vertex] + rows.values
    completes = has_weight & lacking[vertex] & (np.abs(np.array(whole) - 1) < _CLOSE).any(axis=0)
    found, members = (np.bincount(rows.bones[chosen], minlength=len(names)) for chosen in (completes, has_weight))
    strangers = np.flatnonzero((found > 0) & (found >= _MOST_OF_IT * members))
    return [(names[j], int(found[j])) for j in strangers[np.argsort(-found[strangers], kind="stable")].tolist()]


def _sentence(obj: bpy.types.Object, rigs: Sequence[bpy.types.Object], name: str, count: int) -> str:
    shown = name if name == name.strip() else f"'{name}'"
    said = f"{count} vertices of {obj.name} have weights in the group {shown}, "
    if any(name in each.data.bones for each in rigs):
        return f"{said}whose bone does not deform, so that these do not count: turn on its Deform, or remove the group"
    free = sorted(set().union(*map(armature.deform_bones, rigs)) - {group.name for group in obj.vertex_groups})
    alike = [bone for bone in free if bone.strip().casefold() == name.strip().casefold()] or free
    hint = f", {alike[0]} perhaps" if len(alike) == 1 else ""
    return f"{said}and {rigs[0].name} has no bone of that name: rename the group as its bone{hint}"
