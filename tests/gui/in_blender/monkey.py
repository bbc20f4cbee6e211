"""Random actions of an artist in no hurry to be careful, from a seed: `monkey -- SEED ACTIONS`.

After each: no exception was printed, a session has its operator and an operator its session, and what ended by Esc is
as it was before. The last actions are in the record, so that a failure can be read and, with its seed, repeated.
"""

import io
import os
import random
import sys
import tempfile
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import dress
import numpy as np
from driver import EXTENSION, SHARE, Steps, Window, enable, record, start
from painting import brush as paint_brush
from painting import look
from sculpting import brush as sculpt_brush

RIG, BODY, DRESS = "Rig", "Body", "Dress"
SETTLE = 20.0


class Listener(io.TextIOBase):
    """Passes on what is printed, and remembers whether it was an exception."""

    def __init__(self, stream) -> None:
        self.stream, self.heard = stream, []

    def write(self, text: str) -> int:
        if "Traceback" in text or "Error:" in text:
            self.heard.append(text)
        return self.stream.write(text)

    def flush(self) -> None:
        self.stream.flush()


def brushes():
    return import_module(f"{EXTENSION}.operators.modal.brush_session").current


def modal() -> list[str]:
    windows = bpy.context.window_manager.windows
    return [o.bl_idname for w in windows for o in w.modal_operators if o.bl_idname.startswith("SKINWRIGHT")]


def in_order() -> bool:
    """No session without its operator, no operator without its session, no mark without a session."""
    session, running = brushes(), modal()
    if session is None:
        marked = [obj.name for obj in bpy.data.objects if obj.skinwright.sculpting or obj.skinwright.painting]
        timers = import_module(f"{EXTENSION}.operators.modal.timers")._running
        return not running and not marked and not timers
    return running == ["SKINWRIGHT_OT_" + session.operator.split(".")[1]]


def weights_and_rest(obj: bpy.types.Object) -> tuple:
    names = [group.name for group in obj.vertex_groups]
    rows = [tuple(sorted((names[m.group], m.weight) for m in v.groups)) for v in obj.data.vertices]
    return names, rows, np.array([v.co for v in obj.data.vertices], np.float32).tobytes()


def _difference(before: tuple, now: tuple) -> str:
    """What is not the same, in short."""
    if before[0] != now[0]:
        return f"groups {before[0]} are {now[0]}"
    if len(before[1]) != len(now[1]) or before[2] != now[2]:
        return f"{len(before[1])} vertices are {len(now[1])}, or lie elsewhere"
    wrong = [i for i, (old, new) in enumerate(zip(before[1], now[1], strict=True)) if old != new]
    return f"{len(wrong)} rows, first {wrong[0]}: {before[1][wrong[0]]} is {now[1][wrong[0]]}"


class Monkey:
    def __init__(self, window: Window, seed: int) -> None:
        self.window, self.random = window, random.Random(seed)
        self.folder = tempfile.mkdtemp()
        self.before = None  # name, weights and rest of the object of the session that runs
        self.checked = self.begun = 0

    def scene(self) -> Steps:
        armature, figure, garment = dress.build(300, 4)
        armature.name, figure.name, garment.name = RIG, BODY, DRESS
        bpy.context.scene.skinwright.transfer.source = figure
        bone = armature.pose.bones["Spine.2"]
        bone.rotation_mode, bone.rotation_euler = "XYZ", (0, 0, 0.7)
        look(self.window)
        self.window.area.spaces.active.overlay.show_overlays = self.random.random() < 0.3
        with self.window.context():
            bpy.ops.ed.undo_push(message="Scene")
        yield 0.1

    # Actions. Each may find that it cannot be done now, which is as good as done.

    def activate(self) -> Steps:
        obj = self.random.choice([o for o in bpy.context.view_layer.objects if o.visible_get()] or [None])
        if obj and bpy.context.mode == "OBJECT":
            for other in bpy.context.view_layer.objects:
                other.select_set(other == obj)
            bpy.context.view_layer.objects.active = obj
        yield 0

    def begin_sculpt(self) -> Steps:
        yield from self.begin("sculpt_weights", sculpt_brush, 40)

    def begin_paint(self) -> Steps:
        yield from self.begin("paint_match_mask", paint_brush)

    def begin(self, name: str, brush, *arguments) -> Steps:
        figure = bpy.data.objects.get(DRESS if name == "paint_match_mask" else BODY)
        if brushes() is None and bpy.context.mode != "OBJECT" and bpy.context.object:
            with self.window.context():
                bpy.ops.object.mode_set(mode="OBJECT")
        if bpy.context.mode == "OBJECT" and figure and self.random.random() < 0.9:
            for other in bpy.context.view_layer.objects:
                other.select_set(other == figure)
            bpy.context.view_layer.objects.active = figure
            yield 0.02
        obj = bpy.context.object
        before = weights_and_rest(obj) if obj and obj.type == "MESH" and obj.mode != "EDIT" else None
        fresh = brushes() is None
        yield from self.call(name)
        if fresh and brushes() and brushes().target() == obj:
            self.before, self.begun = (obj.session_uid, before), self.begun + 1
            brush(self.window, *arguments)

    def stroke(self) -> Steps:
        x, y = self.window.centre()
        at = [x + self.random.randint(-60, 60), y + self.random.randint(-90, 90)]
        self.window.event("MOUSEMOVE", at=tuple(at))
        yield 0.02
        self.window.event("LEFTMOUSE", "PRESS", at=tuple(at))
        for _ in range(self.random.randint(0, 4)):
            at = [at[0] + self.random.randint(-9, 9), at[1] + self.random.randint(-9, 9)]
            self.window.event("MOUSEMOVE", at=tuple(at))
            yield 0.01
        self.window.event("LEFTMOUSE", "RELEASE", at=tuple(at))
        yield 0.02
        self.window.event("MOUSEMOVE", at=(at[0] + 2, at[1] + 2))
        yield self.random.choice((0, 0.05))

    def key(self, kind: str, **modifiers: bool) -> Steps:
        self.window.event("MOUSEMOVE")
        yield 0.01
        self.window.key(kind, **modifiers)
        yield 0.03

    def undo(self) -> Steps:
        yield from self.key("Z", ctrl=True)

    def redo(self) -> Steps:
        yield from self.key("Z", ctrl=True, shift=True)

    def edit_undo(self) -> Steps:
        with self.window.context():
            if bpy.ops.ed.undo.poll():
                bpy.ops.ed.undo()
        yield 0.03

    def edit_redo(self) -> Steps:
        with self.window.context():
            if bpy.ops.ed.redo.poll():
                bpy.ops.ed.redo()
        yield 0.03

    def escape(self) -> Steps:
        yield from self.key("ESC")

    def enter(self) -> Steps:
        yield from self.key("RET")

    def button(self) -> Steps:
        if brushes():
            name = "end_sculpt_weights" if brushes().flag == "sculpting" else "end_match_mask"
            yield from self.call(name, keep=self.random.random() < 0.5)
            self.window.event("MOUSEMOVE")
        yield 0.03

    def mode(self) -> Steps:
        obj = bpy.context.object
        if obj:
            kinds = ["OBJECT", "SCULPT", "WEIGHT_PAINT", "EDIT"] if obj.type == "MESH" else ["OBJECT", "POSE"]
            with self.window.context():
                if bpy.ops.object.mode_set.poll():
                    bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode=self.random.choice(kinds))
        yield 0.02

    def pose(self) -> Steps:
        rig = bpy.data.objects.get(RIG)
        if rig:
            self.random.choice(rig.pose.bones).rotation_euler[self.random.randrange(3)] = self.random.uniform(-1, 1)
        yield 0.02

    def rename(self) -> Steps:
        obj = brushes().target() if brushes() else None
        if obj:
            self.call_it(obj, obj.name + "x" if len(obj.name) < 12 else BODY)
        yield 0.01

    def call_it(self, obj: bpy.types.Object, name: str) -> None:
        """As the outliner does it. Without the step Blender itself may crash when an older one looks for the name."""
        obj.name = name
        with self.window.context():
            bpy.ops.ed.undo_push(message="Rename")

    def rename_back(self) -> Steps:
        for obj in bpy.data.objects:
            stem = next((stem for stem in (BODY, DRESS, RIG) if obj.name.startswith(stem)), None)
            if stem and stem not in bpy.data.objects:
                self.call_it(obj, stem)
        yield 0

    def play(self) -> Steps:
        with self.window.context():
            bpy.ops.screen.animation_play()
        yield 0.05
        yield from self.key("ESC")

    def radial(self) -> Steps:
        yield from self.key("F")
        yield from self.key("ESC")

    def remesh(self) -> Steps:
        obj = bpy.context.object
        if obj and obj.type == "MESH" and obj.mode in ("OBJECT", "SCULPT"):
            obj.data.remesh_voxel_size = 0.25
            with self.window.context():
                if bpy.ops.object.voxel_remesh.poll():
                    bpy.ops.object.voxel_remesh("EXEC_DEFAULT", True)
        yield 0.03

    def delete(self) -> Steps:
        obj = brushes().target() if brushes() else bpy.context.object
        if obj:
            bpy.data.objects.remove(obj)
            with self.window.context():
                bpy.ops.ed.undo_push(message="Delete")
        yield 0.02

    def save(self) -> Steps:
        with self.window.context():
            bpy.ops.wm.save_as_mainfile(
                filepath=os.path.join(self.folder, "monkey.blend"), copy=self.random.random() < 0.5
            )
        yield 0.02

    def reopen(self) -> Steps:
        path = os.path.join(self.folder, "monkey.blend")
        if os.path.exists(path):
            with self.window.context():
                bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)
            self.before = None
            yield 0.2

    def other_window(self) -> Steps:
        windows = bpy.context.window_manager.windows
        if len(windows) == 1:
            with self.window.context():
                bpy.ops.wm.window_new()
            yield 0.2
        else:
            last = windows[-1]
            with bpy.context.temp_override(window=last, screen=last.screen, area=last.screen.areas[0]):
                bpy.ops.wm.window_close()
            yield 0.1

    def our_operator(self) -> Steps:
        name, options = self.random.choice(
            [
                ("preview_match", {}),
                ("select_match", {"what": "UNMATCHED"}),
                ("edit_match_mask", {"action": self.random.choice(["CLEAR", "GROW", "INVERT", "FROM_MATCH"])}),
                ("mask_brush", {"value": self.random.choice(["INPAINT", "AUTOMATIC", "MATCH"])}),
                ("transfer_weights", {}),
                ("desparsify", {}),
                ("store_match", {}),
            ]
        )
        yield from self.call(name, **options)

    def settings(self) -> Steps:
        settings = bpy.context.scene.skinwright
        settings.overlay.kind = self.random.choice(["NONE", "MATCH", "INFLUENCES", "STRETCH"])
        settings.sculpt.kappa = self.random.uniform(0.001, 0.05)
        settings.transfer.relative_max_distance = self.random.uniform(0.01, 0.2)
        yield 0.01

    def call(self, name: str, **options) -> Steps:
        with self.window.context():
            operator = getattr(bpy.ops.skinwright, name)
            if operator.poll():
                try:
                    operator("INVOKE_DEFAULT", **options)
                except RuntimeError as error:
                    print("refused:", str(error).strip().splitlines()[-1])
        yield 0.02

    WEIGHTS = {
        "stroke": 30, "undo": 8, "redo": 5, "edit_undo": 3, "edit_redo": 2, "begin_sculpt": 9, "begin_paint": 5,
        "escape": 6, "enter": 3, "button": 2, "mode": 6, "pose": 4, "rename": 2, "rename_back": 2, "play": 1,
        "radial": 1, "remesh": 1, "delete": 0.7, "save": 1, "reopen": 0.5, "other_window": 1, "our_operator": 6,
        "settings": 2, "activate": 3,
    }  # fmt: skip

    def choose(self) -> str:
        if len(bpy.context.window_manager.windows) > 1 and self.random.random() < 0.08:
            return "other_window"  # drawing two takes its time
        return self.random.choices(list(self.WEIGHTS), list(self.WEIGHTS.values()))[0]

    def settle(self) -> Steps:
        """Popups and half-done operators of Blender's own may be in the way; the rest must come to order by itself."""
        waited = 0.0
        while not in_order() and waited < SETTLE:
            self.window.event("MOUSEMOVE")
            yield 0.05
            waited += 0.05
        assert in_order(), f"session {brushes()}, operators {modal()}"

    def check_ended(self, by: str) -> None:
        """A session that Esc has ended has left nothing, if the artist did nothing to the mesh by other means."""
        if self.before is None or brushes():
            return
        (uid, before), self.before = self.before, None
        obj = next((o for o in bpy.data.objects if o.session_uid == uid), None)
        foreign = {"remesh", "delete", "our_operator"}
        if by == "escape" and obj and before and not foreign & set(self.since):
            now = weights_and_rest(obj)
            assert now == before, f"Esc has left something of {obj.name}, {self.since}: {_difference(before, now)}"
            self.checked += 1


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    seed, actions = map(int, sys.argv[sys.argv.index("--") + 1 :])
    monkey, listener = Monkey(window, seed), Listener(sys.stderr)
    sys.stderr = listener
    history: list[str] = []
    record["seed"], record["history"] = seed, history
    yield from monkey.scene()
    monkey.since = []
    for number in range(actions):
        if BODY not in bpy.data.objects and not brushes():
            if bpy.context.mode != "OBJECT":
                with window.context():
                    bpy.ops.object.mode_set(mode="OBJECT")
            yield from monkey.scene()
            history.append("scene")
        name = monkey.choose()
        history.append(name)
        (SHARE / "out" / "history.txt").write_text("\n".join(history))
        had = brushes()
        if had is None:
            monkey.since = []
        monkey.since.append(name)
        yield from getattr(monkey, name)()
        yield from monkey.settle()
        if had and brushes() is not had:
            monkey.check_ended(name)
        assert not listener.heard, (number, history[-12:], "".join(listener.heard)[-2000:])
    record["actions"], record["sessions"], record["Esc checked"] = actions, monkey.begun, monkey.checked


if __name__ == "__main__":
    start(steps)
