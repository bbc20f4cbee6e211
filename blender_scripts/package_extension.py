"""Packs the add-on and its native modules into the zips that Blender installs: dist/skinwright-VERSION-PLATFORM.zip.

Takes the newest wheel of each platform from dist/wheels, where `make wheels` puts them; a platform without a wheel gets
no zip. Blender's own extension tool, which lies inside the bpy wheel, validates and builds: no executable is needed.
Beside the zips stand the bill of materials of the native module and the SHA-256 sums of all. The same add-on and wheels
make the same zips: files in them have the date of the last commit.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import sbom
from build_wheels import source_date
from platforms import PLATFORMS, of_wheel

ROOT = Path(__file__).resolve().parent.parent
ADDON = ROOT / "addon" / "skinwright"
DIST = ROOT / "dist"


def main() -> None:
    """Staged folder, manifest, validation, one zip per platform."""
    wheels = newest_wheels(DIST / "wheels")
    if not wheels:
        raise SystemExit("There is no wheel in dist/wheels: run make wheels first.")
    with tempfile.TemporaryDirectory(dir=DIST) as folder:
        staged = Path(folder) / "skinwright"
        shutil.copytree(ADDON, staged, ignore=shutil.ignore_patterns("__pycache__", "*.pyc", "*.so", "*.pyd"))
        (staged / "wheels").mkdir()
        for wheel in wheels:
            shutil.copy2(wheel, staged / "wheels")
        manifest = staged / "blender_manifest.toml"
        text = manifest.read_text(encoding="utf-8")
        manifest.write_text(with_wheels(text, [wheel.name for wheel in wheels]), encoding="utf-8")
        for path in staged.rglob("*"):
            os.utime(path, (int(source_date()), int(source_date())))
        run_blender_extension("validate", str(staged))
        run_blender_extension("build", "--split-platforms", "--source-dir", str(staged), "--output-dir", str(DIST))
    version = wheels[0].name.split("-")[1]
    sbom.main(DIST / f"skinwright-{version}.cdx.json")
    write_sums([*sorted(DIST.glob(f"skinwright-{version}*.*")), *wheels])
    for name in PLATFORMS.keys() - {of_wheel(wheel.name).name for wheel in wheels}:
        print(f"{name}: no zip, as dist/wheels has no wheel for it")
    print("Blender keeps an installed native module until the version in Cargo.toml and blender_manifest.toml changes.")


def newest_wheels(folder: Path) -> list[Path]:
    """The newest wheel of each platform, in the order of the table."""
    found = {}
    for wheel in sorted(folder.glob("*.whl"), key=lambda wheel: wheel.stat().st_mtime):
        found[of_wheel(wheel.name).name] = wheel
    return [found[name] for name in PLATFORMS if name in found]


def with_wheels(manifest: str, wheels: list[str]) -> str:
    """The manifest with the keys that depend on the build, before its first table."""
    platforms = ", ".join(f'"{of_wheel(wheel).name}"' for wheel in wheels)
    files = ", ".join(f'"./wheels/{wheel}"' for wheel in wheels)
    head, table, rest = manifest.partition("[permissions]")
    return f"{head}platforms = [{platforms}]\nwheels = [{files}]\n\n{table}{rest}"


def write_sums(files: list[Path]) -> None:
    """SHA256SUMS, as `sha256sum --check` reads it in the folder."""
    lines = [f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.relative_to(DIST)}\n" for file in files]
    (DIST / "SHA256SUMS").write_text("".join(lines), encoding="utf-8")


def run_blender_extension(*arguments: str) -> None:
    """Run the command-line tool that Blender ships for extensions."""
    bpy = importlib.util.find_spec("bpy")
    if bpy is None or bpy.origin is None:
        raise SystemExit("The bpy module is not installed here: run make extension.")
    (tool,) = Path(bpy.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    # Zip files have no time zone.
    subprocess.run([sys.executable, str(tool), *arguments], env=os.environ | {"TZ": "UTC"}, check=True)


if __name__ == "__main__":
    main()
