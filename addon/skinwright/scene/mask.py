"""The match mask: a vertex group that says where to inpaint and where to force a match."""

from enum import Enum

import bpy
import numpy as np
from numpy.typing import NDArray

from ..csr import Rows
from . import editable, symmetry, vertex_groups
from .error import SceneError

INPAINT, AUTOMATIC, FORCE_MATCH = 0, 1, 2

DEFAULT_GROUP = "Match Mask"

# (V,) weights of the mask's group: 0 inpaints, 0.5 is automatic, 1 forces a match.
Values = NDArray[np.float32]


class Reading(Enum):
    """How a group is read as a mask."""

    STEER = "STEER"  # below a quarter inpaints, above three quarters forces a match, all else is automatic
    PAINTED = "PAINTED"  # other tools' masks: painted means inpaint


def read(
    obj: bpy.types.Object, group: str, reading: Reading, *, threshold: float = 0.5, invert: bool = False
) -> NDArray[np.uint8]:
    """(V,) 0 inpaint, 1 automatic, 2 force match. `threshold` and `invert` are for PAINTED only.

    Not being in the group is automatic when steering, and not painted otherwise. Raises SceneError without the group.
    """
    if group not in obj.vertex_groups:
        raise SceneError(
            f"{obj.name} has no vertex group {group} to use as match mask: pick another or clear the field"
        )
    rows = vertex_groups.read(obj, [group])
    member = np.diff(rows.indptr).astype(bool)
    weight = np.zeros(len(member), np.float32)
    weight[member] = rows.values
    if reading is Reading.STEER:
        return np.select([member & (weight < 0.25), weight > 0.75], [INPAINT, FORCE_MATCH], AUTOMATIC).astype(np.uint8)
    painted = (weight > threshold) != invert
    return np.where(painted, INPAINT, AUTOMATIC).astype(np.uint8)


def check(obj: bpy.types.Object) -> None:
    """Raise SceneError for a mask that cannot be edited here."""
    editable.check(obj)
    settings = obj.skinwright
    if settings.mask_group and settings.mask_reading != Reading.STEER.value:
        raise SceneError(f"The mask of {obj.name} is read as another tool's: set Reading to Steer to edit it here")


def ensure(obj: bpy.types.Object) -> str:
    """Name of the group that is the object's mask, made and filled with automatic where there is none.

    Raises SceneError for a mask that is read in another tool's way.
    """
    check(obj)
    settings = obj.skinwright
    if settings.mask_group in obj.vertex_groups:
        return settings.mask_group
    settings.mask_group, settings.mask_reading = obj.vertex_groups.new(name=DEFAULT_GROUP).name, "STEER"
    write(obj, np.full(len(obj.data.vertices), 0.5, np.float32))
    return settings.mask_group


def values(obj: bpy.types.Object, group: str) -> Values:
    """The group's weights, automatic where a vertex is no member."""
    rows = vertex_groups.read(obj, [group])
    weights = np.full(len(rows.indptr) - 1, 0.5, np.float32)
    weights[np.diff(rows.indptr).astype(bool)] = rows.values
    return weights


def write(obj: bpy.types.Object, weights: Values) -> None:
    """Make these the weights of the object's mask."""
    indptr = np.arange(len(weights) + 1, dtype=np.uint32)
    rows = Rows(indptr, np.zeros(len(weights), np.uint32), weights.astype(np.float32))
    vertex_groups.write(obj, [obj.skinwright.mask_group], rows)


def from_match(matched: NDArray[np.bool_]) -> Values:
    """What matches is forced to, the rest is inpainted."""
    return matched.astype(np.float32)


def with_value(weights: Values, chosen: NDArray[np.bool_], value: float) -> Values:
    """The same but for the chosen vertices."""
    return np.where(chosen, np.float32(value), weights)


def cleared(weights: Values) -> Values:
    """Automatic everywhere."""
    return np.full_like(weights, 0.5)


def grow(weights: Values, edges: NDArray[np.integer]) -> Values:
    """Inpaint the neighbours of inpainted vertices too; `edges` (E, 2)."""
    return with_value(weights, _beside(weights < 0.25, edges), 0.0)


def shrink(weights: Values, edges: NDArray[np.integer]) -> Values:
    """Make the inpainted vertices automatic that have a neighbour which is not inpainted."""
    inpainted = weights < 0.25
    return with_value(weights, inpainted & _beside(~inpainted, edges), 0.5)


def mirrored(weights: Values, positions: NDArray[np.float32], side: int) -> Values:
    """The mask of the side where x * `side` > 0 on the other as well; a vertex without a partner keeps its own."""
    partner = symmetry.partners(positions)
    taken = (positions[:, 0] * side < 0) & (partner >= 0)
    return np.where(taken, weights[partner], weights)


def counts(weights: Values) -> tuple[int, int, int]:
    """Vertices that inpaint, are automatic, are forced to match."""
    inpainted, forced = int((weights < 0.25).sum()), int((weights > 0.75).sum())
    return inpainted, len(weights) - inpainted - forced, forced


def _beside(marked: NDArray[np.bool_], edges: NDArray[np.integer]) -> NDArray[np.bool_]:
    beside = np.zeros_like(marked)
    beside[edges[marked[edges[:, 0]], 1]] = True
    beside[edges[marked[edges[:, 1]], 0]] = True
    return beside
