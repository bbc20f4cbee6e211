"""Recorded or synthetic sculpts from a file, for studios and for tests.

An .npz file holds one sculpt a pose: `positions` (S, V, 3), where each vertex is to be in the mesh' own space, NaN
where it was not touched; and the poses, either `frames` (S,) of the scene, or `bones` (B,) with `matrices`
(S, B, 4, 4), the `matrix_basis` of these pose bones.
"""

from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..reporting import SculptReport
from ..scene import poses
from ..scene.error import SceneError
from .params import SculptParams, options_from_json
from .session import SculptSession

__all__ = ["options_from_json", "read", "replay"]

Sculpts = dict[str, NDArray]
# Kinds of NumPy types that each array may have.
_KINDS = {"positions": "fiu", "frames": "iu", "bones": "U", "matrices": "fiu"}


def read(path: Path) -> Sculpts:
    """The arrays of a file. Raises SceneError where they do not fit together."""
    try:
        with np.load(path, allow_pickle=False) as file:
            sculpts = {name: file[name] for name in file.files}
    except OSError as error:
        raise SceneError(f"{path} cannot be read: {error}") from error
    except Exception as error:  # numpy, zipfile and zlib each have their own
        raise SceneError(f"{path} cannot be read as an .npz file: {error}") from error
    problem = _problem(sculpts)
    if problem:
        raise SceneError(f"{path}: {problem}")
    return sculpts


def _problem(sculpts: Sculpts) -> str:
    if "positions" not in sculpts or sculpts["positions"].ndim != 3 or sculpts["positions"].shape[2] != 3:
        return "it needs an array `positions` of shape (sculpts, vertices, 3)"
    for name, kinds in _KINDS.items():
        if name in sculpts and sculpts[name].dtype.kind not in kinds:
            return f"`{name}` is of the type {sculpts[name].dtype}, which cannot be used"
    count = len(sculpts["positions"])
    if np.isinf(sculpts["positions"]).any():
        return "`positions` holds infinite numbers: NaN marks what was not touched"
    if "frames" in sculpts:
        return _problem_of_frames(sculpts["frames"], count)
    if "bones" not in sculpts or "matrices" not in sculpts:
        return "it needs `frames`, or `bones` and `matrices`, to say in which pose was sculpted"
    if sculpts["bones"].ndim != 1:
        return "`bones` must be a list of names"
    expected = (count, len(sculpts["bones"]), 4, 4)
    if sculpts["matrices"].shape != expected:
        return f"`matrices` must have shape {expected}"
    if len(set(sculpts["bones"].tolist())) != len(sculpts["bones"]):
        return "`bones` names a bone twice"
    if not np.isfinite(sculpts["matrices"]).all():
        return "`matrices` must be finite numbers"
    return "" if (sculpts["matrices"][..., 3, :] == (0, 0, 0, 1)).all() else "`matrices` must end in the row 0, 0, 0, 1"


def _problem_of_frames(frames: NDArray, count: int) -> str:
    if frames.shape != (count,):
        return f"`frames` must have shape ({count},)"
    beyond = [frame for frame in frames.tolist() if abs(frame) > poses.LAST_FRAME]
    return f"there is no frame {beyond[0]}, only up to {poses.LAST_FRAME}" if beyond else ""


def replay(obj: bpy.types.Object, sculpts: Sculpts, options: SculptParams) -> SculptReport:
    """Sculpt `obj` to all of them; afterwards pose and frame are as before.

    Raises SceneError or native.NativeError with the object as it was.
    """
    problem = _problem(sculpts)
    if problem:
        raise SceneError(f"The sculpts of {obj.name} cannot be used: {problem}")
    n = sculpts["positions"].shape[1]
    if n != len(obj.data.vertices):
        raise SceneError(f"{obj.name} has {len(obj.data.vertices)} vertices, but {n} were sculpted: use the same mesh")
    session = SculptSession(obj, options)
    try:
        for number in _poses(session.rig.find(), sculpts):
            positions = sculpts["positions"][number]
            touched = np.flatnonzero(np.isfinite(positions).all(axis=1))
            session.sculpt(touched, positions[touched].astype(np.float32))
    except BaseException:
        # Whatever has failed, a panic of the native module included: nothing stays half done.
        session.cancel()
        raise
    return session.commit()


def _poses(rig: bpy.types.Object, sculpts: Sculpts) -> Iterator[int]:
    if "frames" in sculpts:
        return poses.frames(sculpts["frames"].tolist())
    names = sculpts["bones"].tolist()
    missing = [name for name in names if name not in rig.pose.bones]
    if missing:
        raise SceneError(f"{rig.name} has no bone {missing[0]}, which was posed: use the same armature")
    return poses.recorded(rig, names, sculpts["matrices"])
