"""The zip in the hands of a user: install, use, disable, update over an older version, uninstall, in clean folders.

Each step is a Blender of its own, as an update asks for a restart. The zips are those of dist/ (`make extension`) or of
`SKINWRIGHT_ZIPS`.
"""

import json
import os
import platform
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytest.importorskip("bpy", reason="needs the bpy wheel")
ROOT = Path(__file__).resolve().parent.parent
SYSTEM = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}[platform.system()]
MACHINE = "arm64" if platform.machine().lower() in ("arm64", "aarch64") else "x64"
ZIPS = sorted(Path(os.environ.get("SKINWRIGHT_ZIPS", ROOT / "dist")).glob(f"skinwright-*-{SYSTEM}_{MACHINE}.zip"))
OLD = "0.0.9"


@pytest.fixture(scope="module")
def package():
    if not ZIPS:
        pytest.skip("there is no zip for this system: run make extension")
    return max(ZIPS, key=lambda path: path.stat().st_mtime)


@pytest.fixture(scope="module")
def version(package):
    return package.name.split("-")[1]


@pytest.fixture(scope="module")
def older(package, version, tmp_path_factory):
    """The same extension as it would have been under an older version, wheel and all."""
    old = tmp_path_factory.mktemp("older") / package.name.replace(version, OLD)
    with zipfile.ZipFile(package) as new, zipfile.ZipFile(old, "w") as made:
        for name in new.namelist():
            content = new.read(name)
            if name.endswith(".whl"):
                wheel = old.with_name(Path(name).name)
                wheel.write_bytes(content)
                content = older_wheel(wheel, version).read_bytes()
            elif name.endswith("blender_manifest.toml"):
                content = content.replace(version.encode(), OLD.encode())
            made.writestr(name.replace(version, OLD), content)
    return old


def older_wheel(wheel, version):
    old = wheel.with_name(wheel.name.replace(version, OLD))
    with zipfile.ZipFile(wheel) as new, zipfile.ZipFile(old, "w") as made:
        for name in new.namelist():
            content = new.read(name)
            if ".dist-info/" in name:
                content = content.replace(version.encode(), OLD.encode())
            made.writestr(name.replace(version, OLD), content)
        made.writestr("skinwright_native/only_in_the_old_one.py", "")
    return old


@pytest.fixture
def user(tmp_path):
    """A user's folder without anything in it."""
    return tmp_path / "user"


def step(user, name, path=""):
    """One step in a process of its own; returns what it printed last."""
    environment = os.environ | {"BLENDER_USER_RESOURCES": str(user)}
    command = [sys.executable, str(ROOT / "tests" / "support" / "installing.py"), name, str(path)]
    done = subprocess.run(
        command, env=environment, capture_output=True, encoding="utf-8", errors="replace", timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout.strip().splitlines()[-1])


def files(user):
    """What lies in the user's folder, but for Blender's own lists and caches."""
    names = [str(path.relative_to(user)).replace(os.sep, "/") for path in user.rglob("*") if path.is_file()]
    return [name for name in names if "skinwright" in name or "/.local/" in name]


def test_install_use_disable_uninstall(user, package, version):
    assert step(user, "install", package)["version"] == version
    used = step(user, "transfer")
    assert used["result"] == ["FINISHED"] and used["native"] == version
    assert Path(used["module"]).is_relative_to(user)
    disabled = step(user, "disable")
    assert disabled == {"registered": [], "scene": False, "version": version}
    assert step(user, "transfer")["bits"] == used["bits"]
    assert step(user, "uninstall") == {"registered": [], "scene": False, "version": None}
    assert files(user) == []


def test_update_over_an_older_version(user, older, package, version):
    assert step(user, "install", older)["version"] == OLD
    assert any("only_in_the_old_one" in name for name in files(user))
    assert step(user, "install", package)["version"] == version
    assert step(user, "transfer")["native"] == version
    left = [name for name in files(user) if OLD in name or "only_in_the_old_one" in name]
    assert left == []
    step(user, "uninstall")
    assert files(user) == []
