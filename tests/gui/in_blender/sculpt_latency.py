"""What follows the release of a real mouse's button after a sculpt stroke, part by part, in seconds."""

import random
import sys
import threading
import time
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
from driver import EXTENSION, Steps, Window, enable, record, start, until
from mouse import Mouse
from sculpting import begin, character, session

STROKES = 11
BONES = 60
# Pixels, such that about 2,000 of 100,000 vertices are touched, and as many of fewer or more.
RADIUS = 24
drawn: list[tuple[float, float]] = []
evaluated: list[tuple[float, float]] = []
taken: list[dict[str, float]] = []


def timed(owner: object, name: str, note) -> None:
    """In place of owner.name, which goes on doing what it did, `note` is told its result and its begin and end."""
    function = getattr(owner, name)

    def instead(*arguments):
        begin = time.perf_counter()
        result = function(*arguments)
        note(result, begin, time.perf_counter())
        return result

    setattr(owner, name, instead)


def watch() -> None:
    """Note when strokes are taken, the scene is evaluated and the view is drawn."""
    modules = {name: import_module(f"{EXTENSION}.{name}") for name in ("scene.rest_shape", "scene.vertex_groups")}
    parts: dict[str, float] = {}

    def part(name: str):
        return lambda _result, begin, end: parts.__setitem__(name, end - begin)

    def stroke(outcome, begin: float, end: float) -> None:
        if outcome:
            rest = end - begin - sum(parts.values())
            taken.append({"at": begin, "end": end, "touched": outcome.vertices, **parts, "solve": rest})
        parts.clear()

    timed(modules["scene.rest_shape"], "moved", part("look"))
    timed(modules["scene.vertex_groups"], "write", part("write"))
    timed(modules["scene.rest_shape"], "restore", part("put back"))
    timed(import_module(f"{EXTENSION}.sculpt.session").SculptSession, "stroke", stroke)
    pairs(bpy.app.handlers.depsgraph_update_pre.append, bpy.app.handlers.depsgraph_update_post.append, evaluated)
    view = bpy.types.SpaceView3D.draw_handler_add
    pairs(lambda f: view(f, (), "WINDOW", "PRE_VIEW"), lambda f: view(f, (), "WINDOW", "POST_PIXEL"), drawn)


def pairs(before, after, times: list[tuple[float, float]]) -> None:
    """Let Blender call back before and after something, and note both times."""
    began = [0.0]
    before(lambda *_: began.__setitem__(0, time.perf_counter()))
    after(lambda *_: times.append((began[0], time.perf_counter())))


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    watch()
    mouse = Mouse()
    obj = character(window, int(sys.argv[-1]), BONES)
    record["vertices"] = len(obj.data.vertices)
    window.area.spaces.active.overlay.show_overlays = False
    yield 0.5
    radius = RADIUS * (100_000 / len(obj.data.vertices)) ** 0.5
    yield from begin(window, size=round(2 * radius if bpy.app.version >= (5, 0, 0) else radius))
    record["strokes"] = []
    for number in range(STROKES):
        yield from stroke(window, mouse, number)
        record["strokes"].append((yield from parts(mouse, number + 1)))
    with window.context():
        bpy.ops.skinwright.end_sculpt_weights(keep=False)
    mouse.move(window.centre())
    yield from until(lambda: session() is None)


def stroke(window: Window, mouse: Mouse, number: int) -> Steps:
    """A grab; what the brush still has to draw is not counted: the artist holds still before letting go."""
    x, y = window.centre()
    path = [(x + 10 + 3 * i, y + 60 - 11 * number) for i in range(7)]
    yield from mouse.drag(path)
    yield from window.at_rest()


def let_go(mouse: Mouse, releases: list[float]) -> None:
    """At any time, as an artist does: these steps are run at always the same phase of Blender's loop."""
    time.sleep(random.uniform(0.05, 0.1))
    releases.append(time.perf_counter())
    mouse.release()


def parts(mouse: Mouse, strokes: int):
    """Let go, and wait until the new weights are drawn; what took how long."""
    releases: list[float] = []
    threading.Thread(target=let_go, args=(mouse, releases)).start()
    yield from until(lambda: len(taken) == strokes, 20)
    released = releases[0]
    ours = taken[-1]
    began, ended = ours.pop("at"), ours.pop("end")
    yield from until(lambda: drawn[-1][0] > ended, 20)
    evaluate = next(times for times in evaluated if times[0] > ended)
    draw = next(times for times in drawn if times[0] > ended)
    return ours | {
        "noticed": began - released,
        "ours": ended - began,
        "evaluate": evaluate[1] - evaluate[0],
        "updated": evaluate[1] - released,
        "made ready": draw[0] - evaluate[1],
        "drawn": draw[1] - released,
        "came before": sum(released < times[0] < began for times in drawn + evaluated),
    }


start(steps)
