"""Builds the native module for each platform into dist/wheels: `build_wheels.py [PLATFORM ...]`, all without one.

A standard library for a foreign target comes from rustup where it has the target, or is compiled from source in a tree
made by make_rust_tree.sh (`SKINWRIGHT_RUST_TREE`, root needed). A platform for which there is neither is skipped with
a sentence; the exit code is 1 only if a platform that was named could not be built.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

from platforms import PLATFORMS, Platform

ROOT = Path(__file__).resolve().parent.parent
WHEELS = ROOT / "dist" / "wheels"
BINARIES = Path(sys.executable).parent
# The standard library is compiled with the module; the flag is unstable, hence the variable.
FROM_SOURCE = ("-Zbuild-std=std,panic_unwind",)


def main(names: list[str]) -> int:
    """Build each platform's wheel; returns the exit code."""
    unknown = [name for name in names if name not in PLATFORMS]
    if unknown:
        print(f"{', '.join(unknown)} is not a platform: choose from {', '.join(PLATFORMS)}", file=sys.stderr)
        return 2
    WHEELS.mkdir(parents=True, exist_ok=True)
    missing = {}
    for platform in [PLATFORMS[name] for name in names or PLATFORMS]:
        reason = build(platform)
        if reason:
            missing[platform.name] = reason
    for name, reason in missing.items():
        print(f"{name}: not built. {reason}", file=sys.stderr)
    return 1 if set(names) & set(missing) else 0


def build(platform: Platform) -> str:
    """Build one wheel; returns why it could not be, or nothing."""
    tree = Path(os.environ.get("SKINWRIGHT_RUST_TREE", ROOT / "out" / "rust-tree"))
    if platform.target in installed_targets():
        if importlib.util.find_spec("ziglang") is None:
            return "The linker is missing: run pip install ziglang."
        command, environment = maturin(platform, WHEELS), os.environ | platform.environment
        environment["PATH"] = f"{BINARIES}{os.pathsep}{environment['PATH']}"
        done = subprocess.run(command, cwd=ROOT, env=environment, check=False)
    elif (tree / "venv").is_dir() and hasattr(os, "geteuid") and os.geteuid() == 0:
        done = subprocess.run(in_tree(tree, platform), cwd=ROOT, check=False)
    else:
        return (
            f"Rust's standard library for {platform.target} is missing: run rustup target add {platform.target}, "
            "or as root blender_scripts/make_rust_tree.sh TREE and set SKINWRIGHT_RUST_TREE"
        )
    if done.returncode:
        return f"The build ended with code {done.returncode}: see the messages above."
    print(f"{platform.name}: {newest(platform).name}")
    return ""


def newest(platform: Platform) -> Path:
    """The wheel of a platform that was built last."""
    return max(WHEELS.glob(f"*{platform.tag}.whl"), key=lambda wheel: wheel.stat().st_mtime)


def installed_targets() -> set[str]:
    """The targets that the Rust on PATH has a standard library for."""
    libraries = Path(subprocess.check_output(["rustc", "--print", "sysroot"], text=True).strip()) / "lib" / "rustlib"
    return {folder.name for folder in libraries.iterdir() if (folder / "lib").is_dir()}


def maturin(platform: Platform, out: Path, *more: str) -> list[str]:
    """The command that builds one platform's wheel."""
    return ["maturin", "build", "--release", "--target", platform.target, *platform.options, *more, "--out", str(out)]


def in_tree(tree: Path, platform: Platform) -> list[str]:
    """The same inside a tree; what is mounted there goes with the command."""
    target = os.environ.get("CARGO_TARGET_DIR", str(ROOT / "target" / "foreign"))
    Path(target).mkdir(parents=True, exist_ok=True)
    variables = platform.environment | {
        "PATH": "/venv/bin:/usr/sbin:/usr/bin:/sbin:/bin",
        "HOME": "/root",
        "RUSTC_BOOTSTRAP": "1",
        "CARGO_TARGET_DIR": "/target",
        "SOURCE_DATE_EPOCH": os.environ.get("SOURCE_DATE_EPOCH", "315532800"),
    }
    for folder in ("checkout", "target"):
        (tree / folder).mkdir(exist_ok=True)
    inside = " ".join(maturin(platform, Path("/checkout/dist/wheels"), *FROM_SOURCE))
    assignments = " ".join(f"{name}={value}" for name, value in variables.items())
    script = (
        f"mount --bind '{ROOT}' '{tree}/checkout' && mount --bind '{target}' '{tree}/target' && "
        f"mount --bind /proc '{tree}/proc' && mount --bind /dev '{tree}/dev' && "
        f"exec chroot '{tree}' /usr/bin/env -i {assignments} sh -c 'cd /checkout && exec {inside}'"
    )
    return [shutil.which("unshare") or "unshare", "--mount", "sh", "-c", script]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
