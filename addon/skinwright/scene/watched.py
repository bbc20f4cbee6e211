"""Objects that must be the same between reading and writing, while the window or a script lives on."""

from collections.abc import Generator, Iterable
from functools import partial
from typing import Any, TypeVar

import bpy

from .error import SceneError

T = TypeVar("T")


class Watched:
    """Remembers how many vertices and faces, or bones, each object has."""

    def __init__(self, objects: Iterable[bpy.types.Object | None]) -> None:
        self._before = [(obj, obj.name, _size(obj)) for obj in objects if obj]

    def during(self, steps: Generator[Any, Any, T]) -> Generator[Any, Any, T]:
        """The same steps, with a look at the objects before each goes on."""
        go_on = partial(next, steps)
        while True:
            try:
                job = go_on()
            except StopIteration as end:
                return end.value
            try:
                go_on = partial(steps.send, (yield job))
            except Exception as error:
                go_on = partial(steps.throw, error)
            self.check()

    def check(self) -> None:
        """Raise SceneError if an object is gone, has changed or is in Edit mode."""
        for obj, name, size in self._before:
            try:
                now = _size(obj)
            except ReferenceError as error:
                raise SceneError(f"{name} was deleted meanwhile, so nothing was written") from error
            if now != size:
                raise SceneError(f"{name} was changed meanwhile, so nothing was written: start again")
            if obj.mode == "EDIT" and obj.type == "MESH":
                raise SceneError(f"{name} is in Edit mode now, so nothing was written: leave it and start again")


def _size(obj: bpy.types.Object) -> tuple[int, ...]:
    data = obj.data
    if obj.type == "ARMATURE":
        return (len(data.bones),)
    return (len(data.vertices), len(data.polygons)) if obj.type == "MESH" else ()
