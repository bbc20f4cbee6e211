"""Lists of Blender classes become the two functions that every module of them offers."""

from collections.abc import Callable

import bpy


def registration(*classes: type) -> tuple[Callable[[], None], Callable[[], None]]:
    """What a module calls `register` and `unregister`, for these classes; parents first."""

    def register() -> None:
        for cls in classes:
            bpy.utils.register_class(cls)

    def unregister() -> None:
        for cls in reversed(classes):
            bpy.utils.unregister_class(cls)

    return register, unregister
