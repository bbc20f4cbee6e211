"""The viewport preview: the present pose refined, on a stand-in beside the untouched mesh."""

from dataclasses import dataclass, field

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import native
from ..scene import armature, identity, preview_object
from ..scene.error import SceneError
from ..scene.identity import Identity
from . import character as characters
from .character import Character
from .follow import Follower, follow
from .params import RefineParams


@dataclass
class Live:
    """A preview under way. `object` and those of `garments` are found anew each time, as undo replaces them."""

    object: Identity
    body: Character
    refiner: native.Refiner
    garments: list[tuple[Identity, Follower]] = field(default_factory=list)
    pose: NDArray[np.float64] | None = None


current: Live | None = None


def start(obj: bpy.types.Object, garments: list[bpy.types.Object], params: RefineParams) -> Live:
    """Prepare everything, then show. Raises SceneError and native.NativeError with nothing changed."""
    global current
    stop()
    body = characters.read(obj)
    live = Live(identity.of(obj), body, body.refiner(params))
    for garment in garments:
        if tuple(map(tuple, garment.matrix_world)) != tuple(map(tuple, obj.matrix_world)):
            raise SceneError(f"{garment.name} is moved, turned or scaled against {obj.name}: apply both transforms")
        live.garments.append((identity.of(garment), follow(body, characters.read(garment), np.eye(4))))
    try:
        for shown in (obj, *garments):
            preview_object.show(shown)
        current = live
        update()
    except BaseException:
        stop()
        raise
    return live


def stop() -> None:
    """Take the preview away without a trace."""
    global current
    current = None
    preview_object.clear()


def update() -> bool:
    """Refine the present pose if it is another one; whether anything was done.

    Raises SceneError if an object is gone, has another name or other vertices.
    """
    live = current
    if live is None:
        return False
    obj = live.object.find()
    if obj is None or armature.find(obj) is None or len(obj.data.vertices) != len(live.body.positions):
        raise SceneError(_lost(live))
    pose = characters.pose(obj, live.body)
    if live.pose is not None and np.array_equal(pose, live.pose):
        return False
    live.pose = pose
    refined = live.refiner.solve(pose, quality="live")
    if not preview_object.place(obj.name, refined):
        raise SceneError(_lost(live))
    _move_garments(live, pose, refined)
    return True


def _lost(live: Live) -> str:
    return f"{live.body.name}, its armature or its stand-in is gone, has another name or other vertices: start it again"


def _move_garments(live: Live, pose: NDArray[np.float64], refined: NDArray[np.float32]) -> None:
    displacement = refined - live.body.skinned(pose)
    for found, follower in live.garments:
        garment = found.find()
        if garment is not None:
            own = characters.pose(garment, follower.character)
            preview_object.place(garment.name, follower.positions(own, displacement))


def restart() -> None:
    """Show again what undo or saving took away. Raises SceneError as `update` does."""
    if current is None:
        return
    current.pose = None
    for shown in (current.object, *(garment for garment, _ in current.garments)):
        obj = shown.find()
        if obj is None:
            raise SceneError(_lost(current))
        if preview_object.of(obj.name) is None:
            preview_object.show(obj)
    update()
