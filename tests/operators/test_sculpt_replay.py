"""Recorded sculpts without a window: the script in a process of its own, exit codes, report, saved file."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
mathutils = pytest.importorskip("mathutils", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")
SCRIPT = Path(__file__).resolve().parents[2] / "blender_scripts" / "sculpt_weights.py"
BONES = ["Arm.L", "Arm.R"]
ANGLES = (40, -70)


def turned(degrees):
    return np.array([np.array(mathutils.Matrix.Rotation(np.radians(d), 4, "Y")) for d in (degrees, 0)])


@pytest.fixture
def recorded(scene, tmp_path):
    """A body, and where Blender's Armature modifier puts it in two poses under other weights; gives file and .npz."""
    body = builders.body()
    rig = body.modifiers["Armature"].object
    true, present = builders.dense(body, BONES), None
    positions = []
    for angle in ANGLES:
        rig.pose.bones["Arm.L"].matrix_basis = mathutils.Matrix.Rotation(np.radians(angle), 4, "Y")
        bpy.context.view_layer.update()
        evaluated = body.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        positions.append([tuple(vertex.co) for vertex in evaluated.vertices])
    rig.pose.bones["Arm.L"].matrix_basis = mathutils.Matrix.Identity(4)
    present = np.column_stack([np.full(len(true), 0.5), np.full(len(true), 0.5)])
    for j, name in enumerate(BONES):
        for i in range(len(true)):
            body.vertex_groups[name].add([i], float(present[i, j]), "REPLACE")
    blend, sculpts = tmp_path / "in.blend", tmp_path / "sculpts.npz"
    positions = np.array(positions)
    positions[:, :12] = np.nan
    np.savez(sculpts, positions=positions, bones=BONES, matrices=[turned(angle) for angle in ANGLES])
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), copy=True)
    return blend, sculpts, true


def script(*arguments):
    """Run the script by Python, as where there is no Blender; gives the finished process."""
    command = [sys.executable, str(SCRIPT), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def test_the_true_weights_come_back(recorded, tmp_path):
    blend, sculpts, true = recorded
    settings, report, out = (tmp_path / name for name in ("settings.json", "report.json", "out.blend"))
    settings.write_text(json.dumps({"kappa": 0.001, "candidates": 2}))
    before = blend.read_bytes()
    done = script(
        blend, "--target", "Body", "--sculpts", sculpts, "--settings", settings, "--report", report, "--save", out
    )
    assert done.returncode == 0, done.stderr
    assert "Body: 2 strokes in 2 poses changed the weights of" in done.stdout
    content = json.loads(report.read_text())
    assert content["settings"]["kappa"] == 0.001 and content["strokes"] == 2
    assert content["reachability"][0] > 0.99
    assert blend.read_bytes() == before
    bpy.ops.wm.open_mainfile(filepath=str(out))
    body = bpy.data.objects["Body"]
    after = builders.dense(body, BONES)
    far = np.abs([vertex.co.x for vertex in body.data.vertices])
    np.testing.assert_array_equal(after[:12], 0.5)
    assert np.abs(after - true)[12:].mean() < 0.02 and far.size == len(after)
    assert bpy.data.objects["Rig"].pose.bones["Arm.L"].matrix_basis == mathutils.Matrix.Identity(4)


def test_frames(recorded, tmp_path, addon):
    _, sculpts, true = recorded
    body = bpy.data.objects["Body"]
    bone = body.modifiers["Armature"].object.pose.bones["Arm.L"]
    for frame, angle in zip((10, 20), ANGLES, strict=True):
        bone.matrix_basis = mathutils.Matrix.Rotation(np.radians(angle), 4, "Y")
        bone.keyframe_insert("rotation_quaternion", frame=frame)
    path = tmp_path / "frames.npz"
    np.savez(path, positions=np.load(sculpts)["positions"], frames=[10, 20])
    assert addon.headless.command_line.sculpt(["--target", "Body", "--sculpts", str(path)]) == 0
    assert np.abs(builders.dense(body, BONES) - true)[12:].mean() < 0.1
    assert bpy.context.scene.frame_current == 1


BAD = [
    ({}, "it needs an array `positions` of shape"),
    ({"positions": np.zeros((1, 144, 3))}, "it needs `frames`, or `bones` and `matrices`"),
    ({"positions": np.zeros((1, 144, 3)), "frames": [1, 2]}, "`frames` must have shape (1,)"),
    ({"positions": np.zeros((1, 9, 3)), "frames": [1]}, "Body has 144 vertices, but 9 were sculpted"),
    ({"positions": np.zeros((1, 144, 3)), "bones": ["Tail"], "matrices": np.eye(4)[None, None]}, "has no bone Tail"),
    ({"positions": np.zeros((1, 144, 3)), "frames": [1]}, "Rig is at rest"),
    ({"positions": np.zeros((1, 144, 3)), "frames": [1 << 40]}, "there is no frame 1099511627776"),
    ({"positions": np.zeros((1, 144, 3)), "frames": [-1_048_575]}, "there is no frame -1048575"),
    ({"positions": np.full((1, 144, 3), np.inf), "frames": [1]}, "infinite numbers"),
    (
        {"positions": np.zeros((1, 144, 3)), "bones": ["Arm.L"], "matrices": np.zeros((1, 1, 4, 4))},
        "must end in the row 0, 0, 0, 1",
    ),
    (
        {
            "positions": np.zeros((1, 144, 3)),
            "bones": ["Arm.L", "Arm.L"],
            "matrices": np.tile(np.eye(4), (1, 2, 1, 1)),
        },
        "names a bone twice",
    ),
]


@pytest.mark.parametrize(("arrays", "sentence"), BAD)
def test_what_does_not_fit_is_refused_with_nothing_changed(recorded, tmp_path, addon, capsys, arrays, sentence):
    before = builders.weights(bpy.data.objects["Body"])
    path = tmp_path / "bad.npz"
    np.savez(path, **arrays)
    assert addon.headless.command_line.sculpt(["--target", "Body", "--sculpts", str(path)]) == 1
    assert sentence in capsys.readouterr().err
    assert builders.weights(bpy.data.objects["Body"]) == before


def test_exit_codes(recorded, tmp_path):
    blend, sculpts, _ = recorded
    assert script(blend, "--target", "Body").returncode == 2
    done = script(blend, "--target", "Nobody", "--sculpts", sculpts)
    assert done.returncode == 1 and "there is no object Nobody" in done.stderr
    (tmp_path / "not.npz").write_text("x")
    done = script(blend, "--target", "Body", "--sculpts", tmp_path / "not.npz")
    assert done.returncode == 1 and "cannot be read as an .npz file" in done.stderr
    for bad in ({"kapa": 1}, {"guard": "SOME"}, {"kappa": "a"}, []):
        (tmp_path / "settings.json").write_text(json.dumps(bad))
        done = script(blend, "--target", "Body", "--sculpts", sculpts, "--settings", tmp_path / "settings.json")
        assert done.returncode == 2, done.stderr


def test_by_blender_itself(recorded, tmp_path):
    blender = os.environ.get("SKINWRIGHT_BLENDER") or shutil.which("blender")
    if not blender:
        pytest.skip("there is no Blender: put one on the path or name it by SKINWRIGHT_BLENDER")
    blend, sculpts, _ = recorded
    command = [blender, "-b", "--factory-startup", blend, "-P", SCRIPT, "--", "--target", "Body", "--sculpts", sculpts]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
