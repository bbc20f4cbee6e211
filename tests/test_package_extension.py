"""The manifest that goes into the zip; Blender's own tool checks the rest while packing."""

import tomllib

import package_extension


def test_the_packed_manifest_gains_the_wheel_and_loses_nothing():
    plain = (package_extension.ADDON / "blender_manifest.toml").read_text()
    packed = tomllib.loads(package_extension.with_wheel(plain, "some-1.0-cp311-abi3-linux.whl"))
    added = {"platforms": ["linux-x64"], "wheels": ["./wheels/some-1.0-cp311-abi3-linux.whl"]}
    assert packed == tomllib.loads(plain) | added
