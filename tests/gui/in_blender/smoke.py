"""Opens the add-on's tab, takes a picture, and looks for anything left behind after disabling."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import dress
from driver import EXTENSION, Steps, Window, disable, enable, record, start
from sculpting import begin, character, session


def left_behind() -> dict[str, list[str]]:
    handlers = bpy.app.handlers
    kinds = [name for name in dir(handlers) if isinstance(getattr(handlers, name), list)]
    return {
        "handlers": [f"{kind}: {h.__module__}" for kind in kinds for h in getattr(handlers, kind)],
        "types": [name for name in dir(bpy.types) if "skinwright" in name.lower()],
        "timers and drawings": [
            module
            for module, running in (
                (f"{EXTENSION}.operators.modal.timers", "_running"),
                (f"{EXTENSION}.overlay.draw", "_handles"),
            )
            if getattr(sys.modules.get(module), running, None)
        ],
        "properties": [name for name in dir(bpy.types.Scene) if "skinwright" in name.lower()],
    }


def steps(window: Window) -> Steps:
    yield 1.0
    before = left_behind()
    for _ in range(2):
        enable()
        yield 0.3
        disable()
        assert left_behind() == before, (left_behind(), before)
    enable()
    yield from window.show_tab("Weights")
    _, figure, _ = dress.build()
    bpy.context.scene.skinwright.transfer.source = figure
    with window.context():
        bpy.ops.skinwright.paint_match_mask("INVOKE_DEFAULT")
    yield 0.3
    disable()
    yield 0.3
    assert left_behind() == before, "disabling while the mask is painted leaves something behind"
    enable()
    bpy.ops.object.mode_set(mode="OBJECT")
    character(window, 400)
    yield from begin(window)
    disable()
    yield 0.3
    assert left_behind() == before, "disabling while weights are sculpted leaves something behind"
    enable()
    assert session() is None, "weights are still being sculpted"
    bpy.ops.object.mode_set(mode="OBJECT")
    yield from window.show_tab("Weights")
    yield from window.screenshot("panel")
    record["tab"] = window.region("UI").active_panel_category


start(steps)
