"""Sessions that end sideways: exceptions, undo, Esc, renaming, other objects, windows, files."""

import os
import sys
import tempfile
import traceback
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import dress
from driver import EXTENSION, Steps, Window, disable, enable, record, start, until
from painting import begin_painting, painting
from sculpting import begin, character, positions, session

STROKE = [(30 + 3 * i, 8 + 2 * i) for i in range(7)]
LATER = [(10 - 3 * i, -5 - 3 * i) for i in range(7)]


def brushes():
    """The session that runs, whatever its kind."""
    return import_module(f"{EXTENSION}.operators.modal.brush_session").current


def state(name: str = "Body") -> tuple:
    obj = bpy.data.objects[name]
    groups = [(group.name, group.lock_weight) for group in obj.vertex_groups]
    return groups, dress.weights(name), positions(name).tobytes()


def modal() -> list[str]:
    windows = bpy.context.window_manager.windows
    return [operator.bl_idname for window in windows for operator in window.modal_operators if operator]


def nothing_is_left() -> bool:
    timers = import_module(f"{EXTENSION}.operators.modal.timers")._running
    flags = [obj.name for obj in bpy.data.objects if obj.skinwright.sculpting or obj.skinwright.painting]
    return not (brushes() or session() or timers or flags or modal())


def left_nothing(window: Window, mode: str = "OBJECT") -> Steps:
    yield from until(nothing_is_left)
    yield 0.3
    assert nothing_is_left()
    assert bpy.context.mode == mode, bpy.context.mode


def sculpted(window: Window, strokes: int = 1) -> Steps:
    """A session with strokes."""
    yield from begin(window, size=40)
    for number in range(strokes):
        yield from window.stroke(STROKE if number % 2 == 0 else LATER, settle=0.05)
        yield from until(lambda number=number: session().stroke_count == number + 1)
    yield 0.2


def click(window: Window, **keep: bool) -> None:
    with window.context():
        bpy.ops.skinwright.end_sculpt_weights("INVOKE_DEFAULT", **keep)
    window.event("MOUSEMOVE")


def dismiss_popup(window: Window) -> Steps:
    """An error is shown under the mouse."""
    yield from window.screenshot("error")
    window.key("ESC")
    yield 0.4


def undo(window: Window, operator: str = "undo") -> Steps:
    """As Blender's Edit menu does it."""
    with window.context():
        getattr(bpy.ops.ed, operator)()
    window.event("MOUSEMOVE")
    yield 0.8


def kept_is_one_step(window: Window) -> Steps:
    bare = state()
    yield from sculpted(window, 2)
    window.key("RET")
    yield from left_nothing(window)
    kept = state()
    assert kept[1] != bare[1] and kept[2] == bare[2] and kept[0] == bare[0]
    for _ in range(2):
        window.key("Z", ctrl=True)
        yield from until(lambda: state() == bare and nothing_is_left())
        assert bpy.context.mode == "OBJECT"
        window.key("Z", ctrl=True, shift=True)
        yield from until(lambda: state() == kept and nothing_is_left())
        assert bpy.context.mode == "OBJECT"
    window.key("Z", ctrl=True)
    yield from until(lambda: state() == bare and nothing_is_left())


def posing_within_is_the_same_step(window: Window) -> Steps:
    bare, rig = state(), bpy.data.objects["Rig"]
    pose = rig.pose.bones["Spine.2"].matrix_basis.copy()
    yield from sculpted(window)
    with window.context():
        bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode="OBJECT")
    yield 0.3
    assert session(), "Object mode belongs to the session"
    rig.pose.bones["Spine.2"].rotation_mode = "XYZ"
    rig.pose.bones["Spine.2"].rotation_euler[0] = 0.6
    with window.context():
        bpy.ops.ed.undo_push(message="Pose")
        bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode="SCULPT")
    yield 0.3
    yield from window.stroke(LATER, settle=0.05)
    yield from until(lambda: session().stroke_count == 2)
    assert session().pose_count == 2
    click(window, keep=True)
    yield from left_nothing(window)
    kept = state()
    assert abs(bpy.data.objects["Rig"].pose.bones["Spine.2"].rotation_euler[0] - 0.6) < 1e-6, (
        "keeping took the pose back"
    )
    window.key("Z", ctrl=True)
    yield from until(lambda: state() == bare and nothing_is_left())
    assert bpy.data.objects["Rig"].pose.bones["Spine.2"].matrix_basis == pose
    window.key("Z", ctrl=True, shift=True)
    yield from until(lambda: state() == kept and nothing_is_left())
    window.key("Z", ctrl=True)
    yield from until(lambda: state() == bare and nothing_is_left())


def escape_is_undoable(window: Window) -> Steps:
    bare = state()
    yield from sculpted(window, 2)
    window.key("ESC")
    yield from left_nothing(window)
    assert state() == bare
    window.key("Z", ctrl=True)
    yield from until(lambda: state()[1] != bare[1])
    assert state()[2] == bare[2] and nothing_is_left() and bpy.context.mode == "OBJECT"
    window.key("Z", ctrl=True)
    yield from until(lambda: state() == bare and nothing_is_left())


def escape_may_mean_something_else(window: Window) -> Steps:
    yield from sculpted(window)
    window.key("SPACE")
    yield 0.5
    playing = any(w.screen.is_animation_playing for w in bpy.context.window_manager.windows)
    if not playing:
        with window.context():
            bpy.ops.screen.animation_play()
        yield 0.3
    window.key("ESC")
    yield 0.5
    assert session() and session().stroke_count == 1, "Esc that stops playback ended the session"
    if any(w.screen.is_animation_playing for w in bpy.context.window_manager.windows):
        with window.context():
            bpy.ops.screen.animation_cancel(restore_frame=False)
    yield 0.3
    window.key("F")  # the brush's size, which Esc cancels
    yield 0.3
    window.key("ESC")
    yield 0.3
    assert session(), "Esc that ends another operator ended the session"
    other = next(area for area in window.window.screen.areas if area.type != "VIEW_3D")
    at = (other.x + other.width // 2, other.y + other.height // 2)
    window.event("MOUSEMOVE", at=at)
    yield 0.2
    window.event("ESC", "PRESS", at=at)
    window.event("ESC", "RELEASE", at=at)
    yield 0.3
    assert session(), "Esc over another editor ended the session"
    window.event("MOUSEMOVE")
    yield 0.2
    window.key("ESC")
    yield from left_nothing(window)


def remeshing_is_undone_or_told(window: Window) -> Steps:
    bare = state()
    yield from sculpted(window)
    once = state()
    with window.context():
        bpy.data.objects["Body"].data.remesh_voxel_size = 0.1
        bpy.ops.object.voxel_remesh("EXEC_DEFAULT", True)
    window.event("MOUSEMOVE")
    yield 0.5
    assert len(bpy.data.objects["Body"].data.vertices) * 3 * 4 != len(bare[2])
    window.key("Z", ctrl=True)
    yield from until(lambda: len(positions().tobytes()) == len(bare[2]))
    yield 0.5
    assert session() and session().stroke_count == 1 and state() == once, (
        "undoing the remesh is not all that was undone"
    )
    with window.context():
        bpy.ops.object.voxel_remesh("EXEC_DEFAULT", True)
        bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode="OBJECT")
    window.event("MOUSEMOVE")
    yield 0.4
    click(window, keep=False)
    yield from left_nothing(window)
    record["after remesh"] = len(bpy.data.objects["Body"].data.vertices)
    yield from begin_again_after_remesh(window)


def begin_again_after_remesh(window: Window) -> Steps:
    character(window, 900)
    yield 0.3
    yield from sculpted(window)
    click(window, keep=False)
    yield from left_nothing(window)


def an_exception_ends_the_session_in_order(window: Window) -> Steps:
    bare = state()
    for kind in (ValueError, IndexError, BaseException):
        yield from sculpted(window)
        once = state()

        def fail(*_arguments, kind=kind):
            raise kind("injected")

        session()._solver.stroke = fail
        yield from window.stroke(LATER, settle=0.1)
        yield from left_nothing(window)
        yield from dismiss_popup(window)
        assert state()[2] == bare[2], "the rest shape is not restored"
        positive = [{n: v for n, v in row.items() if v > 0} for row in once[1]]
        assert [{n: v for n, v in row.items() if v > 0} for row in state()[1]] == positive, "good strokes are lost"
        window.key("Z", ctrl=True)
        yield from until(lambda: state() == bare and nothing_is_left())


def edit_undo_goes_stroke_by_stroke(window: Window) -> Steps:
    bare = state()
    yield from sculpted(window, 2)
    yield from undo(window)
    assert session().stroke_count == 1 and bpy.context.mode == "SCULPT"
    yield from undo(window, "redo")
    assert session().stroke_count == 2
    yield from undo(window)
    yield from undo(window)
    assert session().stroke_count == 0 and bpy.context.mode == "SCULPT" and state()[2] == bare[2]
    yield from undo(window)
    yield from left_nothing(window)
    assert state() == bare, "undo to before the session"
    with window.context():
        assert not bpy.ops.ed.redo.poll(), "redo would lead into a session that has ended"


def names_and_other_objects(window: Window) -> Steps:
    bare = state()
    yield from sculpted(window)
    bpy.data.objects["Body"].name = "Figure"
    yield 0.3
    yield from window.stroke(LATER, settle=0.1)
    yield from until(lambda: session().stroke_count == 2)
    bpy.data.objects["Figure"].name = "Body"
    other = dress.tube("Other", dress.np.full(10, 0.2), 0.0, 1.0, 10)
    before = state("Other")
    with window.context():
        view_layer = bpy.context.view_layer
        bpy.ops.object.mode_set(mode="OBJECT")
        view_layer.objects.active = other
        bpy.ops.object.mode_set(mode="SCULPT")
    window.event("MOUSEMOVE")
    yield from until(nothing_is_left)
    assert bpy.data.objects["Body"].mode == "OBJECT"
    assert state()[2] == bare[2] and state()[1] != bare[1], "the work is not kept"
    assert state("Other") == before
    with window.context():
        bpy.ops.object.mode_set(mode="OBJECT")
    bpy.data.objects.remove(bpy.data.objects["Other"])
    bpy.context.view_layer.objects.active = bpy.data.objects["Body"]


def the_body_is_deleted(window: Window) -> Steps:
    yield from sculpted(window)
    bpy.data.objects.remove(bpy.data.objects["Body"])
    window.event("MOUSEMOVE")
    yield from left_nothing(window)
    character(window, 900)
    yield 0.3


def its_window_is_closed(window: Window) -> Steps:
    bare = state()
    with window.context():
        bpy.ops.wm.window_new()
    yield 0.8
    windows = bpy.context.window_manager.windows
    second = windows[1]
    area = max(second.screen.areas, key=lambda area: area.width * area.height)
    area.type = "VIEW_3D"
    yield 0.5
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=second, screen=second.screen, area=area, region=region):
        bpy.ops.skinwright.sculpt_weights("INVOKE_DEFAULT")
    yield from until(lambda: session() is not None)
    with bpy.context.temp_override(window=second, screen=second.screen, area=area, region=region):
        bpy.ops.wm.window_close()
    yield from until(lambda: len(bpy.context.window_manager.windows) == 1)
    yield from until(lambda: session() and modal() == ["SKINWRIGHT_OT_sculpt_weights"])
    yield from window.stroke(STROKE, settle=0.1)
    yield from until(lambda: session().stroke_count == 1)
    window.key("ESC")
    yield from left_nothing(window)
    assert state() == bare


def saved_and_reopened(window: Window) -> Steps:
    bare = state()
    path = os.path.join(tempfile.mkdtemp(), "session.blend")
    yield from sculpted(window)
    mid = state()
    with window.context():
        bpy.ops.wm.save_as_mainfile(filepath=path)
    yield 0.5
    assert session() and bpy.context.mode == "SCULPT" and state() == mid, "saving has changed the session"
    yield from window.stroke(LATER, settle=0.1)
    yield from until(lambda: session().stroke_count == 2)
    with window.context():
        bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)
    yield 1.0
    yield from left_nothing(window)
    assert state()[2] == bare[2] and state()[0] == bare[0], "the file holds the session's groups or shape"
    positive = [{n: v for n, v in row.items() if v > 0} for row in mid[1]]
    assert state()[1] == positive, "the file does not hold the weights so far"
    assert bpy.context.scene.skinwright.overlay.kind == "NONE"


def painting_ends_in_order(window: Window) -> Steps:
    _, figure, _ = dress.build(900)
    bpy.context.scene.skinwright.transfer.source = figure
    from painting import look

    look(window)
    with window.context():
        bpy.ops.ed.undo_push(message="Scene")
    yield 0.5
    bare = state("Dress")
    yield from begin_painting(window)
    solved = len(painting().seconds)
    yield from window.stroke([(-40 + 8 * i, 40) for i in range(9)], settle=0.1)
    yield from until(lambda: len(painting().seconds) > solved)
    yield from window.stroke([(-40 + 8 * i, 10) for i in range(9)], settle=0.1)
    yield from until(lambda: len(painting().seconds) > solved + 1)
    window.key("RET")
    yield from left_nothing(window)
    kept = state("Dress")
    assert kept != bare
    window.key("Z", ctrl=True)
    yield from until(lambda: state("Dress") == bare and nothing_is_left())
    window.key("Z", ctrl=True, shift=True)
    yield from until(lambda: state("Dress") == kept and nothing_is_left())
    window.key("Z", ctrl=True)
    yield from until(lambda: state("Dress") == bare and nothing_is_left())
    yield from begin_painting(window)
    painting().tick = None  # what follows a stroke fails
    window.event("MOUSEMOVE")
    yield from left_nothing(window)
    yield from dismiss_popup(window)
    bare = state("Dress")  # what was painted before the error is kept
    yield from begin_painting(window)
    solved = len(painting().seconds)
    yield from window.stroke([(-40 + 8 * i, -20) for i in range(9)], settle=0.1)
    yield from until(lambda: len(painting().seconds) > solved)
    window.key("ESC")
    yield from left_nothing(window)
    assert state("Dress") == bare
    window.key("Z", ctrl=True)
    yield from until(lambda: state("Dress") != bare)
    window.key("Z", ctrl=True)
    yield from until(lambda: state("Dress") == bare and nothing_is_left())


def disabled_in_a_session(window: Window) -> Steps:
    character(window, 900)
    yield 0.3
    bare = state()
    yield from sculpted(window)
    disable()
    yield 0.5
    assert bpy.context.mode == "OBJECT", "the artist is left in Sculpt mode"
    assert state()[2] == bare[2] and state()[1] != bare[1]
    enable()
    yield 0.3
    yield from left_nothing(window)


SCENARIOS = (
    kept_is_one_step,
    escape_is_undoable,
    posing_within_is_the_same_step,
    edit_undo_goes_stroke_by_stroke,
    an_exception_ends_the_session_in_order,
    escape_may_mean_something_else,
    names_and_other_objects,
    its_window_is_closed,
    remeshing_is_undone_or_told,
    the_body_is_deleted,
    saved_and_reopened,
    painting_ends_in_order,
    disabled_in_a_session,
)


def attempt(window: Window, scenario) -> Steps:
    """All of them are tried, so that one run tells of every failure."""
    print("SCENARIO", scenario.__name__, flush=True)
    try:
        yield from scenario(window)
        record["passed"].append(scenario.__name__)
    except Exception:
        traceback.print_exc()
        yield from clean_up(window)


def clean_up(window: Window) -> Steps:
    if brushes():
        brushes().asked = "CANCEL"
        window.event("MOUSEMOVE")
        yield 1.0
    with window.context():
        if bpy.context.mode != "OBJECT" and bpy.context.object:
            bpy.ops.object.mode_set(mode="OBJECT")
    character(window, 900)
    yield 0.3


def attempt_all(window: Window, scenarios) -> Steps:
    """Those named on the command line, or all; each begins with a fresh character."""
    chosen = sys.argv[sys.argv.index("--") + 1 :]
    record["passed"] = []
    for scenario in scenarios:
        if not chosen or scenario.__name__ in chosen:
            character(window, 900)
            yield 0.5
            yield from attempt(window, scenario)
    assert not chosen or record["passed"] == chosen, record["passed"]


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    yield from attempt_all(window, SCENARIOS)


if __name__ == "__main__":
    start(steps)
