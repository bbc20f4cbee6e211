"""Random operator calls in random scenes: done with sound weights, or refused with a sentence and nothing changed.

python tests/fuzz/operators.py [--seconds 120] [--cases N] [--first SEED]
"""

import contextlib
import io
import os
import tempfile

import scenes
from findings import NEVER, Run
from scenes import bpy, builders

NUMBERS = [0.0, 1.0, -1.0, 0.5, 2.0, 1e30, -1e30, float("nan"), float("inf"), float("-inf")]
OPERATORS = ["transfer_weights", "desparsify", "check_weights", "edit_match_mask", "preview_match", "select_match"]
OPERATORS += ["store_match", "store_weights", "restore_weights", "compare_weights", "forget_weights", "reset_settings"]
OPERATORS += ["export_weights", "import_weights", "explain_vertex", "active_as_source", "show_overlay", "mask_brush"]
CHARACTERS = ["automatic_weights", "retarget_weights", "embed_armature", "bake_correctives", "remove_correctives"]
CHARACTERS += ["bake_refined_cache", "remove_refined_cache", "live_refine", "match_bones", "bone_map_save"]
CHARACTERS += ["bone_map_load", "step_pose", "automatic_weights", "retarget_weights", "embed_armature"]
MODES = ["OBJECT", "OBJECT", "OBJECT", "EDIT", "WEIGHT_PAINT", "SCULPT", "POSE"]
FILES = tempfile.mkdtemp(prefix="skinwright-fuzz-files-")
FOREIGN = {"notes.json": b'["mine"]', "scene.blend": b"BLENDER", "action.pc2": b"", "weights.npz": b"PK\x03\x04"}


def properties(operator, rng):
    """Random values for some properties of an operator."""
    found, left_out = {}, rng.choice([0.5, 0.9, 1.0])
    for prop in operator.get_rna_type().properties:
        if prop.identifier in ("rna_type", "overwrite", "filter_glob") or rng.random() < left_out:
            continue
        if prop.identifier == "filepath":
            names = [*FOREIGN, "new.json", "new.npz", "new.pc2", "no folder/x.json", ".", ""]
            found["filepath"] = os.path.join(FILES, names[int(rng.integers(len(names)))])
        elif prop.type == "ENUM" and not prop.is_enum_flag and prop.enum_items_static:
            found[prop.identifier] = str(rng.choice([item.identifier for item in prop.enum_items_static]))
        elif prop.type == "FLOAT" and not prop.is_array:
            span = rng.uniform(prop.soft_min, min(prop.soft_max, 1e3))
            found[prop.identifier] = NUMBERS[int(rng.integers(len(NUMBERS)))] if rng.random() < 0.2 else float(span)
        elif prop.type == "INT" and not prop.is_array:
            extreme = rng.random() < 0.1
            least, most = (prop.hard_min, prop.hard_max) if extreme else (max(prop.soft_min, -3), min(prop.soft_max, 9))
            found[prop.identifier] = int(rng.integers(least, most + 1))
        elif prop.type == "BOOLEAN":
            found[prop.identifier] = bool(rng.random() < 0.5)
    return found


def foreign_files():
    """They are as they were, whatever was done."""
    for name, content in FOREIGN.items():
        path = os.path.join(FILES, name)
        assert os.path.exists(path), f"{name} is gone"
        with open(path, "rb") as file:
            assert not content or file.read() == content, f"{name} was overwritten"


def fresh_files():
    for name in os.listdir(FILES):
        os.unlink(os.path.join(FILES, name))
    for name, content in FOREIGN.items():
        with open(os.path.join(FILES, name), "wb") as file:
            file.write(content)


def case(name, rng):
    scenes.part("refine.live").stop()
    fresh_files()
    source, targets = scenes.characters(rng) if name in CHARACTERS else scenes.dress(rng)
    if name in ("remove_correctives", "bone_map_save") and rng.random() < 0.7:
        with contextlib.suppress(RuntimeError), contextlib.redirect_stdout(io.StringIO()):
            bpy.ops.skinwright.match_bones() if name == "bone_map_save" else bpy.ops.skinwright.bake_correctives(
                samples=1
            )
    objects = [source, *targets]
    held = scenes.digests(objects)
    if rng.random() < 0.4 and targets[0].visible_get():
        with contextlib.suppress(RuntimeError, TypeError):
            bpy.ops.object.mode_set(mode=str(rng.choice(MODES)))
    mode, edited = bpy.context.mode, bpy.context.mode == "EDIT_MESH"
    before = None if edited else scenes.state(FILES)
    operator = getattr(bpy.ops.skinwright, name)
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            outcome = operator(**properties(operator, rng))
    except RuntimeError as error:
        sentence = str(error)
        assert not any(word in sentence + said.getvalue() for word in NEVER), sentence + said.getvalue()
        assert bpy.context.mode == mode, f"refused in {mode}, and left in {bpy.context.mode}"
        after = None if edited else scenes.state(FILES)
        assert edited or after == before, f"refused, and changed: {scenes.differing(before, after)}"
        foreign_files()
        return "refused"
    finally:
        scenes.part("refine.live").stop()
    if bpy.context.mode == "EDIT_MESH":
        bpy.ops.object.mode_set(mode="OBJECT")
    foreign_files()
    scenes.check_sound(objects, held)
    builders.select(*[obj for obj in targets if obj.visible_get()])
    return next(iter(outcome)).lower()


if __name__ == "__main__":
    run = Run("operators", cases=1_000_000)
    for seed, generator in run.cases():
        both = OPERATORS if generator.random() < 0.5 else CHARACTERS
        chosen = both[int(generator.integers(len(both)))]
        run.attempt(seed, chosen, case, chosen, generator)
    run.end()
