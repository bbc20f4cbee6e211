"""Random operator calls in random scenes: done with sound weights, or refused with a sentence and nothing changed.

python tests/fuzz/operators.py [--seconds 120] [--cases N] [--first SEED]
"""

import contextlib
import io

import scenes
from findings import NEVER, Run
from scenes import bpy, builders

NUMBERS = [0.0, 1.0, -1.0, 0.5, 2.0, 1e30, -1e30, float("nan"), float("inf"), float("-inf")]
OPERATORS = ["transfer_weights", "desparsify", "check_weights", "edit_match_mask", "preview_match", "select_match"]
OPERATORS += ["store_match", "store_weights", "restore_weights", "compare_weights", "forget_weights", "reset_settings"]
# These write no weight of the garments, or are asked to forget.
MODES = ["OBJECT", "OBJECT", "OBJECT", "EDIT", "WEIGHT_PAINT", "SCULPT"]


def properties(operator, rng):
    """Random values for some properties of an operator."""
    found = {}
    for prop in operator.get_rna_type().properties:
        if prop.identifier in ("rna_type", "filepath", "overwrite") or rng.random() < 0.6:
            continue
        if prop.type == "ENUM" and not prop.is_enum_flag and prop.enum_items_static:
            found[prop.identifier] = str(rng.choice([item.identifier for item in prop.enum_items_static]))
        elif prop.type == "FLOAT" and not prop.is_array:
            span = rng.uniform(prop.soft_min, min(prop.soft_max, 1e3))
            found[prop.identifier] = NUMBERS[int(rng.integers(len(NUMBERS)))] if rng.random() < 0.2 else float(span)
        elif prop.type == "INT" and not prop.is_array:
            found[prop.identifier] = int(rng.integers(prop.soft_min, min(prop.soft_max, 30) + 1))
        elif prop.type == "BOOLEAN":
            found[prop.identifier] = bool(rng.random() < 0.5)
    return found


def case(name, rng):
    body, garments = scenes.dress(rng)
    if rng.random() < 0.4 and garments[0].visible_get():
        with contextlib.suppress(RuntimeError):
            bpy.ops.object.mode_set(mode=str(rng.choice(MODES)))
    mode = bpy.context.mode
    edited = mode == "EDIT_MESH"
    objects = [body, *garments]
    before = {} if edited else scenes.digests(objects)
    operator = getattr(bpy.ops.skinwright, name)
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            outcome = operator(**properties(operator, rng))
    except RuntimeError as error:
        sentence = str(error)
        assert not any(word in sentence + said.getvalue() for word in NEVER), sentence + said.getvalue()
        assert bpy.context.mode == mode, f"refused in {mode}, and left in {bpy.context.mode}"
        assert edited or scenes.digests(objects) == before, "refused, and weights changed"
        return "refused"
    if bpy.context.mode == "EDIT_MESH":
        bpy.ops.object.mode_set(mode="OBJECT")
    scenes.check_sound(objects, before)
    builders.select(*[obj for obj in garments if obj.visible_get()])
    return next(iter(outcome)).lower()


if __name__ == "__main__":
    run = Run("operators", cases=1_000_000)
    for seed, generator in run.cases():
        chosen = OPERATORS[int(generator.integers(len(OPERATORS)))]
        run.attempt(seed, chosen, case, chosen, generator)
    run.end()
