"""`skinwright refine ACTION [file.blend] --object NAME`: corrective keys and cached actions without a window."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import bpy

from .. import files, jobs, native
from ..declared import declared, described, from_json
from ..errors import Refused
from ..refine import cache, correctives
from ..refine.params import CacheFormat, CorrectiveParams
from ..scene import armature, blend_file, mesh_cache
from ..scene.error import SceneError

Report = correctives.CorrectiveReport | cache.CacheReport
Action = Callable[[argparse.Namespace, bpy.types.Object, CorrectiveParams], Report | str]


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("action", choices=list(ACTIONS), help="what to do")
    parser.add_argument("blend", nargs="?", type=Path, help="file to open first; without it the one that is open")
    parser.add_argument("--object", required=True, help="mesh to refine")
    parser.add_argument("--bone", action="append", default=[], help="joint to bake; may be repeated, all without it")
    parser.add_argument("--cache", type=Path, help=".pc2 or .mdd file to write")
    parser.add_argument("--frames", type=int, nargs=2, metavar=("FIRST", "LAST"), help="the scene's without it")
    parser.add_argument("--report", type=Path, help="write what was done as JSON")
    parser.add_argument("--save", type=Path, help="save the result as this .blend file")
    parser.add_argument("--overwrite", action="store_true", help="let outputs replace any file that exists")
    group = parser.add_argument_group("settings, angles in degrees")
    for name, (kind, one) in declared(CorrectiveParams).items():
        sentence = described(kind, one, getattr(CorrectiveParams(), name)).replace("%", "%%")
        group.add_argument(f"--{name.replace('_', '-')}", metavar="VALUE", dest=f"set {name}", help=sentence)


def run(options: argparse.Namespace, value: Callable[[str], object]) -> int:
    """Do it and say so; `value` reads a setting. Raises Refused or OSError."""
    if native.problem():
        raise SceneError(native.problem())
    params = _params(options, value)
    _check_outputs(options)
    if options.blend:
        blend_file.open_file(options.blend)
    report = ACTIONS[options.action](options, blend_file.mesh_named(options.object), params)
    if options.save:
        blend_file.save_copy(options.save)
    if options.report:
        content = {"sentence": report} if isinstance(report, str) else report.to_json()
        files.write_report(options.report, content, overwrite=options.overwrite)
    print(report if isinstance(report, str) else report.sentence())
    return 0


def _params(options: argparse.Namespace, value: Callable[[str], object]) -> CorrectiveParams:
    """The settings given as arguments; a wrong type is wrong usage, as for the other commands."""
    given = {name.removeprefix("set "): text for name, text in vars(options).items() if name.startswith("set ")}
    try:
        return from_json(CorrectiveParams, {name: value(text) for name, text in given.items() if text is not None})
    except Refused:
        raise
    except ValueError as error:
        print(f"skinwright: {error}", file=sys.stderr)
        raise SystemExit(2) from error


def _check_outputs(options: argparse.Namespace) -> None:
    """Before anything is done: no output may cost a file, and no two may be one."""
    blends = [options.blend] if options.blend else blend_file.opened()
    overwrite, save = options.overwrite, [options.save] if options.save else []
    if options.report:
        others = [*blends, *save, *([options.cache] if options.cache else [])]
        files.check_output(options.report, others=others, overwrite=overwrite, replaces=files.REPORT)
    if options.cache:
        files.check_output(options.cache, others=[*blends, *save], overwrite=overwrite)
    if options.save:  # also over the file that was opened, but only if asked to
        files.check_output(options.save, overwrite=overwrite)


def _correctives(options: argparse.Namespace, obj: bpy.types.Object, params: CorrectiveParams) -> Report:
    rig = armature.find(obj)
    unknown = [name for name in options.bone if rig and name not in rig.data.bones]
    if rig and unknown:
        raise SceneError(f"{rig.name} has no bone {unknown[0]}: name its bones")
    return jobs.wait(correctives.steps(obj, params, set(options.bone)))


def _cache(options: argparse.Namespace, obj: bpy.types.Object, params: CorrectiveParams) -> Report:
    if not options.cache or options.cache.suffix.lower() not in (".pc2", ".mdd"):
        raise SceneError("refine cache needs --cache, a .pc2 or an .mdd")
    scene = bpy.context.scene
    first, last = options.frames or (scene.frame_start, scene.frame_end)
    kind: CacheFormat = "mdd" if options.cache.suffix.lower() == ".mdd" else "pc2"
    path = options.cache.resolve()
    mesh_cache.check_file(obj, path)
    return jobs.wait(cache.steps(obj, params, path, (first, last), kind, overwrite=options.overwrite))


def _remove(_options: argparse.Namespace, obj: bpy.types.Object, _params: CorrectiveParams) -> str:
    count, played = correctives.remove(obj), mesh_cache.remove(obj)
    return f"{obj.name}: {count} corrective keys and {int(played)} caches removed"


ACTIONS: dict[str, Action] = {"correctives": _correctives, "cache": _cache, "remove": _remove}
