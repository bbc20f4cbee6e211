"""Builds the native module for each platform into dist/wheels: `build_wheels.py [PLATFORM ...]`, all without one.

A standard library for a foreign target comes from rustup where it has the target, or is compiled from source in a tree
made by make_rust_tree.sh (`SKINWRIGHT_RUST_TREE`, root needed). A platform for which there is neither is skipped with
a sentence; the exit code is 1 only if a platform that was named could not be built.

The same sources, compiler and packages make the same bytes in any folder and at any hour: no path of this machine stays
in the module, and SOURCE_DATE_EPOCH is what git says of the last commit, unless it is set.
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
    before = cpu_seconds()
    if platform.target in installed_targets():
        if importlib.util.find_spec("ziglang") is None:
            return "The linker is missing: run pip install ziglang."
        done = subprocess.run(maturin(platform, WHEELS), cwd=ROOT, env=here(platform), check=False)
    elif (tree / "venv").is_dir() and hasattr(os, "geteuid") and os.geteuid() == 0:
        done = subprocess.run(in_tree(tree, platform), cwd=ROOT, check=False)
    else:
        return (
            f"Rust's standard library for {platform.target} is missing: run rustup target add {platform.target}, "
            "or as root blender_scripts/make_rust_tree.sh TREE and set SKINWRIGHT_RUST_TREE"
        )
    if done.returncode:
        return f"The build ended with code {done.returncode}: see the messages above."
    wheel = newest(platform)
    print(
        f"{platform.name}: {wheel.name}, {wheel.stat().st_size / 1e6:.2f} MB, {cpu_seconds() - before:.0f} CPU seconds"
    )
    return ""


def cpu_seconds() -> float:
    """What all ended children of this process used."""
    times = os.times()
    return times.children_user + times.children_system


def newest(platform: Platform) -> Path:
    """The wheel of a platform that was built last."""
    return max(WHEELS.glob(f"*{platform.tag}.whl"), key=lambda wheel: wheel.stat().st_mtime)


def installed_targets() -> set[str]:
    """The targets that the Rust on PATH has a standard library for."""
    libraries = (
        Path(subprocess.check_output(["rustc", "--print", "sysroot"], encoding="utf-8").strip()) / "lib" / "rustlib"
    )
    return {folder.name for folder in libraries.iterdir() if (folder / "lib").is_dir()}


def maturin(platform: Platform, out: Path, *more: str) -> list[str]:
    """The command that builds one platform's wheel."""
    return ["maturin", "build", "--release", "--target", platform.target, *platform.options, *more, "--out", str(out)]


def here(platform: Platform) -> dict[str, str]:
    """The variables of a build by the Rust on PATH."""
    home = os.environ.get("CARGO_HOME", str(Path.home() / ".cargo"))
    target = os.environ.get("CARGO_TARGET_DIR", str(ROOT / "target"))
    more = {"PATH": f"{BINARIES}{os.pathsep}{os.environ['PATH']}", "CARGO_TARGET_DIR": target}
    return os.environ | platform.environment | more | reproducible(home, target, str(ROOT))


def reproducible(home: str, target: str, root: str) -> dict[str, str]:
    """Variables that keep folders and the hour out of what is built; the longest folder has to come last."""
    names = {home: "/cargo", root: "/skinwright", target: "/target"}
    flags = "\x1f".join(f"--remap-path-prefix={folder}={names[folder]}" for folder in sorted(names, key=len))
    return {"CARGO_ENCODED_RUSTFLAGS": flags, "SOURCE_DATE_EPOCH": source_date()}


def source_date() -> str:
    """Seconds since 1970 of the last commit; of 1980, as in zip files without a date, where there is no git."""
    command = ["git", "-C", str(ROOT), "log", "-1", "--format=%ct"]
    git = shutil.which("git")
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False) if git else None
    return os.environ.get("SOURCE_DATE_EPOCH") or (done.stdout.strip() if done else "") or "315532800"


def in_tree(tree: Path, platform: Platform) -> list[str]:
    """The same inside a tree; what is mounted there goes with the command."""
    target = os.environ.get("CARGO_TARGET_DIR", str(ROOT / "target" / "foreign"))
    Path(target).mkdir(parents=True, exist_ok=True)
    variables = platform.environment | {
        "PATH": "/venv/bin:/usr/sbin:/usr/bin:/sbin:/bin",
        "HOME": "/root",
        "RUSTC_BOOTSTRAP": "1",
        "CARGO_TARGET_DIR": "/target",
    }
    variables |= reproducible("/root/.cargo", "/target", "/checkout")
    for folder in ("checkout", "target"):
        (tree / folder).mkdir(exist_ok=True)
    inside = " ".join(maturin(platform, Path("/checkout/dist/wheels"), *FROM_SOURCE))
    assignments = " ".join(f"{name}='{value}'" for name, value in variables.items())
    script = (
        f"mount --bind '{ROOT}' '{tree}/checkout' && mount --bind '{target}' '{tree}/target' && "
        f"mount --bind /proc '{tree}/proc' && mount --bind /dev '{tree}/dev' && "
        f"exec chroot '{tree}' /usr/bin/env -i {assignments} sh -c 'cd /checkout && exec {inside}'"
    )
    return [shutil.which("unshare") or "unshare", "--mount", "sh", "-c", script]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
