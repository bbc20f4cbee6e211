"""Bytes kept on a mesh under names of our own: saved with the file, copied with the mesh, undone with it."""

import bpy

_PREFIX = "skinwright_"


def read(mesh: bpy.types.Mesh, name: str) -> bytes:
    """What is kept under a name, or nothing."""
    value = mesh.get(_PREFIX + name, b"")
    return value if isinstance(value, bytes) else str(value).encode()


def write(mesh: bpy.types.Mesh, name: str, content: bytes) -> None:
    """Keep it; nothing is kept by forgetting."""
    # Blender cuts bytes at their first zero when they replace others, not when they are new.
    mesh.pop(_PREFIX + name, None)
    if content:
        mesh[_PREFIX + name] = content


def names(mesh: bpy.types.Mesh, start: str) -> list[str]:
    """The names that begin so."""
    return [key.removeprefix(_PREFIX) for key in mesh.keys() if key.startswith(_PREFIX + start)]
