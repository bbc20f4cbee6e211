"""The match mask: a vertex group that says where to inpaint and where to force a match."""

from enum import Enum

import bpy
import numpy as np
from numpy.typing import NDArray

from . import vertex_groups
from .error import SceneError

INPAINT, AUTOMATIC, FORCE_MATCH = 0, 1, 2


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
