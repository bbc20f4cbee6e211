"""Objects from files: .blend files are appended, the others imported by Blender's own importers."""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import unquote

import bpy

from .error import SceneError


def empty() -> None:
    """Forget the open file for an empty one."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def load(path: Path) -> list[bpy.types.Object]:
    """Add the objects of a file to the open scene, by name. Raises SceneError for a file that cannot be read."""
    if not path.is_file():
        raise SceneError(f"There is no file {path}")
    before = set(bpy.data.objects)
    try:
        _LOADERS[path.suffix.lower()](path)
    except KeyError as error:
        raise SceneError(f"{path} is of a kind that cannot be read: use {', '.join(_LOADERS)}") from error
    except (RuntimeError, OSError) as error:
        raise SceneError(f"{path} cannot be read: {error}") from error
    return sorted(set(bpy.data.objects) - before, key=lambda obj: obj.name)


@contextmanager
def names_set_free(objects: Sequence[bpy.types.Object]) -> Iterator[None]:
    """What is loaded in the block keeps the names it has in its file, also those that `objects` have."""
    names = [obj.name for obj in objects]
    for obj in objects:
        obj.name = f"{obj.name} (set aside)"
    try:
        yield
    finally:
        for obj, name in zip(objects, names, strict=True):
            obj.name = name


def depends(*paths: Path) -> list[Path]:
    """The files that those which have been loaded are made of too: buffers of glTF, libraries of .blend files."""
    buffers = [buffer for path in paths if path.suffix.lower() == ".gltf" for buffer in _buffers(path)]
    libraries = [Path(bpy.path.abspath(library.filepath)) for library in bpy.data.libraries]
    found = dict.fromkeys(path.resolve() for path in (*buffers, *libraries))
    return sorted(path for path in found if path not in paths)


def _buffers(path: Path) -> list[Path]:
    names = [buffer.get("uri", "data:") for buffer in json.loads(path.read_text(encoding="utf-8")).get("buffers", [])]
    return [path.parent / unquote(name) for name in names if not name.startswith("data:")]


def _append(path: Path) -> None:
    with bpy.data.libraries.load(str(path), link=False) as (there, here):
        here.objects = there.objects
    for obj in here.objects:
        bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.update()


def _import_gltf(path: Path) -> None:
    bpy.ops.import_scene.gltf(filepath=str(path))


def _import_fbx(path: Path) -> None:
    bpy.ops.import_scene.fbx(filepath=str(path))


_LOADERS = {".blend": _append, ".glb": _import_gltf, ".gltf": _import_gltf, ".fbx": _import_fbx}
