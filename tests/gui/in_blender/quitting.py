"""Blender is quit in the middle: `quitting -- work`, `session` or `preview`. The exit code must be that of an orderly end."""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
from driver import SHARE, Steps, Window, enable, record, start
from sculpting import character
from sessions import sculpted
from sideways import heavy, limb, operator


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    what = sys.argv[sys.argv.index("--") + 1]
    if what == "work":
        yield from heavy(window)
    elif what == "session":
        character(window, 900)
        yield 0.3
        yield from sculpted(window)
    else:
        yield from limb(window)
        operator(window, "skinwright.live_refine")
    record["quit"] = what
    (SHARE / "out" / "record.json").write_text(json.dumps(record))
    with window.context():
        bpy.ops.wm.quit_blender()
    while True:
        yield 1.0


if __name__ == "__main__":
    start(steps)
