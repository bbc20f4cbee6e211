"""The bill of materials: the crates that cargo itself names, with the sums of Cargo.lock, the same at every run."""

import json
import shutil
import subprocess

import pytest
import sbom

if shutil.which("cargo") is None:
    pytest.skip("needs cargo", allow_module_level=True)


@pytest.fixture(scope="module")
def bill():
    return sbom.bill()


def test_it_lists_what_is_built_in_and_no_tool_of_the_tests(bill):
    """All of it is locked, and part of what cargo resolves for the whole workspace, its tests included."""
    names = {one["name"] for one in bill["components"]}
    assert {"faer", "pyo3", "rayon", "glam", "skinwright-core", "skinwright-solve"} <= names
    assert not names & {"proptest", "divan"}
    command = ["cargo", "metadata", "--format-version", "1", "--locked"]
    known = json.loads(subprocess.check_output(command, cwd=sbom.ROOT, encoding="utf-8"))["packages"]
    assert {(one["name"], one["version"]) for one in bill["components"]} <= {(p["name"], p["version"]) for p in known}


def test_every_crate_is_needed_by_one_that_is_listed(bill):
    needed = {to for one in bill["dependencies"] for to in one["dependsOn"]}
    assert needed == {one["bom-ref"] for one in bill["components"]}


def test_every_crate_has_a_licence_and_those_from_outside_a_sum(bill):
    for one in bill["components"]:
        assert one["licenses"][0]["expression"]
        assert ("hashes" in one) != one["name"].startswith("skinwright-"), one["name"]


def test_nothing_of_this_machine_or_hour_is_in_it(bill, tmp_path):
    text = json.dumps(bill)
    assert str(sbom.ROOT) not in text and "file:" not in text
    for name in ("a", "b"):
        sbom.main(tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert bill["serialNumber"] == sbom.bill()["serialNumber"]
