"""Random settings, sculpts and weight files for the commands: done, or a sentence and exit code 1 or 2.

python tests/fuzz/settings.py [--seconds 120] [--cases N] [--first SEED]
"""

import contextlib
import io
import json
import tempfile
from pathlib import Path

import numpy as np
import scenes
from findings import NEVER, Run
from scenes import bpy, builders

FOLDER = Path(tempfile.mkdtemp(prefix="skinwright-fuzz-"))
JUNK = [0, 1, -1, 0.5, 1e300, -1e300, float("nan"), float("inf"), 1 << 70, 10**400, True, None, "", "a", [], [1], {}]
JUNK += [{"group": "Mask"}, {"invert": True}, "BRIDGE", "bridge", "ALL", "ä" * 300]
command = scenes.part("headless.command_line")


def broken_text(text, rng):
    """A text as it is, cut, or with a part changed."""
    match int(rng.integers(5)):
        case 0:
            return text[: int(rng.integers(len(text) + 1))]
        case 1:
            at = int(rng.integers(len(text) + 1))
            return text[:at] + str(rng.choice(["[", "}", '"', "\\", "9" * 4000, "[" * 3000, "\x00"])) + text[at:]
        case _:
            return text


def settings_file(kind, rng):
    names = [*scenes.addon.declared.declared(kind), "nothing", "evaluated"]
    chosen = [str(name) for name in rng.choice(names, rng.integers(0, 4), replace=False)]
    content = {name: JUNK[int(rng.integers(len(JUNK)))] for name in chosen}
    path = FOLDER / "settings.json"
    path.write_text(broken_text(json.dumps(content if rng.random() < 0.95 else [content]), rng))
    return path


def transfer(rng, _obj):
    kind = scenes.part("transfer.params").TransferParams
    report = ["--report", FOLDER / "report.json"] if rng.random() < 0.3 else []
    return command.transfer, ["--source", "Body", "--target", "Coat", "--settings", settings_file(kind, rng), *report]


def arguments(rng, _obj):
    """The same by arguments, with numbers of all kinds."""
    names = [
        name for name in scenes.addon.declared.declared(scenes.part("transfer.params").TransferParams) if name != "mask"
    ]
    given = []
    for name in rng.choice(names, rng.integers(1, 4), replace=False):
        value = JUNK[int(rng.integers(len(JUNK)))]
        given.append(f"--{str(name).replace('_', '-')}={value}")
    return command.transfer, ["--source", str(rng.choice(["Body", "Rig", "Nobody"])), "--target", "Coat", *given]


def sculpt(rng, obj):
    """Sculpts of wrong shapes and types, and damaged files."""
    n = len(obj.data.vertices)
    arrays = {"positions": rng.normal(size=(1, n, 3)).astype(np.float32), "frames": np.array([1])}
    if rng.random() < 0.5:
        del arrays["frames"]
        arrays |= {
            "bones": np.array(["Arm.L"]),
            "matrices": np.tile(np.eye(4), (1, 1, 1, 1)) + rng.normal(size=(1, 1, 4, 4)),
        }
    wrong = [
        np.zeros(3),
        np.zeros((1, n, 3), "U1"),
        np.array([["x"]]),
        np.full((1, n, 3), np.nan),
        np.array([1, 2]),
        np.array([1e300]),
    ]
    if rng.random() < 0.6:
        arrays[str(rng.choice(list(arrays)))] = wrong[int(rng.integers(len(wrong)))]
    path = FOLDER / "sculpts.npz"
    np.savez(path, **arrays)
    damage(path, rng)
    kind = scenes.part("sculpt.params").SculptParams
    target = str(rng.choice(["Coat", "Coat", "Rig"]))
    return command.sculpt, ["--target", target, "--sculpts", path, "--settings", settings_file(kind, rng)]


def weights(rng, obj):
    """Weight files, damaged or not, and actions without what they need."""
    path = FOLDER / str(rng.choice(["weights.npz", "weights.json", "weights.txt"]))
    record, keeping = scenes.part("stored.record"), scenes.part("stored.keeping")
    content = record.to_npz(keeping.take(obj)) if path.suffix == ".npz" else record.to_json(keeping.take(obj)).encode()
    path.write_bytes(content)
    damage(path, rng)
    action = str(rng.choice(["import", "export", "compare", "restore", "store", "list", "forget", "dance"]))
    given = ["--file", path] if rng.random() < 0.8 else []
    return command.weights, [action, "--object", str(rng.choice(["Coat", "Coat", "Coat", "Rig", ""])), *given]


def more_targets(rng):
    """Of the operations on whole characters: names of objects, some of them wrong or twice."""
    names = [str(rng.choice(["Coat", "Coat", "Sleeve", "Rig", "Nobody", ""])) for _ in range(int(rng.integers(1, 4)))]
    return [argument for name in names for argument in ("--target", name)]


def automatic(rng, _obj):
    kind = scenes.part("autoskin.params").AutoskinParams
    rig = ["--armature", str(rng.choice(["Rig", "Coat", "Nobody"]))] if rng.random() < 0.4 else []
    return command.automatic_weights, [*more_targets(rng), *rig, "--settings", settings_file(kind, rng), *outputs(rng)]


def retarget(rng, _obj):
    kind = scenes.part("retarget.params").RetargetParams
    source = str(rng.choice(["Body", "Rig", "Donor Rig", "Donor", "Nobody"]))
    given = ["--source", source, *more_targets(rng), "--settings", settings_file(kind, rng)]
    return command.retarget, [*given, *outputs(rng)]


def embed(rng, _obj):
    kind = scenes.part("embed.params").EmbedParams
    source = str(rng.choice(["Donor Rig", "Donor Rig", "Rig", "Coat", "Nobody"]))
    given = ["--source", source, *more_targets(rng), "--settings", settings_file(kind, rng)]
    return command.embed_armature, [*given, *outputs(rng)]


def refine(rng, _obj):
    names = list(scenes.addon.declared.declared(scenes.part("refine.params").CorrectiveParams))
    given = [f"--{name.replace('_', '-')}={JUNK[int(rng.integers(len(JUNK)))]}" for name in rng.choice(names, 2)]
    action = str(rng.choice(["correctives", "cache", "remove", "dance"]))
    target = str(rng.choice(["Sleeve", "Sleeve", "Coat", "Rig", "Nobody"]))
    frames = ["--frames", str(rng.integers(-2, 3)), str(rng.choice([1, 2, 10**12]))] if rng.random() < 0.6 else []
    cache = ["--cache", FOLDER / str(rng.choice(FILES))] if rng.random() < 0.6 else []
    given = given[: int(rng.integers(3))]
    return command.refine, [action, "--object", target, *given, *frames, *cache, *outputs(rng)]


# The first three belong to somebody.
FILES = ["notes.json", "scene.blend", "old.pc2", "new.json", "new.pc2", "new.mdd", "no folder/x.json"]


def outputs(rng):
    """Reports and saved files at all kinds of places."""
    found = []
    for name in ("--report", "--save"):
        if rng.random() < 0.3:
            found += [name, FOLDER / str(rng.choice(FILES))]
    return found


def damage(path, rng):
    content = bytearray(path.read_bytes())
    match int(rng.integers(5)):
        case 0 if content:
            del content[int(rng.integers(len(content))) :]
        case 1 if content:
            for at in rng.integers(0, len(content), 5):
                content[at] = int(rng.integers(256))
    path.write_bytes(bytes(content))


def case(make, rng):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = builders.rig()
    builders.body(6, rig)
    coat = builders.grid("Coat", 5, z=0.05)
    builders.paint(coat, Arm__L=0.3, Arm__R=0.7)
    coat.modifiers.new("Armature", "ARMATURE").object = rig
    builders.limb("Donor")
    builders.limb("Sleeve", length=2.4)
    for name in FILES:
        (FOLDER / name).unlink(missing_ok=True)
    for name in FILES[:3]:
        (FOLDER / name).write_text("mine")
    rig.pose.bones["Arm.L"].rotation_mode = "XYZ"
    rig.pose.bones["Arm.L"].rotation_euler = (0.5, 0.3, 0)
    bpy.context.view_layer.update()
    objects = [obj for obj in bpy.data.objects if obj.type == "MESH"]
    before = scenes.digests(objects)
    function, given = make(rng, coat)
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        code = function([str(each) for each in given])
    said = error.getvalue()
    assert code in (0, 1, 2) and not any(word in said for word in NEVER), f"exit code {code}: {said[-400:]}"
    if code:
        assert said.strip(), "refused without a sentence"
        assert scenes.digests(objects) == before, "refused, and weights changed"
    scenes.check_sound(objects, before)
    assert all((FOLDER / name).read_text() == "mine" for name in FILES[:3]), "a foreign file was overwritten"
    return f"exit code {code}"


if __name__ == "__main__":
    run = Run("settings and files", cases=1_000_000)
    makers = [transfer, arguments, sculpt, weights, automatic, retarget, embed, refine]
    for seed, generator in run.cases():
        chosen = makers[int(generator.integers(len(makers)))]
        run.attempt(seed, chosen.__name__, case, chosen, generator)
    run.end()
