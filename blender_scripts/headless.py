"""What the scripts without a window have in common: finding the add-on, arguments, leaving with an exit code."""

import importlib
import os
import sys
import traceback
from pathlib import Path

import bpy

IN_BLENDER = bool(bpy.app.binary_path)


def run(command: str) -> None:
    """Run a command of the add-on's `command_line` and end with its exit code."""
    try:
        exit_code = _run(command)
    except Exception:  # neither host gives a failing exit code by itself
        traceback.print_exc()
        exit_code = 1
    _leave(exit_code)


def _run(command: str) -> int:
    """Leaves no trace of the add-on where it was not enabled."""
    enabled = next((name for name in bpy.context.preferences.addons.keys() if name.endswith(".skinwright")), None)
    if enabled:
        return getattr(importlib.import_module(f"{enabled}.headless.command_line"), command)(_arguments())
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "addon"))
    addon = importlib.import_module("skinwright")
    addon.register()
    try:
        return getattr(addon.headless.command_line, command)(_arguments())
    finally:
        addon.unregister()


def _arguments() -> list[str]:
    """What follows `--`; everything where Python runs the script itself."""
    if "--" in sys.argv:
        return sys.argv[sys.argv.index("--") + 1 :]
    return [] if IN_BLENDER else sys.argv[1:]


def _leave(code: int) -> None:
    """End with this code. Some bpy wheels hang or crash when Python ends in the ordinary way."""
    sys.stdout.flush()
    sys.stderr.flush()
    if IN_BLENDER:
        sys.exit(code)
    os._exit(code)
