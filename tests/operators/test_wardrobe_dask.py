"""A wardrobe on two Dask workers, one of which is killed in the middle of a job: the same bytes as without Dask."""

import os
import subprocess
import sys
from pathlib import Path

import builders
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
pytest.importorskip("distributed", reason="needs distributed")
pytestmark = [
    pytest.mark.usefixtures("native"),
    pytest.mark.skipif(not hasattr(os, "fork"), reason="kills a worker as POSIX does"),
]
ROOT = Path(__file__).resolve().parents[2]
GARMENTS = ("belt", "coat", "scarf", "shoe")
# The first job to get here takes its worker with it; all others are what they would be.
COMMAND = """
import os, signal, sys
from pathlib import Path
marker = Path({marker!r})
try:
    marker.touch(exist_ok=False)
except FileExistsError:
    os.execv(sys.executable, [sys.executable, {script!r}, *sys.argv[1:]])
os.kill(os.getppid(), signal.SIGKILL)
"""


@pytest.fixture(scope="module")
def folder(addon, tmp_path_factory):
    """A body and four garments."""
    found = tmp_path_factory.mktemp("wardrobe")
    made = {"bodies/body": builders.body}
    made |= {
        f"garments/{name}": lambda number=number: builders.grid("Garment", 6 + number, size=1.5, z=0.02)
        for number, name in enumerate(GARMENTS)
    }
    for name, build in made.items():
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        build()
        path = found / f"{name}.blend"
        path.parent.mkdir(exist_ok=True)
        bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    return found


def weights(out):
    return {path.name: path.read_bytes() for path in sorted(out.glob("*.npz"))}


def test_a_killed_worker_loses_nothing(addon, folder, tmp_path):
    serial, shared, marker = tmp_path / "serial", tmp_path / "shared", tmp_path / "killed"
    assert addon.headless.command_line.wardrobe([str(folder), "--out", str(serial)]) == 0
    wrapper = tmp_path / "job.py"
    script = str(ROOT / "blender_scripts" / "wardrobe.py")
    wrapper.write_text(COMMAND.format(marker=str(marker), script=script), encoding="utf-8")
    command = [sys.executable, str(ROOT / "examples" / "wardrobe_dask.py"), str(folder), "--out", str(shared)]
    command += ["--workers", "2", "--at-once", "2", "--command", f"'{sys.executable}' '{wrapper}'"]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", errors="replace", timeout=600, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert marker.exists(), "no worker was killed"
    assert f"{len(GARMENTS)} of {len(GARMENTS)} jobs have a result" in done.stdout
    assert weights(shared) == weights(serial)
    assert len(weights(serial)) == len(GARMENTS)
