"""The manifest that goes into the zips, and the table of platforms; Blender's own tool checks the rest in packing."""

import tomllib

import package_extension
import platforms
import pytest

WHEELS = {
    "linux-x64": "skinwright_native-0.1.0-cp311-abi3-manylinux_2_28_x86_64.whl",
    "windows-x64": "skinwright_native-0.1.0-cp311-abi3-win_amd64.whl",
    "linux-arm64": "skinwright_native-0.1.0-cp311-abi3-manylinux_2_28_aarch64.whl",
}


def test_the_packed_manifest_gains_the_wheels_and_loses_nothing():
    plain = (package_extension.ADDON / "blender_manifest.toml").read_text(encoding="utf-8")
    packed = tomllib.loads(package_extension.with_wheels(plain, list(WHEELS.values())))
    added = {"platforms": list(WHEELS), "wheels": [f"./wheels/{name}" for name in WHEELS.values()]}
    assert packed == tomllib.loads(plain) | added


@pytest.mark.parametrize("name", WHEELS)
def test_a_wheel_is_known_by_its_tag(name):
    assert platforms.of_wheel(WHEELS[name]).name == name


def test_a_wheel_of_no_platform_is_refused():
    with pytest.raises(ValueError, match="manylinux_2_34_x86_64"):
        platforms.of_wheel("skinwright_native-0.1.0-cp311-abi3-manylinux_2_34_x86_64.whl")


def test_the_newest_wheel_of_each_platform_is_packed(tmp_path):
    import os

    old, new = tmp_path / WHEELS["linux-x64"], tmp_path / WHEELS["linux-x64"].replace("0.1.0", "0.2.0")
    other = tmp_path / WHEELS["windows-x64"]
    for age, wheel in enumerate([new, old, other]):
        wheel.touch()
        os.utime(wheel, (1000 - age, 1000 - age))
    assert package_extension.newest_wheels(tmp_path) == [new, other]


def test_sums_are_those_of_the_files(tmp_path, monkeypatch):
    monkeypatch.setattr(package_extension, "DIST", tmp_path)
    (tmp_path / "a.zip").write_bytes(b"abc")
    package_extension.write_sums([tmp_path / "a.zip"])
    abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert (tmp_path / "SHA256SUMS").read_text() == f"{abc}  a.zip\n"
