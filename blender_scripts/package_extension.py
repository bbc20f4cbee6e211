"""Packs the add-on and its native module into the zip that Blender installs: dist/skinwright-VERSION.zip.

Runs in the venv of the Makefile. The wheel is linked against glibc 2.28 through zig where the `ziglang` package is
there, so that it loads on any Linux that Blender itself supports; without it the zip works only on systems as new as
this one. Blender's own extension tool, which lies inside the bpy wheel, validates and builds: no executable is needed.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ADDON = ROOT / "addon" / "skinwright"
DIST = ROOT / "dist"
BINARIES = Path(sys.executable).parent


def main() -> None:
    """Wheel, staged folder, manifest, validation, zip."""
    DIST.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=DIST) as folder:
        staged = Path(folder) / "skinwright"
        shutil.copytree(ADDON, staged, ignore=shutil.ignore_patterns("__pycache__", "*.pyc", "*.so"))
        wheel = build_wheel(staged / "wheels")
        manifest = staged / "blender_manifest.toml"
        manifest.write_text(with_wheel(manifest.read_text(), wheel.name))
        run_blender_extension("validate", str(staged))
        run_blender_extension("build", "--source-dir", str(staged), "--output-dir", str(DIST))
    print("Blender keeps an installed native module until the version in Cargo.toml and blender_manifest.toml changes.")


def build_wheel(folder: Path) -> Path:
    """The abi3 wheel, for the oldest glibc that can be had here."""
    portable = ["--zig", "--compatibility", "manylinux_2_28"]
    if importlib.util.find_spec("ziglang") is None:
        print("ziglang is not installed: the zip will run only on systems with a glibc as new as this one's.")
        portable = []
    search = {"PATH": f"{BINARIES}{os.pathsep}{os.environ['PATH']}"}
    command = ["maturin", "build", "--quiet", "--release", *portable, "--out", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, env=os.environ | search)
    (wheel,) = folder.glob("*.whl")
    return wheel


def with_wheel(manifest: str, wheel: str) -> str:
    """The manifest with the keys that depend on the build, before its first table."""
    keys = f'platforms = ["linux-x64"]\nwheels = ["./wheels/{wheel}"]\n\n'
    head, table, rest = manifest.partition("[permissions]")
    return head + keys + table + rest


def run_blender_extension(*arguments: str) -> None:
    """Run the command-line tool that Blender ships for extensions."""
    bpy = importlib.util.find_spec("bpy")
    if bpy is None or bpy.origin is None:
        raise SystemExit("The bpy module is not installed here: run make extension.")
    (tool,) = Path(bpy.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    subprocess.run([sys.executable, str(tool), *arguments], check=True)


if __name__ == "__main__":
    main()
