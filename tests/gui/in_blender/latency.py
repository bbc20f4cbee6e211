"""How long after the brush is released the weights are written, the view has drawn them, and the whole is solved."""

import sys
import time
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import dress
from driver import EXTENSION, Steps, Window, enable, record, start, until
from painting import begin_painting, look, painting

STROKES = 7
BONES = 60
drawn: list[float] = []


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    bpy.types.SpaceView3D.draw_handler_add(lambda: drawn.append(time.perf_counter()), (), "WINDOW", "POST_PIXEL")
    methods, *sizes = sys.argv[sys.argv.index("--") + 1 :]
    for vertices, method in [(int(size), method) for size in sizes for method in methods.split(",")]:
        _, figure, garment = dress.build(vertices, BONES)
        bpy.context.scene.skinwright.transfer.source = figure
        bpy.context.scene.skinwright.transfer.method = method
        look(window)
        yield 0.5
        yield from begin_painting(window)
        names = ("solve and write", "written", "drawn", "whole")
        figures = {"first solve": painting().seconds[0]} | {name: [] for name in names}
        for stroke in range(STROKES):
            solved = len(painting().seconds)
            y = 130 - 18 * stroke
            yield from measured_stroke(window, [(-50 + 12 * i, y) for i in range(9)])
            yield from until(lambda solved=solved: len(painting().seconds) > solved, 20)
            written = painting().written_at[-1]
            yield from until(lambda written=written: drawn[-1] > written, 20)
            figures["solve and write"].append(painting().seconds[-1])
            figures["written"].append(written - released[0])
            figures["drawn"].append(next(at for at in drawn if at > written) - released[0])
            yield from until(lambda: not painting().unsettled, 20)
            figures["whole"].append(max(painting().settled_at, written) - released[0])
        figures["overlay"] = overlay_seconds(window)
        record[f"{len(garment.data.vertices)} {method.lower()}"] = figures
        window.key("ESC")
        yield from until(lambda: painting() is None)


def overlay_seconds(window: Window) -> list[float]:
    """What the overlay adds to a drawing when something has changed: values, shape, upload."""
    overlay, preview = (import_module(f"{EXTENSION}.{name}") for name in ("overlay.draw", "overlay.picture"))
    seconds = []
    for _ in range(STROKES):
        preview._kept = None
        begin = time.perf_counter()
        with window.context():
            overlay._batch(overlay._picture(), 1.0)
        seconds.append(time.perf_counter() - begin)
    return seconds


released = [0.0]


def measured_stroke(window: Window, points: list[tuple[float, float]]) -> Steps:
    x, y = window.centre()
    path = [(int(x + dx), int(y + dy)) for dx, dy in points]
    window.event("MOUSEMOVE", at=path[0])
    yield 0.3
    window.event("LEFTMOUSE", "PRESS", at=path[0])
    yield 0.1
    for point in path[1:]:
        window.event("MOUSEMOVE", at=point)
        yield 0.05
    # What the brush still has to draw is not counted: the artist holds still before letting go.
    yield 0.4
    released[0] = time.perf_counter()
    window.event("LEFTMOUSE", "RELEASE", at=path[-1])
    yield 0.01


start(steps)
