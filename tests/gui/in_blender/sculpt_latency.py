"""How long after the brush is released the weights are written, and the view has drawn them; part by part."""

import sys
import time
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
from driver import EXTENSION, Steps, Window, enable, record, start, until
from sculpting import begin, character, session

STROKES = 9
BONES = 60
drawn: list[float] = []
evaluated: list[tuple[float, float]] = []
outcomes: list[tuple[float, float, object]] = []


def watch() -> None:
    """Note when strokes are taken, the scene is evaluated and the view is drawn."""
    began = [0.0]
    sessions = import_module(f"{EXTENSION}.sculpt_session").SculptSession
    take = sessions.stroke

    def stroke(self):
        begin = time.perf_counter()
        outcome = take(self)
        if outcome:
            outcomes.append((begin, time.perf_counter(), outcome))
        return outcome

    sessions.stroke = stroke
    bpy.app.handlers.depsgraph_update_pre.append(lambda *_: began.__setitem__(0, time.perf_counter()))
    bpy.app.handlers.depsgraph_update_post.append(lambda *_: evaluated.append((began[0], time.perf_counter())))
    bpy.types.SpaceView3D.draw_handler_add(lambda: drawn.append(time.perf_counter()), (), "WINDOW", "POST_PIXEL")


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    watch()
    for vertices, size in ((int(argument), 52) for argument in sys.argv[sys.argv.index("--") + 1 :]):
        obj = character(window, vertices, BONES)
        window.area.spaces.active.overlay.show_overlays = False
        yield 0.5
        started = time.perf_counter()
        yield from begin(window, size=size)
        figures = {"begin": [time.perf_counter() - started - 0.8]}
        for number in range(STROKES):
            seen = len(outcomes)
            released = yield from stroke(window, number)
            yield from until(lambda seen=seen: len(outcomes) > seen, 20)
            began, ended, outcome = outcomes[-1]
            yield from until(lambda ended=ended: drawn[-1] > ended, 20)
            parts = {"noticed": began - released, **outcome.seconds, "taken": ended - began}
            parts["evaluate"] = sum(stop - go for go, stop in evaluated if go > ended and stop < drawn[-1])
            parts["updated"] = next((stop for go, stop in evaluated if go > ended), ended) - released
            parts["drawn"] = next(at for at in drawn if at > ended) - released
            parts["vertices"] = outcome.vertices
            for name, value in parts.items():
                figures.setdefault(name, []).append(value)
        record[str(len(obj.data.vertices))] = figures
        window.key("ESC")
        yield from until(lambda: session() is None)
        yield 0.5


def stroke(window: Window, number: int):
    """A grab; what the brush still has to draw is not counted: the artist holds still before letting go."""
    x, y = window.centre()
    path = [(x + 10 + 3 * i, y + 60 - 14 * number) for i in range(7)]
    window.event("MOUSEMOVE", at=path[0])
    yield 0.3
    window.event("LEFTMOUSE", "PRESS", at=path[0])
    for point in path:
        yield 0.06
        window.event("MOUSEMOVE", at=point)
    yield 1.0
    released = time.perf_counter()
    window.event("LEFTMOUSE", "RELEASE", at=path[-1])
    yield 0.01
    return released


start(steps)
