"""An exception at any line of ours while an operation runs: all of it is written or nothing, on every garment.

    python tests/fuzz/injected.py [--seconds 120] [--cases N] [--first SEED]

The line is chosen by counting: the n-th line of the add-on that runs raises. Where the operation swallows it (a net
that reports), the weights count all the same.
"""

import contextlib
import io
import os
import sys

import scenes
from findings import Run
from scenes import bpy, builders

FOLDER = os.path.realpath(scenes.addon.__path__[0])
ERRORS = [ValueError, TypeError, KeyError, MemoryError, RuntimeError, OSError, ZeroDivisionError]
# Once one of these has begun to bring the old weights back, a second blow may land on it too: that is not asked for.
RESTORING = {"_bring_back", "apply", "_apply_members", "_add_in_order", "_set_all", "activate"}


class Injected(Exception):
    """Raised where nobody expects it."""


class Injector:
    """Raises at the n-th line of the add-on; n = 0 only counts."""

    def __init__(self, n, error):
        self.n, self.error, self.count, self.fired = n, error, 0, ""

    def __call__(self, frame, event, _argument):
        name = frame.f_code.co_filename
        if not os.path.realpath(name).startswith(FOLDER) or frame.f_code.co_name in RESTORING:
            return None
        if event == "line" and not self.fired:
            self.count += 1
            if self.count == self.n:
                self.fired = f"{os.path.basename(name)}:{frame.f_lineno} ({frame.f_code.co_name})"
                raise self.error("injected")
        return self


def build():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = builders.rig()
    body = builders.body(6, rig)
    coats = [builders.grid(f"Coat {n}", 5, size=1.5, z=0.02 + 0.01 * n) for n in range(2)]
    for coat in coats:
        builders.paint(coat, Arm__L=0.3, Arm__R=0.6, pin=0.5)
    coats[1].modifiers.new("Armature", "ARMATURE").object = rig
    bpy.context.scene.skinwright.transfer.source = body
    for coat in coats:
        builders.select(coat)
        bpy.ops.skinwright.store_weights()
        coat.vertex_groups["Arm.L"].add(range(25), 0.9, "REPLACE")
    builders.select(*coats)
    return coats


OPERATIONS = {
    "transfer": lambda: bpy.ops.skinwright.transfer_weights(groups="ALL", mix_factor=0.7),
    "transfer one": lambda: bpy.ops.skinwright.transfer_weights(),
    "desparsify": lambda: bpy.ops.skinwright.desparsify(n=3),
    "restore": lambda: bpy.ops.skinwright.restore_weights(),
    "edit mask": lambda: bpy.ops.skinwright.edit_match_mask(action="GROW"),
    "edit mask from match": lambda: bpy.ops.skinwright.edit_match_mask(action="FROM_MATCH"),
    "store": lambda: bpy.ops.skinwright.store_weights(),
}


def state(coats):
    rows = scenes.digests(coats)
    modifiers = {coat.name: [m.name for m in coat.modifiers] for coat in coats}
    return rows, modifiers, [coat.data.name for coat in coats]


def run_once(name, injector):
    with contextlib.redirect_stdout(io.StringIO()):
        coats = build()
    before = state(coats)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        sys.settrace(injector)
        try:
            OPERATIONS[name]()
        except RuntimeError:
            pass
        finally:
            sys.settrace(None)
    return before, state(coats)


def case(name, rng, whole):
    count, done = whole[name]
    injector = Injector(int(rng.integers(1, count + 1)), ERRORS[int(rng.integers(len(ERRORS)))])
    before, after = run_once(name, injector)
    assert after in (before, done), f"half written after {injector.error.__name__} at {injector.fired}"
    return "nothing written" if after == before else "all written"


if __name__ == "__main__":
    run = Run("injected exceptions", cases=1_000_000)
    whole = {}
    for operation in OPERATIONS:
        counter = Injector(0, Injected)
        whole[operation] = (0, run_once(operation, counter)[1])
        whole[operation] = (counter.count, whole[operation][1])
        print(f"  {operation}: {counter.count} lines", flush=True)
    for seed, generator in run.cases():
        chosen = list(OPERATIONS)[int(generator.integers(len(OPERATIONS)))]
        run.attempt(seed, chosen, case, chosen, generator, whole)
    run.end()
