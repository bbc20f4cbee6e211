"""Lists of Blender classes become the two functions that every module of them offers."""

from collections.abc import Callable

import bpy


def registration(*classes: type) -> tuple[Callable[[], None], Callable[[], None]]:
    """Return the functions that register these classes, parents first, and unregister them."""

    def register() -> None:
        for cls in classes:
            bpy.utils.register_class(cls)

    def unregister() -> None:
        for cls in reversed(classes):
            bpy.utils.unregister_class(cls)

    return register, unregister
