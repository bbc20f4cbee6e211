"""Fixtures for tests inside Blender, and the cure for bpy's behaviour at exit.

Tests that need bpy, the native module or shared data skip with a reason where those are absent.
"""

import importlib
import os
import shutil
import sys
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = "bl_ext.user_default.skinwright"

# Before bpy is imported anywhere: tests neither see nor change the user's own preferences.
_resources = os.environ.setdefault("BLENDER_USER_RESOURCES", tempfile.mkdtemp(prefix="skinwright-tests-"))


def enable() -> object:
    """Enable the add-on as a user would: from the folder of an extension repository. Gives its package."""
    import addon_utils
    import bpy

    repos = bpy.context.preferences.extensions.repos
    folder = Path(next(repo.directory for repo in repos if repo.module == "user_default")) / "skinwright"
    folder.parent.mkdir(parents=True, exist_ok=True)
    if not folder.exists():
        folder.symlink_to(ROOT / "addon" / "skinwright", target_is_directory=True)
    addon_utils.enable(PACKAGE, default_set=True)
    return importlib.import_module(PACKAGE)


def disable() -> None:
    """Disable it, as the tick box in the preferences does."""
    import addon_utils

    addon_utils.disable(PACKAGE, default_set=True)


@pytest.fixture(scope="session")
def addon():
    """The add-on's package, enabled."""
    pytest.importorskip("bpy", reason="needs the bpy wheel")
    yield enable()
    disable()


@pytest.fixture
def scene(addon):
    """An empty file, with the add-on enabled; gives the scene."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return bpy.context.scene


@pytest.fixture(scope="session")
def native():
    """The native module."""
    return pytest.importorskip("skinwright_native", reason="needs the native module: build it with maturin")


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session, exitstatus):
    """Keep the exit status for pytest_unconfigure."""
    session.config._exit_status = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    """Leave at once: once a class was registered, bpy 4.2 crashes and bpy 4.5 hangs in Python's ordinary exit."""
    if _resources.startswith(tempfile.gettempdir()):
        shutil.rmtree(_resources, ignore_errors=True)
    if "bpy" in sys.modules:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(getattr(config, "_exit_status", 1))
