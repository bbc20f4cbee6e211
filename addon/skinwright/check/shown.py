"""The checks done last, for the panel and the overlay: by the name of the mesh, as undo replaces objects."""

import bpy

from ..scene import poses
from ..scene.error import SceneError
from .weight_check import WeightCheck

_last: dict[str, WeightCheck] = {}


def keep(results: list[WeightCheck]) -> None:
    """Make these the last ones."""
    _last.clear()
    _last.update({result.target: result for result in results})


def forget() -> None:
    """Another file is open now."""
    _last.clear()


def of(obj: bpy.types.Object | None) -> WeightCheck | None:
    """The last check of this mesh, while it has as many vertices."""
    result = _last.get(obj.name) if obj and obj.type == "MESH" else None
    return result if result and obj and len(obj.data.vertices) == result.vertices else None


def take_worst_pose(obj: bpy.types.Object) -> str:
    """Put the armature into the pose with the most faults; returns its name. Raises SceneError if it does not obey."""
    result = of(obj)
    if result is None or result.worst is None:
        raise SceneError(f"{obj.name} has no fault in any pose: check its weights first")
    poses.take(obj, result.bones, result.worst.pose_from_rest)
    return result.worst.name
