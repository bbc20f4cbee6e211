"""The transfer without a window: `blender -c skinwright transfer ...`, and blender_scripts/transfer_weights.py.

Exit codes: 0 done, 1 failed (the sentence is on stderr), 2 wrong usage.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy

from . import native
from .reporting import Report
from .scene.error import SceneError
from .transfer import TransferParams, from_json, to_json, transfer_weights

DONE, FAILED, USAGE = 0, 1, 2


class _Failure(Exception):
    """A sentence for stderr, with exit code 1."""


def main(arguments: list[str]) -> int:
    """`skinwright transfer ...` or `skinwright --version`; gives the exit code."""
    parser = argparse.ArgumentParser(prog="skinwright", description="Skin weights without a window.")
    parser.add_argument("--version", action="version", version=f"Skinwright {native.addon_version()}")
    commands = parser.add_subparsers(dest="command", required=True)
    _add_arguments(commands.add_parser("transfer", help="transfer weights from a body to garments"))
    return _run(parser, arguments)


def transfer(arguments: list[str]) -> int:
    """The same without the word `transfer`, for the script."""
    parser = argparse.ArgumentParser(
        prog="transfer_weights.py", description="Transfer weights from a body to garments."
    )
    _add_arguments(parser)
    return _run(parser, arguments)


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    defaults = ", ".join(f"{name} {json.dumps(value)}" for name, value in to_json(TransferParams()).items())
    parser.epilog = f"Settings and their defaults: {defaults}."
    parser.add_argument("blend", nargs="?", type=Path, help="file to open first; without it the one that is open")
    parser.add_argument("--source", required=True, help="object whose weights are transferred")
    parser.add_argument("--target", required=True, action="append", help="object to transfer to; may be repeated")
    parser.add_argument("--settings", type=Path, help="JSON object of settings; max_normal_angle in degrees")
    parser.add_argument("--threads", type=int, help="processor threads, 0 for all")
    parser.add_argument("--report", type=Path, help="write what was done as JSON")
    parser.add_argument("--save", type=Path, help="save the result as this .blend file")


def _run(parser: argparse.ArgumentParser, arguments: list[str]) -> int:
    try:
        options = parser.parse_args(arguments)
        params = _params(parser, options)
    except SystemExit as leave:  # argparse has said what is wrong; a host application must not be ended by it
        return leave.code if isinstance(leave.code, int) else USAGE
    try:
        report = _transfer(options, params)
        _write_report(options, params, report)
    except (_Failure, SceneError, native.NativeError, OSError) as error:
        print(f"skinwright: {error}", file=sys.stderr)
        return FAILED
    for warning in report.all_warnings():
        print(f"skinwright: warning: {warning}", file=sys.stderr)
    print(report.sentence())
    return DONE


def _params(parser: argparse.ArgumentParser, options: argparse.Namespace) -> TransferParams:
    try:
        settings = json.loads(options.settings.read_text()) if options.settings else {}
        params = from_json(settings)
    except (OSError, ValueError) as error:
        parser.error(f"--settings {options.settings}: {error}")
    return params if options.threads is None else replace(params, threads=options.threads)


def _transfer(options: argparse.Namespace, params: TransferParams) -> Report:
    if native.problem():
        raise _Failure(native.problem())
    if options.blend:
        _open(options.blend)
    report = transfer_weights(bpy.context, _object(options.source), [_object(n) for n in options.target], params)
    if options.save:
        _save(options.save)
    return report


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


def _write_report(options: argparse.Namespace, params: TransferParams, report: Report) -> None:
    if options.report:
        content: dict[str, Any] = {"version": native.addon_version(), "settings": to_json(params)} | report.to_json()
        options.report.write_text(json.dumps(content, indent=2) + "\n")


_commands: list[object] = []


def register() -> None:
    """Register `blender -c skinwright`."""
    _commands.append(bpy.utils.register_cli_command("skinwright", main))


def unregister() -> None:
    """Unregister it."""
    bpy.utils.unregister_cli_command(_commands.pop())
