"""A real mouse lets go of the brush: the view goes from the sculpt to the new weights, with nothing between.

In a small window: while a brush is down Blender puts the window together anew for each event of a timer, which without
a graphics card takes so long in a large one that any timer is due after it.

While the brush is down the shape at rest is moved, and the view shows that. Once it is up, no evaluation and no drawing
may see it moved: weights come first.
"""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import dress
import numpy as np
from driver import Steps, Window, enable, record, start, until
from mouse import Mouse
from sculpting import begin, character, positions, session

# Along the limb at the outer side of the bend, where weights reach much of it.
STROKES = [[(30 - i - 4 * number, 5 + 10 * number + 2 * i) for i in range(6)] for number in range(5)]
# The release comes while Blender is busy for a moment, a little longer than the operator's timer: as under an artist,
# whose release is found when the timer next wakes Blender's loop. These steps are run just after it has.
MOMENT = 0.006


def watch(rest: np.ndarray) -> None:
    """Note each evaluation and drawing with the shape at rest moved, by whether the brush was down then."""
    record["brush down"], record["brush up"] = 0, []

    def note(kind: str) -> None:
        if np.array_equal(positions(), rest):
            return
        names = [operator.bl_idname for operator in bpy.context.window_manager.windows[0].modal_operators]
        if "SCULPT_OT_brush_stroke" in names:
            record["brush down"] += 1
        elif session():
            record["brush up"].append(f"{kind} after {session().stroke_count} strokes")

    bpy.app.handlers.depsgraph_update_post.append(lambda *_: note("evaluated"))
    bpy.types.SpaceView3D.draw_handler_add(note, ("drawn",), "WINDOW", "PRE_VIEW")


def release(mouse: Mouse, strokes: int) -> Steps:
    mouse.release()
    time.sleep(MOMENT)
    yield 0.01
    yield from until(lambda: session().stroke_count == strokes)
    yield 0.3


def dabs() -> None:
    """Makes the brush one that acts where it is put down, without being moved."""
    setattr(
        bpy.data.brushes["Test Grab"], "sculpt_brush_type" if bpy.app.version >= (5, 0, 0) else "sculpt_tool", "DRAW"
    )


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    character(window, 3600)
    yield 0.5
    yield from begin(window, size=30)
    watch(positions())
    mouse = Mouse()
    x, y = window.centre()
    for number, stroke in enumerate(STROKES, 1):
        yield from mouse.drag([(x + dx, y + dy) for dx, dy in stroke])
        yield from window.at_rest()
        if number == 1:
            window.shoot("before_release")
        yield from release(mouse, number)
        record.setdefault("reached", []).append(session().reachability)
        if number == 1:
            window.shoot("after_release")

    before = positive()
    # One dab, pressed and released before Blender looks once.
    dabs()
    mouse.move((x + 20, y - 30))
    yield 0.3
    mouse.press()
    yield from release(mouse, 6)

    # Blender's own undo and redo take the last stroke back and do it again.
    weights = positive()
    with window.context():
        bpy.ops.ed.undo()
    mouse.move((x + 1, y))
    yield from until(lambda: session().stroke_count == 5)
    assert positive() == before
    with window.context():
        bpy.ops.ed.redo()
    mouse.move((x, y))
    yield from until(lambda: session().stroke_count == 6)
    assert positive() == weights

    with window.context():
        bpy.ops.skinwright.end_sculpt_weights(keep=True)
    mouse.move((x, y))
    yield from until(lambda: session() is None)
    assert positive() == weights


def positive() -> list[dict[str, float]]:
    """What the vertices follow, without members of weight 0."""
    return [{name: value for name, value in row.items() if value > 0} for row in dress.weights("Body")]


start(steps)
