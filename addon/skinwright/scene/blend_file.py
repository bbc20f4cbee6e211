"""The file that is open, opening another, saving a copy."""

from pathlib import Path

import bpy

from .error import SceneError


def opened() -> list[Path]:
    """The .blend that is open, which no output of ours replaces; none for one that was never saved."""
    return [Path(bpy.data.filepath)] if bpy.data.filepath else []


def open_file(blend: Path) -> None:
    """Open a file without its windows. Raises SceneError."""
    if not blend.is_file():
        raise SceneError(f"there is no file {blend}")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(blend.resolve()), load_ui=False)
    except RuntimeError as error:
        raise SceneError(f"{blend} cannot be opened: {error}") from error


def save_copy(path: Path) -> None:
    """Save the open file under another name; Blender writes it beside first. Raises SceneError."""
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), copy=True, check_existing=False)
    except RuntimeError as error:
        raise SceneError(f"{path} cannot be saved: {error}") from error


def object_named(name: str) -> bpy.types.Object:
    """The object of this name. Raises SceneError, which lists those there are."""
    obj = bpy.data.objects.get(name)
    if obj is None:
        names = sorted(bpy.data.objects.keys())
        listed = ", ".join(names[:50]) + (f" and {len(names) - 50} more" if len(names) > 50 else "")
        raise SceneError(f"there is no object {name}; there are {listed or 'none'}")
    return obj


def mesh_named(name: str) -> bpy.types.Object:
    """The same, if it is a mesh."""
    obj = object_named(name)
    if obj.type != "MESH":
        raise SceneError(f"{name} is not a mesh but {obj.type.replace('_', ' ').lower()}: name a mesh")
    return obj
