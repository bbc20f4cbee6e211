"""Runs a script in a real Blender window on a virtual screen and hands back what it recorded.

`SKINWRIGHT_BLENDER_TREES` lists trees made by `blender_scripts/make_blender_tree.sh` (colon between them, root needed);
`SKINWRIGHT_BLENDER` names the executable of an ordinary installation. Screenshots and logs land in `out/gui/`.
"""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = Path(__file__).parent / "in_blender"
OUT = ROOT / "out" / "gui"


@dataclass(frozen=True)
class Blender:
    """A Blender executable, in a tree of its own (`tree`) or in the machine's own file system."""

    name: str
    executable: str
    tree: Path | None = None

    def command(self, *arguments: str) -> list[str]:
        return ["chroot", str(self.tree), *arguments] if self.tree else list(arguments)

    def inside(self, path: Path) -> str:
        """The path as Blender sees it."""
        return "/" + str(path.relative_to(self.tree)) if self.tree else str(path)

    def run(
        self,
        script: str,
        *arguments: str,
        timeout: float = 150.0,
        size: tuple[int, int] = (1000, 700),
        real_mouse: bool = False,
        files: tuple[Path, ...] = (),
    ) -> dict:
        """Runs `in_blender/<script>.py` in a window and returns its record; fails the test with the log otherwise.

        `files` are put beside the script's folder, where it finds them as SHARE / name.

        Blender takes either simulated events or those of the virtual screen (`real_mouse`, in_blender/mouse.py).
        """
        parent = self.tree / "tmp" if self.tree else None
        with tempfile.TemporaryDirectory(prefix="skinwright-", dir=parent) as folder, self.screen(size) as display:
            share = Path(folder)
            lay_out(share)
            for file in files:
                shutil.copy(file, share)
            flags = ["--factory-startup", "--python-exit-code", "9"]
            if not real_mouse:
                flags.append("--enable-event-simulate")
            window = ["-p", "0", "0", str(size[0]), str(size[1])]
            start = ["-P", self.inside(share / "in_blender" / f"{script}.py"), "--", *arguments]
            done = subprocess.run(
                self.command(self.executable, *flags, *window, *start),
                env=self.environment(share, display),
                capture_output=True,
                text=True,
                timeout=timeout,
            )
            return self.collect(script, share, done)

    def environment(self, share: Path, display: str) -> dict[str, str]:
        home = (
            {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/tmp", "LANG": "C.UTF-8"}
            if self.tree
            else dict(os.environ)
        )
        return home | {
            "DISPLAY": display,
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "BLENDER_USER_RESOURCES": self.inside(share / "user"),
            "SKINWRIGHT_GUI_SHARE": self.inside(share),
        }

    @contextmanager
    def screen(self, size: tuple[int, int]) -> Iterator[str]:
        """A virtual screen of its own; it picks a free display number itself."""
        arguments = ["Xvfb", "-displayfd", "1", "-screen", "0", f"{size[0]}x{size[1]}x24", "-nolisten", "tcp", "-ac"]
        server = subprocess.Popen(
            self.command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        try:
            number = server.stdout.readline().strip()
            if not number:
                pytest.fail("the virtual screen did not start")
            yield f":{number}"
        finally:
            server.terminate()
            server.wait(timeout=10)

    def collect(self, script: str, share: Path, done: subprocess.CompletedProcess) -> dict:
        kept = OUT / self.name / script
        shutil.rmtree(kept, ignore_errors=True)
        shutil.copytree(share / "out", kept)
        log = done.stdout + done.stderr
        (kept / "log.txt").write_text(log)
        record = kept / "record.json"
        if done.returncode != 0 or not record.exists():
            pytest.fail(f"{self.name} {script}: exit code {done.returncode}\n{log[-4000:]}", pytrace=False)
        return json.loads(record.read_text())

    def log(self, script: str) -> str:
        """What Blender has written while it ran the script last."""
        return (OUT / self.name / script / "log.txt").read_text()


def lay_out(share: Path) -> None:
    """The add-on, the native module and the scripts, where this Blender can read them."""
    native = importlib.util.find_spec("skinwright_native")
    if native is None or native.origin is None:
        pytest.skip("skinwright_native is not installed for the Python that runs the tests")
    origin = Path(native.origin)
    (share / "out").mkdir()
    site = share / "site"
    if origin.name == "__init__.py":
        shutil.copytree(origin.parent, site / "skinwright_native")
    else:
        site.mkdir()
        shutil.copy(origin, site)
    ignored = shutil.ignore_patterns("__pycache__", "wheels")
    extension = share / "user" / "extensions" / "user_default" / "skinwright"
    shutil.copytree(ROOT / "addon" / "skinwright", extension, ignore=ignored)
    shutil.copytree(SCRIPTS, share / "in_blender", ignore=ignored)


def found() -> list[Blender]:
    trees = [Path(tree) for tree in os.environ.get("SKINWRIGHT_BLENDER_TREES", "").split(":") if tree]
    blenders = [Blender(tree.name, "/usr/bin/blender", tree.resolve()) for tree in trees]
    if executable := os.environ.get("SKINWRIGHT_BLENDER"):
        blenders.append(Blender("installed", executable))
    return blenders


@pytest.fixture(scope="session", params=found() or [None], ids=lambda b: b.name if b else "none")
def blender(request: pytest.FixtureRequest) -> Blender:
    if request.param is None:
        pytest.skip("no Blender with a window: set SKINWRIGHT_BLENDER_TREES or SKINWRIGHT_BLENDER (CONTRIBUTING)")
    if request.param.tree is None and shutil.which("Xvfb") is None:
        pytest.skip("Xvfb is not installed")
    return request.param
