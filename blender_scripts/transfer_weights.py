"""Transfer weights without a window, in Blender or in Python with the bpy wheel.

    blender -b file.blend -P blender_scripts/transfer_weights.py -- --source Body --target Coat --target Belt \
        [--settings settings.json] [--report report.json] [--save out.blend]
    python blender_scripts/transfer_weights.py file.blend --source Body --target Coat --save out.blend

The add-on is taken from Blender where it is enabled, else from this checkout. Exit codes: 0 done, 1 failed, 2 usage.
"""

import importlib
import os
import sys
import traceback
from pathlib import Path

import bpy

IN_BLENDER = bool(bpy.app.binary_path)


def main() -> int:
    """Run the add-on's own command; leave no trace of it afterwards."""
    enabled = next((name for name in bpy.context.preferences.addons.keys() if name.endswith(".skinwright")), None)
    if enabled:
        return importlib.import_module(f"{enabled}.command_line").transfer(arguments())
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "addon"))
    addon = importlib.import_module("skinwright")
    addon.register()
    try:
        return addon.command_line.transfer(arguments())
    finally:
        addon.unregister()


def arguments() -> list[str]:
    """What follows `--`; everything where Python runs the script itself."""
    if "--" in sys.argv:
        return sys.argv[sys.argv.index("--") + 1 :]
    return [] if IN_BLENDER else sys.argv[1:]


def leave(code: int) -> None:
    """End with this code. Some bpy wheels hang or crash when Python ends in the ordinary way."""
    sys.stdout.flush()
    sys.stderr.flush()
    if IN_BLENDER:
        sys.exit(code)
    os._exit(code)


if __name__ == "__main__":
    try:
        exit_code = main()
    except Exception:  # neither host gives a failing exit code by itself
        traceback.print_exc()
        exit_code = 1
    leave(exit_code)
