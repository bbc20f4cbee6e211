"""Refined positions of an action, frame by frame, in a point cache file that the Mesh Cache modifier plays."""

import struct
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import files, jobs, memory
from ..scene import mesh_cache, object_state, poses
from ..scene.error import SceneError
from ..scene.watched import Watched
from . import character as characters
from .params import CacheFormat, RefineParams
from .solving import Solving


@dataclass(frozen=True)
class CacheReport:
    """What was written."""

    target: str
    path: str
    frames: int
    warnings: list[str] = field(default_factory=list)

    def sentence(self) -> str:
        """One line for the status bar."""
        return f"{self.target}: {self.frames} refined frames in {self.path}"

    def all_warnings(self) -> list[str]:
        """Sentences worth a look."""
        return self.warnings

    def to_json(self) -> dict[str, object]:
        """Plain values."""
        return asdict(self)


def steps(
    obj: bpy.types.Object,
    params: RefineParams,
    path: Path,
    frames: tuple[int, int],
    kind: CacheFormat = "pc2",
    *,
    overwrite: bool = True,
) -> "jobs.Jobs[CacheReport]":
    """Solve every frame of the range and write the file whole at the end; then let the modifier play it.

    Raises SceneError, native.NativeError and files.FileError before anything is written.
    """
    first, last = frames
    if last < first:
        raise SceneError(f"the last frame, {last}, lies before the first, {first}")
    if max(-first, last) > poses.LAST_FRAME:
        raise SceneError(f"frames {first} to {last} are too far out: Blender shows none beyond {poses.LAST_FRAME}")
    mesh_cache.check(obj)
    rig = characters.rig_of(obj)
    poses.check_shown(rig)
    files.check_output(path, overwrite=overwrite)
    character = characters.read(obj)
    seen = Watched([obj, rig])
    memory.expect(f"Refining {last - first + 1} frames of {obj.name}", _bytes(character, last - first + 1))
    matrices = list(_poses(obj, character, range(first, last + 1)))
    refiner = (yield Solving([lambda: character.refiner(params)]))[0]
    tasks = [lambda pose=pose: refiner.solve(pose, quality="bake") for pose in matrices]
    solved = yield Solving(tasks)
    seen.check()
    positions = np.stack(solved)
    if not np.isfinite(positions).all():
        raise SceneError(f"{obj.name}: a refined frame is not finite; nothing was written")
    fps = bpy.context.scene.render.fps / bpy.context.scene.render.fps_base
    content = pc2(positions, first) if kind == "pc2" else mdd(positions, first, fps)
    with object_state.all_or_nothing([obj]):
        mesh_cache.play(obj, path, kind, first)
        files.write_whole(path, content)
    return CacheReport(obj.name, str(path), len(positions), _warnings(obj))


def _warnings(obj: bpy.types.Object) -> list[str]:
    """Shape keys that the frames change: the shape of when baking began is in all frames."""
    keys = obj.data.shape_keys
    if not (keys and keys.animation_data and keys.animation_data.action):
        return []
    frame = bpy.context.scene.frame_current
    return [f"{obj.name} has animated shape keys: the cache holds them as they are at frame {frame}"]


def _bytes(character: characters.Character, frames: int) -> int:
    """Of the solved frames, the same in one array, and the file's content; and of the poses."""
    return frames * (3 * character.positions.nbytes + 2 * character.rest_bones.nbytes)


def _poses(obj: bpy.types.Object, character: characters.Character, frames: range) -> Iterator[NDArray[np.float64]]:
    for _ in poses.frames(list(frames)):
        yield characters.pose(obj, character)


def pc2(positions: NDArray[np.float32], first: int) -> bytes:
    """Point Cache 2: positions (F, V, 3)."""
    frames, vertices = positions.shape[:2]
    header = struct.pack("<12siiffi", b"POINTCACHE2\0", 1, vertices, float(first), 1.0, frames)
    return header + positions.astype("<f4").tobytes()


def mdd(positions: NDArray[np.float32], first: int, fps: float) -> bytes:
    """Motion Designer data: positions (F, V, 3) and the time of each frame in seconds."""
    frames, vertices = positions.shape[:2]
    times = (np.arange(frames, dtype=np.int64) + first) / fps
    return struct.pack(">ii", frames, vertices) + times.astype(">f4").tobytes() + positions.astype(">f4").tobytes()
