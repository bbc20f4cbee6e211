"""No output costs a file: not an input, not another output, not what is not ours, and not the old report."""

import json
import os
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")


@pytest.fixture
def files(addon):
    return addon.files


def test_a_report_replaces_a_report(files, tmp_path):
    path = tmp_path / "report.json"
    for number in (1, 2):
        files.write_report(path, {"number": number})
        assert json.loads(path.read_text())["number"] == number
    files.write_report(path, [{"number": 3}])
    files.write_report(path, {"number": 4})
    assert [p.name for p in tmp_path.iterdir()] == ["report.json"]


def test_reports_of_before_are_known(files, tmp_path):
    path = tmp_path / "report.json"
    for old in ({"version": "0", "settings": {}, "sentence": ""}, [{"target": "", "faults": {}, "poses": []}]):
        path.write_text(json.dumps(old))
        assert files.is_report(path)


@pytest.mark.parametrize("content", ['{"a": 1}', "[]", "3", "null", "BLENDER-v405", "[" * 100_000, "\x00", "\xff"])
def test_what_is_not_a_report_stays_unless_told(files, tmp_path, content):
    path = tmp_path / "report.json"
    path.write_bytes(content.encode("latin-1"))
    with pytest.raises(files.FileError, match="exists and is not a report of Skinwright"):
        files.write_report(path, {})
    assert path.read_bytes() == content.encode("latin-1")
    files.write_report(path, {}, overwrite=True)
    assert files.is_report(path)


def test_inputs_and_other_outputs_stay_also_by_another_name(files, tmp_path):
    source = tmp_path / "in.json"
    files.write_report(source, {"kept": 1})
    (tmp_path / "link.json").symlink_to(source)
    os.link(source, tmp_path / "hard.json")
    (tmp_path / "sub").mkdir()
    for name in ("in.json", "link.json", "hard.json", "sub/../in.json"):
        with pytest.raises(files.FileError, match="used twice"):
            files.write_report(tmp_path / name, {}, others=[source], overwrite=True)
    with pytest.raises(files.FileError, match="used twice"):
        files.check_output(tmp_path / "new", others=[tmp_path / "sub" / ".." / "new"])
    assert json.loads(source.read_text())["kept"] == 1


def test_folders_and_missing_folders_are_named(files, tmp_path):
    with pytest.raises(files.FileError, match="is a folder"):
        files.write_report(tmp_path, {})
    with pytest.raises(files.FileError, match="there is no folder"):
        files.write_report(tmp_path / "none" / "r.json", {})


def test_an_empty_file_and_a_link_are_written_through(files, tmp_path):
    (tmp_path / "there.json").touch()
    (tmp_path / "link.json").symlink_to(tmp_path / "there.json")
    files.write_report(tmp_path / "link.json", {})
    assert (tmp_path / "link.json").is_symlink() and files.is_report(tmp_path / "there.json")


def test_devices_are_written_to(files):
    files.write_report(Path("/dev/null"), {})
    assert Path("/dev/null").is_char_device()


@pytest.mark.parametrize("line", ["fsync", "replace", "chmod"])
def test_a_write_that_breaks_leaves_the_old_file_whole(files, tmp_path, monkeypatch, line):
    path = tmp_path / "report.json"
    files.write_report(path, {"number": 1})
    before = path.read_bytes()

    def full(*_arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, line, full)
    with pytest.raises(OSError, match="No space"):
        files.write_report(path, {"number": 2})
    assert path.read_bytes() == before and len(list(tmp_path.iterdir())) == 1


def test_numbers_that_are_none_never_reach_a_report(files, addon, tmp_path):
    assert addon.reporting._plain({"a": [float("nan"), 1.0], "b": float("inf")}) == {"a": [None, 1.0], "b": None}
    with pytest.raises(ValueError, match="JSON"):
        files.write_report(tmp_path / "r.json", {"a": float("nan")})
    assert not list(tmp_path.iterdir())
