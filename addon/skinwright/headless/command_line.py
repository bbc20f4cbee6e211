"""Work without a window: `blender -c skinwright transfer ...` or `sculpt ...`, and the scripts of the same names.

Exit codes: 0 done, 1 failed (the sentence is on stderr), 2 wrong usage.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy

from .. import native
from ..reporting import Report, SculptReport
from ..scene.error import SceneError
from ..sculpt.replay import options_from_json, read, replay
from ..sculpt.session import SculptOptions
from ..transfer import TransferParams, from_json, to_json, transfer_weights
from . import wardrobe as wardrobe_command

DONE, FAILED, USAGE = 0, 1, 2
Params = TransferParams | SculptOptions


class _Failure(Exception):
    """A sentence for stderr, with exit code 1."""


def main(arguments: list[str]) -> int:
    """`skinwright transfer ...`, `skinwright sculpt ...` or `skinwright --version`; gives the exit code."""
    parser = argparse.ArgumentParser(prog="skinwright", description="Skin weights without a window.")
    parser.add_argument("--version", action="version", version=f"Skinwright {native.addon_version()}")
    commands = parser.add_subparsers(dest="command", required=True)
    _add_transfer(commands.add_parser("transfer", help="transfer weights from a body to garments"))
    _add_sculpt(commands.add_parser("sculpt", help="turn recorded sculpts of a posed mesh into weights"))
    _add_wardrobe(commands.add_parser("wardrobe", help="transfer many garments to many bodies"))
    return _run(parser, arguments)


def wardrobe(arguments: list[str]) -> int:
    """The same without the word `wardrobe`, for the script."""
    parser = argparse.ArgumentParser(prog="wardrobe.py", description="Transfer many garments to many bodies.")
    _add_wardrobe(parser)
    return _run(parser, arguments)


def transfer(arguments: list[str]) -> int:
    """The same without the word `transfer`, for the script."""
    description = "Transfer weights from a body to garments."
    parser = argparse.ArgumentParser(prog="transfer_weights.py", description=description)
    _add_transfer(parser)
    return _run(parser, arguments)


def sculpt(arguments: list[str]) -> int:
    """The same without the word `sculpt`, for the script."""
    description = "Turn recorded sculpts of a posed mesh into weights."
    parser = argparse.ArgumentParser(prog="sculpt_weights.py", description=description)
    _add_sculpt(parser)
    return _run(parser, arguments)


def _add_transfer(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("blend", nargs="?", type=Path, help="file to open first; without it the one that is open")
    parser.add_argument("--source", required=True, help="object whose weights are transferred")
    parser.add_argument("--target", required=True, action="append", help="object to transfer to; may be repeated")
    _add_common(parser, "max_normal_angle in degrees", to_json(TransferParams()))
    parser.set_defaults(work=_transfer, read=from_json, write=to_json, default=TransferParams())


def _add_sculpt(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("blend", nargs="?", type=Path, help="file to open first; without it the one that is open")
    parser.add_argument("--target", required=True, help="object that was sculpted")
    parser.add_argument("--sculpts", required=True, type=Path, help=".npz file of positions and poses")
    _add_common(parser, "names as in SculptOptions", vars(SculptOptions()))
    parser.set_defaults(work=_sculpt, read=options_from_json, write=vars, default=SculptOptions())


def _add_wardrobe(parser: argparse.ArgumentParser) -> None:
    wardrobe_command.add(parser)
    parser.set_defaults(run=wardrobe_command.run)


def _add_common(parser: argparse.ArgumentParser, settings: str, defaults: dict[str, Any]) -> None:
    listed = ", ".join(f"{name} {json.dumps(value)}" for name, value in defaults.items())
    parser.epilog = f"Settings and their defaults: {listed}."
    parser.add_argument("--settings", type=Path, help=f"JSON object of settings; {settings}")
    parser.add_argument("--threads", type=int, help="processor threads, 0 for all")
    parser.add_argument("--report", type=Path, help="write what was done as JSON")
    parser.add_argument("--save", type=Path, help="save the result as this .blend file")


def _run(parser: argparse.ArgumentParser, arguments: list[str]) -> int:
    try:
        options = parser.parse_args(arguments)
        params = None if hasattr(options, "run") else _params(parser, options)
    except SystemExit as leave:  # argparse has said what is wrong; a host application must not be ended by it
        return leave.code if isinstance(leave.code, int) else USAGE
    if params is None:
        return options.run(options)
    try:
        report = _work(options, params)
        _write_report(options, params, report)
    except (_Failure, SceneError, native.NativeError, OSError) as error:
        print(f"skinwright: {error}", file=sys.stderr)
        return FAILED
    for warning in report.all_warnings():
        print(f"skinwright: warning: {warning}", file=sys.stderr)
    print(report.sentence())
    return DONE


def _params(parser: argparse.ArgumentParser, options: argparse.Namespace) -> Params:
    try:
        params = options.read(json.loads(options.settings.read_text())) if options.settings else options.default
    except (OSError, ValueError) as error:
        parser.error(f"--settings {options.settings}: {error}")
    return params if options.threads is None else replace(params, threads=options.threads)


def _work(options: argparse.Namespace, params: Params) -> Report | SculptReport:
    if native.problem():
        raise _Failure(native.problem())
    if options.blend:
        _open(options.blend)
    report = options.work(options, params)
    if options.save:
        _save(options.save)
    return report


def _transfer(options: argparse.Namespace, params: TransferParams) -> Report:
    return transfer_weights(bpy.context, _object(options.source), [_object(n) for n in options.target], params)


def _sculpt(options: argparse.Namespace, params: SculptOptions) -> SculptReport:
    return replay(_object(options.target), read(options.sculpts), params)


def _open(blend: Path) -> None:
    if not blend.is_file():
        raise _Failure(f"there is no file {blend}")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(blend.resolve()), load_ui=False)
    except RuntimeError as error:
        raise _Failure(f"{blend} cannot be opened: {error}") from error


def _save(path: Path) -> None:
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), copy=True, check_existing=False)
    except RuntimeError as error:
        raise _Failure(f"{path} cannot be saved: {error}") from error


def _object(name: str) -> bpy.types.Object:
    obj = bpy.data.objects.get(name)
    if obj is None:
        raise _Failure(f"there is no object {name}; there are {', '.join(sorted(bpy.data.objects.keys())) or 'none'}")
    return obj


def _write_report(options: argparse.Namespace, params: Params, report: Report | SculptReport) -> None:
    if options.report:
        content: dict[str, Any] = {"version": native.addon_version(), "settings": options.write(params)}
        content |= report.to_json()
        options.report.write_text(json.dumps(content, indent=2) + "\n")


_commands: list[object] = []


def register() -> None:
    """Register `blender -c skinwright`."""
    _commands.append(bpy.utils.register_cli_command("skinwright", main))


def unregister() -> None:
    """Unregister it."""
    bpy.utils.unregister_cli_command(_commands.pop())
