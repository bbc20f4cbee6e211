"""An exception at any line of ours while an operation runs: all of it is written or nothing, on every garment.

    python tests/fuzz/injected.py [--seconds 120] [--cases N] [--first SEED]

The line is chosen by counting: the n-th line of the add-on that runs raises. Where the operation swallows it (a net
that reports), the weights count all the same.
"""

import contextlib
import io
import os
import sys
import tempfile

import scenes
from findings import Run
from scenes import bpy, builders

FOLDER = os.path.realpath(scenes.addon.__path__[0])
ERRORS = [ValueError, TypeError, KeyError, MemoryError, RuntimeError, OSError, ZeroDivisionError]
FILES = tempfile.mkdtemp(prefix="skinwright-injected-")


class Injected(Exception):
    """Raised where nobody expects it."""


class Injector:
    """Raises at the n-th line of the add-on; n = 0 only counts."""

    def __init__(self, n, error):
        self.n, self.error, self.count, self.fired = n, error, 0, ""

    def __call__(self, frame, event, _argument):
        name = frame.f_code.co_filename
        if not os.path.realpath(name).startswith(FOLDER):
            return None
        if event == "line" and not self.fired:
            self.count += 1
            if self.count == self.n:
                self.fired = f"{os.path.basename(name)}:{frame.f_lineno} ({frame.f_code.co_name})"
                raise self.error("injected")
        return self


def dressed():
    """Two garments on a body, the second with another armature, a parent and a constraint that transfers may end."""
    rig = builders.rig()
    body = builders.body(6, rig)
    coats = [builders.grid(f"Coat {n}", 5, size=1.5, z=0.02 + 0.01 * n) for n in range(2)]
    for coat in coats:
        builders.paint(coat, Arm__L=0.3, Arm__R=0.6, pin=0.5)
    coats[1].modifiers.new("Armature", "ARMATURE").object = rig
    coats[1].modifiers["Armature"].vertex_group = "pin"
    coats[0].parent, coats[0].parent_type, coats[0].parent_bone = rig, "BONE", "Arm.L"
    follow = coats[1].constraints.new("COPY_LOCATION")
    follow.target, follow.subtarget = rig, "Arm.R"
    bpy.context.scene.skinwright.transfer.source = body
    for coat in coats:
        builders.select(coat)
        bpy.ops.skinwright.store_weights()
        coat.vertex_groups["Arm.L"].add(range(25), 0.9, "REPLACE")
    builders.select(*coats)


def posed():
    """A garment modelled on the posed body, so that its rest shape is written too; and one that is not."""
    dressed()
    rig, first = bpy.data.objects["Rig"], bpy.data.objects["Coat 0"]
    rig.pose.bones["Arm.L"].rotation_mode = "XYZ"
    rig.pose.bones["Arm.L"].rotation_euler = (0.2, 0.1, 0)
    first.shape_key_add(name="Basis", from_mix=False)
    first.shape_key_add(name="Wide", from_mix=False)
    bpy.context.view_layer.update()


def characters():
    """A bound limb, the source of retargeting, and two limbs of another rig that are not bound yet."""
    _, rig = builders.limb("Donor")
    first, other = builders.limb("Arm", length=2.4)
    second = first.copy()
    second.data = first.data.copy()
    second.name = "Sleeve"
    bpy.context.collection.objects.link(second)
    bpy.context.scene.skinwright.retarget.source = rig
    other.pose.bones["Lower"].rotation_mode = "XYZ"
    other.pose.bones["Lower"].keyframe_insert("rotation_euler", frame=1)
    other.pose.bones["Lower"].rotation_euler = (0, 0, 1)
    other.pose.bones["Lower"].keyframe_insert("rotation_euler", frame=3)
    builders.select(second, first)


def bare():
    """A limb without an armature, and a donor's."""
    _, rig = builders.limb("Donor")
    obj, own = builders.limb("Arm", length=2.4, bound=False)
    bpy.data.objects.remove(own)
    bpy.context.scene.skinwright.retarget.source = rig
    builders.select(obj)


def baked():
    """A limb with correctives from before."""
    characters()
    builders.select(bpy.data.objects["Arm"])
    bpy.ops.skinwright.bake_correctives(samples=1, twist=0)


CACHE, CERTIFICATE = (os.path.join(FILES, name) for name in ("cache.pc2", "certificate.json"))
ops = bpy.ops.skinwright
OPERATIONS = {
    "transfer": (dressed, lambda: ops.transfer_weights(groups="ALL", mix_factor=0.7)),
    "transfer one": (dressed, lambda: ops.transfer_weights()),
    "transfer and replace": (dressed, lambda: ops.transfer_weights(replace_others=True)),
    "transfer in the pose": (posed, lambda: ops.transfer_weights(geometry="CURRENT", replace_others=True)),
    "desparsify": (dressed, lambda: ops.desparsify(n=3)),
    "restore": (dressed, lambda: ops.restore_weights()),
    "edit mask": (dressed, lambda: ops.edit_match_mask(action="GROW")),
    "edit mask from match": (dressed, lambda: ops.edit_match_mask(action="FROM_MATCH")),
    "store": (dressed, lambda: ops.store_weights()),
    "automatic": (characters, lambda: ops.automatic_weights(resolution=16)),
    "retarget": (characters, lambda: ops.retarget_weights(show_correspondence=True)),
    "embed": (bare, lambda: ops.embed_armature()),
    "correctives": (characters, lambda: ops.bake_correctives(samples=1, twist=0, filepath=CERTIFICATE)),
    "correctives again": (baked, lambda: ops.bake_correctives(samples=2, twist=0, filepath=CERTIFICATE)),
    "no correctives": (baked, lambda: ops.remove_correctives()),
    "cache": (characters, lambda: ops.bake_refined_cache(filepath=CACHE, frame_start=1, frame_end=2)),
    "live": (characters, lambda: ops.live_refine()),
}


def build(setting):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    for name in os.listdir(FILES):
        os.unlink(os.path.join(FILES, name))
    setting()
    bpy.context.view_layer.update()


def run_once(name, injector):
    setting, operation = OPERATIONS[name]
    scenes.part("refine.live").stop()
    with contextlib.redirect_stdout(io.StringIO()):
        build(setting)
    before = scenes.state(FILES)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        sys.settrace(injector)
        try:
            operation()
        except RuntimeError:
            pass
        finally:
            sys.settrace(None)
    return before, scenes.state(FILES)


def case(name, rng, whole):
    count, done = whole[name]
    injector = Injector(int(rng.integers(1, count + 1)), ERRORS[int(rng.integers(len(ERRORS)))])
    before, after = run_once(name, injector)
    assert after in (before, done), (
        f"half written after {injector.error.__name__} at {injector.fired}: {scenes.differing(before, after)}"
    )
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
