"""The transfer without a window: exit codes, files, and the same answer as the operator's."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
BONES = ["Arm.L", "Arm.R"]
SCRIPT = Path(__file__).resolve().parents[2] / "blender_scripts" / "transfer_weights.py"

pytestmark = pytest.mark.usefixtures("native", "scene")


@pytest.fixture
def body(scene):
    obj = builders.body()
    scene.skinwright.transfer.source = obj
    return obj


@pytest.fixture
def coat(body):
    obj = builders.grid("Coat", 9, size=1.8, z=0.02)
    obj.location.z = 0.1
    builders.paint(obj, Mask=[0.0] * 10 + [0.5] * 71)
    obj.skinwright.mask_group = "Mask"
    builders.select(obj)
    bpy.context.view_layer.update()
    return obj


@pytest.fixture
def blend(coat, tmp_path):
    """The scene in a file of its own; it stays open too."""
    builders.grid("Belt", 5, size=0.5, z=0.01)
    path = tmp_path / "in.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    return path


def script(*arguments):
    """Run the script by Python, as where there is no Blender; gives the finished process."""
    command = [sys.executable, str(SCRIPT), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


@pytest.fixture
def transfer(addon):
    """The command in this process."""
    return lambda *arguments: addon.headless.command_line.transfer([str(a) for a in arguments])


def loaded(path, name):
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.data.objects[name]


def test_script_writes_what_the_operator_writes(blend, coat, tmp_path):
    settings, report, out = (tmp_path / name for name in ("settings.json", "report.json", "out.blend"))
    settings.write_text(json.dumps({"max_normal_angle": 20, "relative_max_distance": 0.2, "max_influences": 2}))
    bpy.ops.skinwright.transfer_weights(max_normal_angle=np.radians(20), relative_max_distance=0.2, max_influences=2)
    expected = builders.dense(coat, BONES)
    before = blend.read_bytes()
    done = script(
        blend, "--source", "Body", "--target", "Coat", "--target", "Belt",
        "--settings", settings, "--report", report, "--save", out,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Body to Coat, Belt" in done.stdout
    assert blend.read_bytes() == before
    content = json.loads(report.read_text())
    assert content["settings"]["max_normal_angle"] == pytest.approx(20)
    assert [garment["target"] for garment in content["garments"]] == ["Coat", "Belt"]
    assert content["garments"][0]["inpainted"] == 10
    assert builders.dense(loaded(out, "Coat"), BONES) == pytest.approx(expected, abs=1e-6)
    assert builders.dense(bpy.data.objects["Belt"], BONES).sum(1) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["BLEND", "--source", "Nobody", "--target", "Coat"], 1, "there is no object Nobody; there are Belt, Body"),
        (["gone.blend", "--source", "Body", "--target", "Coat"], 1, "there is no file gone.blend"),
        (["BLEND", "--source", "Rig", "--target", "Coat"], 1, "Rig is not a mesh"),
        (["BLEND", "--target", "Coat"], 2, "--source"),
        (["BLEND", "--source", "Body"], 2, "--target"),
        ([], 2, "usage"),
    ],
)
def test_script_exit_codes(blend, arguments, code, sentence):
    done = script(*(str(blend) if argument == "BLEND" else argument for argument in arguments))
    assert (done.returncode, done.stdout.count("matched")) == (code, 0)
    assert sentence in done.stderr


@pytest.fixture
def blender(native, tmp_path):
    """Run a real Blender, the one SKINWRIGHT_BLENDER names or that on the path, with the native module in reach."""
    executable = os.environ.get("SKINWRIGHT_BLENDER") or shutil.which("blender")
    if not executable:
        pytest.skip("there is no Blender: put one on the path or name it by SKINWRIGHT_BLENDER")
    site = tmp_path / "site"
    site.mkdir()
    shutil.copytree(Path(native.__file__).parent, site / "skinwright_native")
    environment = os.environ | {"PYTHONPATH": str(site), "BLENDER_USER_RESOURCES": str(tmp_path / "user")}
    start = [executable, "-b", "--factory-startup", "--python-use-system-env"]
    return lambda *arguments: subprocess.run(
        [*start, *map(str, arguments)], capture_output=True, text=True, timeout=120, env=environment
    )


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["--source", "Body", "--target", "Coat"], 0),
        (["--source", "Body", "--target", "Hat"], 1),
        (["--source", "Body"], 2),
    ],
)
def test_in_a_real_blender(blender, blend, tmp_path, arguments, code):
    report = tmp_path / "report.json"
    done = blender(blend, "-P", SCRIPT, "--", *arguments, "--report", report)
    assert done.returncode == code, done.stderr
    assert report.exists() == (code == 0)


class TestInThisProcess:
    """The command the script and `blender -c skinwright transfer` share."""

    def test_done(self, transfer, coat, capsys):
        assert transfer("--source", "Body", "--target", "Coat", "--method", "paper") == 0
        assert "Body to Coat: 71 of 81 vertices matched, 10 inpainted, distance" in capsys.readouterr().out
        assert transfer("--source", "Body", "--target", "Coat") == 0
        said = re.search(r"Coat: (\d+) of 81 vertices matched closely, (\d+) smoothed;", capsys.readouterr().out)
        matched, smoothed = said.groups()
        assert int(matched) + int(smoothed) == 81
        assert builders.dense(coat, BONES).sum(1) == pytest.approx(1, abs=1e-6)

    def test_failing_saves_nothing(self, transfer, coat, tmp_path, capsys):
        coat.location.z = 50
        bpy.context.view_layer.update()
        out, report = tmp_path / "out.blend", tmp_path / "report.json"
        assert transfer("--source", "Body", "--target", "Coat", "--save", out, "--report", report) == 1
        assert "skinwright: Coat: " in capsys.readouterr().err
        assert not out.exists() and not report.exists()

    def test_a_file_that_is_no_blend(self, transfer, tmp_path, capsys):
        path = tmp_path / "text.blend"
        path.write_text("not a blend")
        assert transfer(path, "--source", "Body", "--target", "Coat") == 1
        assert "cannot be opened" in capsys.readouterr().err

    def test_a_folder_that_is_not_there(self, transfer, coat, tmp_path, capsys):
        assert transfer("--source", "Body", "--target", "Coat", "--save", tmp_path / "none" / "out.blend") == 1
        assert "cannot be saved" in capsys.readouterr().err
        assert transfer("--source", "Body", "--target", "Coat", "--report", tmp_path / "none" / "out.json") == 1

    @pytest.mark.parametrize(
        ("settings", "sentence"),
        [
            ('{"max_distanse": 1}', "no setting max_distanse"),
            ('{"max_influences": 1.5}', "max_influences cannot be 1.5"),
            ('{"island_policy": "sink"}', "island_policy cannot be 'sink'"),
            ('{"match_flipped_normals": 1}', "match_flipped_normals cannot be 1"),
            ('{"mask": {"group": 3}}', "group cannot be 3"),
            ("[]", "must be a JSON object"),
            ("{", "Expecting property name"),
        ],
    )
    def test_bad_settings_are_wrong_usage(self, transfer, coat, tmp_path, capsys, settings, sentence):
        path = tmp_path / "settings.json"
        path.write_text(settings)
        assert transfer("--source", "Body", "--target", "Coat", "--settings", path) == 2
        assert sentence in capsys.readouterr().err
        assert len(coat.vertex_groups) == 1

    def test_bad_values_are_refused_by_the_library(self, transfer, coat, tmp_path, capsys):
        path = tmp_path / "settings.json"
        path.write_text('{"relative_max_distance": -1}')
        assert transfer("--source", "Body", "--target", "Coat", "--settings", path) == 1
        assert "max_distance is -1" in capsys.readouterr().err

    @pytest.mark.parametrize("value", ["NaN", "Infinity", "-Infinity", "2", "-0.1", "1e300", "9" * 400])
    @pytest.mark.parametrize("groups", ["BONE_DEFORM", "ALL"])
    def test_a_mix_beyond_its_range_is_refused(self, transfer, coat, tmp_path, capsys, value, groups):
        path = tmp_path / "settings.json"
        path.write_text(f'{{"mix_factor": {value}, "groups": "{groups}"}}')
        before = builders.weights(coat)
        assert transfer("--source", "Body", "--target", "Coat", "--settings", path) == 1
        assert transfer("--source", "Body", "--target", "Coat", f"--mix-factor={value}", "--groups", groups) == 1
        assert capsys.readouterr().err.count("mix_factor is ") == 2
        assert builders.weights(coat) == before

    def test_an_operator_refuses_it_too(self, coat):
        before = builders.weights(coat)
        with pytest.raises(RuntimeError, match="mix_factor is nan, but must lie between 0 and 1"):
            bpy.ops.skinwright.transfer_weights(mix_factor=float("nan"), groups="ALL")
        assert builders.weights(coat) == before

    @pytest.mark.parametrize("threads", ["-1", "99999999999999999999", "100000", "1e9", "x", "9" * 5000])
    def test_threads_beyond_their_range(self, transfer, coat, capsys, threads):
        assert transfer("--source", "Body", "--target", "Coat", "--threads", threads) in (1, 2)
        error = capsys.readouterr().err
        assert "threads" in error and "Traceback" not in error

    @pytest.mark.parametrize("text", ["[" * 100_000, '{"mask": {"invert": true}}', '{"a": ' + "9" * 5000 + "}", "\x00"])
    def test_junk_in_settings_is_a_sentence(self, transfer, coat, tmp_path, capsys, text):
        path = tmp_path / "settings.json"
        path.write_text(text)
        assert transfer("--source", "Body", "--target", "Coat", "--settings", path) == 2
        error = capsys.readouterr().err
        assert "--settings" in error and "Traceback" not in error

    def test_a_byte_order_mark_does_not_matter(self, transfer, coat, tmp_path):
        """Windows' own editor writes one."""
        path, report = tmp_path / "settings.json", tmp_path / "report.json"
        path.write_text('{"max_influences": 1}', encoding="utf-8-sig")
        assert transfer("--source", "Body", "--target", "Coat", "--settings", path, "--report", report) == 0
        assert json.loads(report.read_text())["settings"]["max_influences"] == 1

    def test_a_target_named_twice_is_one(self, transfer, coat, tmp_path):
        report = tmp_path / "report.json"
        assert transfer("--source", "Body", "--target", "Coat", "--target", "Coat", "--report", report) == 0
        assert len(json.loads(report.read_text())["garments"]) == 1

    def test_every_setting_is_an_argument_too(self, transfer, coat, tmp_path):
        report = tmp_path / "report.json"
        arguments = ["--max-influences", 1, "--max-normal-angle", 20, "--match-flipped-normals", "false"]
        assert transfer("--source", "Body", "--target", "Coat", *arguments, "--report", report) == 0
        settings = json.loads(report.read_text())["settings"]
        assert (settings["max_influences"], settings["match_flipped_normals"]) == (1, False)
        assert settings["max_normal_angle"] == pytest.approx(20)

    def test_no_output_costs_an_input(self, transfer, blend, tmp_path, capsys):
        """Not the file that is opened, not the settings, not the other output."""
        settings = tmp_path / "settings.json"
        settings.write_text("{}")
        job = (blend, "--source", "Body", "--target", "Coat", "--settings", settings)
        before = blend.read_bytes()
        for outputs in (
            ["--report", blend],
            ["--report", blend, "--overwrite"],
            ["--report", settings],
            ["--save", settings, "--overwrite"],
            ["--save", blend],
            ["--save", tmp_path / "x", "--report", tmp_path / "x"],
            ["--save", tmp_path / "x", "--report", tmp_path / "x", "--overwrite"],
        ):
            assert transfer(*job, *outputs) == 1, outputs
            assert "skinwright: " in capsys.readouterr().err
            assert blend.read_bytes() == before and settings.read_text() == "{}"
            assert not (tmp_path / "x").exists()
        assert transfer(*job, "--save", blend, "--overwrite") == 0
        assert builders.dense(loaded(blend, "Coat"), BONES).sum(1) == pytest.approx(1, abs=1e-6)

    def test_the_open_file_is_an_input(self, transfer, coat, tmp_path):
        path = tmp_path / "open.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        before = path.read_bytes()
        for output in ("--report", "--save"):
            assert transfer("--source", "Body", "--target", "Coat", output, path) == 1
        assert path.read_bytes() == before

    def test_no_output_of_refine_costs_a_file(self, addon, tmp_path, capsys):
        """Not the file that is opened, not another output, not a foreign file."""
        builders.limb("Arm")
        blend, notes, new = (tmp_path / name for name in ("arm.blend", "notes.pc2", "new.pc2"))
        bpy.ops.wm.save_as_mainfile(filepath=str(blend), copy=True)
        notes.write_text("mine")
        before = blend.read_bytes()
        job = ["cache", str(blend), "--object", "Arm", "--frames", "1", "2"]
        for outputs in (
            ["--cache", new, "--report", new],
            ["--cache", new, "--report", new, "--overwrite"],
            ["--cache", new, "--save", new, "--overwrite"],
            ["--cache", new, "--report", blend],
            ["--cache", new, "--report", blend, "--overwrite"],
            ["--cache", notes],
            ["--cache", new, "--save", blend],
        ):
            assert addon.headless.command_line.refine([*job, *map(str, outputs)]) == 1, outputs
            assert "skinwright: " in capsys.readouterr().err
            assert blend.read_bytes() == before and notes.read_text() == "mine" and not new.exists()
        report = tmp_path / "report.json"
        for _ in range(2):
            assert addon.headless.command_line.refine([*job, "--cache", str(new), "--report", str(report)]) == 0
            new.unlink()

    def test_settings_go_through_json_unchanged(self, addon):
        params = addon.transfer.TransferParams(
            max_distance=0.25, mask=addon.transfer.Mask("Mask", "PAINTED", invert=True), island_policy="rigid"
        )
        again = addon.transfer.from_json(json.loads(json.dumps(addon.transfer.to_json(params))))
        assert again.max_normal_angle == pytest.approx(params.max_normal_angle)
        assert again == addon.transfer.from_json(addon.transfer.to_json(again))
        assert (again.max_distance, again.mask, again.island_policy) == (0.25, params.mask, "rigid")

    def test_main(self, addon, coat, capsys):
        assert addon.headless.command_line.main(["transfer", "--source", "Body", "--target", "Coat"]) == 0
        assert addon.headless.command_line.main(["--version"]) == 0
        assert addon.native.addon_version() in capsys.readouterr().out
        assert addon.headless.command_line.main(["transfer", "--help"]) == 0
        assert 'island_policy "bridge"' in " ".join(capsys.readouterr().out.split())
        assert addon.headless.command_line.main([]) == 2
        assert addon.headless.command_line.main(["dance"]) == 2
