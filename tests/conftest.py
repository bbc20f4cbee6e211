"""Fixtures for tests inside Blender, and the cure for bpy's behaviour at exit.

Tests that need bpy, the native module or shared data skip with a reason where those are absent.
"""

import os
import shutil
import sys
import tempfile

import extension
import pytest

# Before bpy is imported anywhere: tests neither see nor change the user's own preferences.
_resources = os.environ.setdefault("BLENDER_USER_RESOURCES", tempfile.mkdtemp(prefix="skinwright-tests-"))


@pytest.fixture(scope="session")
def addon():
    """The add-on's package, enabled."""
    pytest.importorskip("bpy", reason="needs the bpy wheel")
    yield extension.enable()
    extension.disable()


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
