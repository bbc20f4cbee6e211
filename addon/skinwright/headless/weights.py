"""`skinwright weights ACTION [file.blend] --object NAME`: stored weights without a window."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import bpy

from .. import files
from ..scene import blend_file
from ..scene.error import SceneError
from ..stored import comparing, exchange, keeping, restoring

_CHANGING = ("store", "restore", "forget", "import")
Action = Callable[[argparse.Namespace, bpy.types.Object], str]


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("action", choices=list(ACTIONS), help="what to do")
    parser.add_argument("blend", nargs="?", type=Path, help="file to open first; without it the one that is open")
    parser.add_argument("--object", required=True, help="mesh whose weights these are")
    parser.add_argument("--name", default="", help="which stored state; the newest without it")
    parser.add_argument("--file", type=Path, help=".npz or .json to export to or import from")
    parser.add_argument("--save", type=Path, help="save the result as this .blend file")
    parser.add_argument("--overwrite", action="store_true", help="let outputs replace any file that exists")


def run(options: argparse.Namespace) -> int:
    """Do it and say so. Raises Refused or OSError."""
    if options.action in ("export", "import") and not options.file:
        raise SceneError(f"weights {options.action} needs --file, an .npz or a .json")
    blends = [options.blend] if options.blend else blend_file.opened()
    written = [options.file] if options.file and options.action == "export" else []
    read = [options.file] if options.file and options.action == "import" else []
    for path in written:
        files.check_output(
            path, others=[*blends, *([options.save] if options.save else [])], overwrite=options.overwrite
        )
    if options.save:
        files.check_output(options.save, others=read, overwrite=options.overwrite)
    if options.blend:
        blend_file.open_file(options.blend)
    print(ACTIONS[options.action](options, blend_file.mesh_named(options.object)))
    if options.save:
        blend_file.save_copy(options.save)
    elif options.blend and options.action in _CHANGING:
        print("skinwright: warning: nothing was saved: name a file with --save", file=sys.stderr)
    return 0


def _list(_options: argparse.Namespace, obj: bpy.types.Object) -> str:
    found = keeping.entries(obj)
    lines = [f"{entry.name}: {entry.vertices} vertices, {entry.members} members" for entry in found]
    return "\n".join([*lines, f"{obj.name}: {len(found)} states, {keeping.size(obj)} bytes"])


def _store(options: argparse.Namespace, obj: bpy.types.Object) -> str:
    keeping.keep(obj, options.name or "Weights")
    return f"{obj.name}: weights stored, {keeping.size(obj)} bytes with all states"


def _restore(options: argparse.Namespace, obj: bpy.types.Object) -> str:
    return restoring.restore(obj, keeping.load(obj, name=options.name)).sentence(obj.name)


def _compare(options: argparse.Namespace, obj: bpy.types.Object) -> str:
    kept = exchange.read(options.file) if options.file else keeping.load(obj, name=options.name)
    return comparing.compare(obj, kept, options.name or "the stored weights").sentence()


def _forget(_options: argparse.Namespace, obj: bpy.types.Object) -> str:
    return f"{obj.name}: {keeping.purge(obj)} bytes of stored weights removed"


def _export(options: argparse.Namespace, obj: bpy.types.Object) -> str:
    kept = keeping.load(obj, name=options.name) if options.name else keeping.take(obj)
    exchange.write(options.file, kept, overwrite=options.overwrite)
    return f"{obj.name}: weights written to {options.file}"


def _import(options: argparse.Namespace, obj: bpy.types.Object) -> str:
    return restoring.restore(obj, exchange.read(options.file)).sentence(obj.name)


ACTIONS: dict[str, Action] = {
    "list": _list,
    "store": _store,
    "restore": _restore,
    "compare": _compare,
    "forget": _forget,
    "export": _export,
    "import": _import,
}
