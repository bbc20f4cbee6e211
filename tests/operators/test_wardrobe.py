"""Many garments on many bodies: what is done, what is kept, what is done again, and what a kill leaves."""

import json
import shutil
from pathlib import Path

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
pytestmark = pytest.mark.usefixtures("native")


@pytest.fixture(scope="module")
def files(addon, tmp_path_factory):
    """A folder with bodies/body.blend and three garments, one of them without a mesh."""
    folder = tmp_path_factory.mktemp("wardrobe")
    for name, build in {
        "bodies/body": builders.body,
        "garments/coat": lambda: builders.grid("Coat", 9, size=1.8, z=0.02),
        "garments/belt": lambda: builders.grid("Belt", 5, size=0.5, z=0.01),
        "garments/nothing": builders.rig,
    }.items():
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        build()
        path = folder / f"{name}.blend"
        path.parent.mkdir(exist_ok=True)
        bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    return folder


@pytest.fixture
def folder(files, tmp_path):
    """A copy of one's own."""
    return Path(shutil.copytree(files, tmp_path / "wardrobe"))


@pytest.fixture
def run(addon, folder, tmp_path, capsys):
    """The command; returns its exit code and the report."""

    def command(*arguments, manifest=folder):
        out = tmp_path / "out"
        done = addon.headless.command_line.wardrobe([str(manifest), "--out", str(out), *arguments])
        report = out / "report.json"
        return done, json.loads(report.read_text()) if report.exists() else None

    return command


def statuses(report):
    return {outcome["job"]: outcome["status"] for outcome in report["outcomes"]}


def test_every_garment_on_every_body(run, tmp_path):
    code, report = run()
    assert code == 1, "one garment file has no mesh"
    assert statuses(report) == {"body--belt": "done", "body--coat": "done", "body--nothing": "failed"}
    assert "nothing.blend lacks a mesh" in report["outcomes"][0]["error"]
    with np.load(tmp_path / "out" / "body--coat.npz", allow_pickle=False) as weights:
        assert weights["objects"].tolist() == ["Coat"]
        groups, indptr = weights["0.groups"].tolist(), weights["0.indptr"]
        assert groups == ["Arm.L", "Arm.R"] and len(indptr) == 82
        x = np.repeat(np.tile(np.linspace(-0.9, 0.9, 9), 9), np.diff(indptr.astype(np.int64)))
        left = weights["0.bones"] == 0
        assert np.allclose(weights["0.values"][left], x[left] / 2 + 0.5, atol=1e-5)


def test_only_what_changed_is_done_again(run, folder, tmp_path):
    run()
    kept = (tmp_path / "out" / "body--belt.npz").stat().st_mtime_ns
    assert statuses(run()[1]) == {"body--belt": "kept", "body--coat": "kept", "body--nothing": "failed"}
    shutil.copy(folder / "garments" / "belt.blend", folder / "garments" / "coat.blend")
    assert statuses(run()[1]) == {"body--belt": "kept", "body--coat": "done", "body--nothing": "failed"}
    assert (tmp_path / "out" / "body--belt.npz").stat().st_mtime_ns == kept


def test_a_damaged_result_is_done_again(run, tmp_path):
    run()
    result = tmp_path / "out" / "body--coat.npz"
    whole = result.read_bytes()
    result.write_bytes(whole[:100])
    assert statuses(run()[1])["body--coat"] == "done"
    assert result.read_bytes() == whole


def test_a_kill_between_result_and_record_loses_nothing(run, tmp_path, monkeypatch, addon):
    work = addon.headless.wardrobe.work

    def killed(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(work, "write_record", killed)
        with pytest.raises(KeyboardInterrupt):
            run()
    assert not list((tmp_path / "out").glob("*.json"))
    assert statuses(run()[1])["body--coat"] == "done"
    assert not list((tmp_path / "out").glob(".unfinished-*"))


def test_shards_are_disjoint_and_together_all(run, tmp_path):
    for index in range(3):
        run("--shard", f"{index}/3")
    reports = [json.loads(path.read_text()) for path in (tmp_path / "out").glob("report-*-of-3.json")]
    names = [outcome["job"] for report in reports for outcome in report["outcomes"]]
    assert sorted(names) == ["body--belt", "body--coat", "body--nothing"]


def test_settings_of_a_manifest_and_of_a_garment(run, folder):
    manifest = folder / "wardrobe.json"
    garments = [
        {"name": "one", "file": "garments/coat.blend", "settings": {"max_influences": 1}},
        {"name": "two", "file": "garments/coat.blend", "objects": ["Coat"], "bodies": ["body"]},
    ]
    bodies = [{"file": "bodies/body.blend", "object": "Body"}]
    content = {"version": 1, "settings": {"max_influences": 2}, "bodies": bodies, "garments": garments}
    manifest.write_text(json.dumps(content), encoding="utf-8")
    assert run(manifest=manifest)[0] == 0
    counts = []
    for name in ("one", "two"):
        with np.load(manifest.parent.parent / "out" / f"body--{name}.npz") as weights:
            counts.append(int(np.diff(weights["0.indptr"].astype(np.int64)).max()))
    assert counts == [1, 2]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"version": 2}, "version 2"),
        ({"garmets": []}, "no garmets"),
        ({"garments": [{"file": "a.glb", "bodies": ["who"]}]}, "the body who"),
        ({"garments": [{"file": "a.glb"}, {"file": "b/a.glb"}]}, "two jobs are called body--a"),
        ({"bodies": [3]}, "a body must be a JSON object"),
        ({"bodies": "body"}, "bodies of the manifest must be a list"),
        ({"bodies": [{"file": "bodies/body.blend"}, {"file": "other/Body.glb"}]}, "two bodies are called Body"),
        ({"bodies": [{"file": 5}]}, "file of a body must be a text, not 5"),
        ({"bodies": [{"file": "bodies/body.blend", "name": "../body"}]}, "cannot be the name of a body"),
        ({"garments": [{"file": "a.glb", "name": "/tmp/coat"}]}, "cannot be the name of a garment"),
        ({"garments": [{"file": "a.glb", "bodies": []}]}, "must be a list of names"),
        ({"garments": [{"file": "a.glb", "bodies": "body"}]}, "must be a list of names"),
        ({"garments": [{"file": "a.glb", "objects": "Coat"}]}, "objects of a garment must be a list of texts"),
        ({"settings": []}, "settings of a manifest must be an object"),
    ],
)
def test_a_manifest_that_cannot_be_meant(run, folder, change, says, capsys):
    manifest = folder / "wardrobe.json"
    content = {"bodies": [{"file": "bodies/body.blend"}], "garments": [{"file": "garments/coat.blend"}]} | change
    manifest.write_text(json.dumps(content), encoding="utf-8")
    code, report = run(manifest=manifest)
    assert code == 2 and report is None
    assert says in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments", [("--shard", "3/3"), ("--shard", "x"), ("--shard", "0/1/2"), ("--job", "body--hat")]
)
def test_arguments_that_cannot_be_meant(run, arguments):
    assert run(*arguments) == (2, None)


def of(folder, body="bodies/body.blend", *garments):
    """A manifest of one body."""
    manifest = folder / "wardrobe.json"
    manifest.write_text(json.dumps({"bodies": [{"file": body}], "garments": garments}), encoding="utf-8")
    return manifest


@pytest.mark.parametrize("settings", [{"nonsense": 1}, {"max_influences": "four"}, {"max_influences": -1}])
def test_wrong_settings_of_one_garment_stop_no_other(run, folder, settings):
    bad, good = {"file": "garments/belt.blend", "settings": settings}, {"file": "garments/coat.blend"}
    code, report = run(manifest=of(folder, "bodies/body.blend", bad, good))
    assert code == 1 and statuses(report) == {"body--belt": "failed", "body--coat": "done"}
    assert "settings of body--belt: " in report["outcomes"][0]["error"]


def test_what_nobody_foresaw_stops_no_other(run, addon, monkeypatch, capsys):
    work = addon.headless.wardrobe.work
    whole = work.transfer_weights

    def transfer_weights(context, source, targets, params):
        if targets[0].name == "Belt":
            raise KeyError("a bug")
        return whole(context, source, targets, params)

    monkeypatch.setattr(work, "transfer_weights", transfer_weights)
    code, report = run()
    assert code == 1 and statuses(report) == {"body--belt": "failed", "body--coat": "done", "body--nothing": "failed"}
    assert "Traceback" in capsys.readouterr().err


def test_objects_keep_the_names_of_their_file(run, folder, tmp_path):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    builders.grid("Body", 9, size=1.8, z=0.02)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "garments" / "suit.blend"), copy=True)
    garment = {"file": "garments/suit.blend", "objects": ["Body"]}
    assert run(manifest=of(folder, "bodies/body.blend", garment))[0] == 0
    with np.load(tmp_path / "out" / "body--suit.npz", allow_pickle=False) as weights:
        assert weights["objects"].tolist() == ["Body"]


def test_the_buffer_of_a_gltf_is_an_input(run, folder):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    builders.grid("Coat", 9, size=1.8, z=0.02)
    path = folder / "garments" / "coat.gltf"
    bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLTF_SEPARATE")
    manifest = of(folder, "bodies/body.blend", {"file": "garments/coat.gltf"})
    assert [statuses(run(manifest=manifest)[1]) for _ in range(2)] == [{"body--coat": "done"}, {"body--coat": "kept"}]
    buffer = path.with_suffix(".bin")
    positions = np.frombuffer(buffer.read_bytes(), np.float32).copy()
    positions[0] += 0.01
    buffer.write_bytes(positions.tobytes())
    assert statuses(run(manifest=manifest)[1]) == {"body--coat": "done"}


def test_a_library_of_a_garment_is_an_input(run, folder):
    library, path = folder / "meshes.blend", folder / "garments" / "linked.blend"
    for x in (0, 0.01):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        builders.grid("Coat", 9, size=1.8, z=0.02).data.vertices[0].co.x += x
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / f"meshes{x}.blend"), copy=True)
    shutil.copy(folder / "meshes0.blend", library)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(library), link=True) as (there, here):
        here.meshes = there.meshes
    group = bpy.data.objects.new("Shape", here.meshes[0])
    bpy.context.scene.collection.objects.link(group)
    coat = builders.grid("Coat", 9, size=1.8, z=0.02)
    coat.modifiers.new("Shrinkwrap", "SHRINKWRAP").target = group
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    garment = {"file": "garments/linked.blend", "objects": ["Coat"]}
    manifest = of(folder, "bodies/body.blend", garment)
    assert [statuses(run(manifest=manifest)[1]) for _ in range(2)] == [
        {"body--linked": "done"},
        {"body--linked": "kept"},
    ]
    shutil.copy(folder / "meshes0.01.blend", library)
    assert statuses(run(manifest=manifest)[1]) == {"body--linked": "done"}


def test_no_output_costs_an_input_or_a_foreign_file(addon, run, folder, tmp_path, capsys):
    manifest = of(folder, "bodies/body.blend", {"file": "garments/coat.blend"})
    named = manifest.rename(folder / "report.json")
    before = named.read_bytes()
    assert addon.headless.command_line.wardrobe([str(named), "--out", str(folder)]) == 1
    assert named.read_bytes() == before and "is an input" in capsys.readouterr().err
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.json").write_text("my notes")
    assert addon.headless.command_line.wardrobe([str(named), "--out", str(tmp_path / "out")]) == 1
    assert (tmp_path / "out" / "report.json").read_text() == "my notes"
