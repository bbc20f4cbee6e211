"""Measures Skinwright and its peers side by side and writes bench/results.md and bench/results.png.

    make bench [SIZES=5k,20k,100k,300k,1M]

Every measurement runs in a process of its own; ours and the peers' alternate, and medians are kept. Before any figure
is written the answers are compared: where they differ there is no result.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests" / "support"))
import meshes
import results

HERE = Path(__file__).resolve().parent
ANSWERS = meshes.CACHE / "answers"
TIME_LIMIT = 1200  # seconds for one process


@dataclass(frozen=True)
class Plan:
    """How often a size is measured: processes of each method, and calls within one process."""

    rounds: int
    calls: int


PLANS = {"5k": Plan(3, 5), "20k": Plan(3, 3), "100k": Plan(3, 1), "300k": Plan(3, 1), "1M": Plan(3, 1)}
METHODS = [
    "skinwright",
    "libigl",
    "skinwright smoothed",
    "libigl smoothed",
    "skinwright one component",
    "cholmod amd",
    "cholmod metis",
    "superlu",
    "skinwright closest points",
    "libigl closest points",
    "blender add-on",
    "blender data transfer",
]
LARGEST = {"superlu": "100k"}  # beyond, it takes minutes and gigabytes without telling more
ONCE = ("libigl", "libigl smoothed", "cholmod amd", "cholmod metis")  # at a million vertices, where one takes minutes
SAME_ANSWER = [
    ("skinwright", "libigl"),
    ("skinwright smoothed", "libigl smoothed"),
    ("skinwright one component", "cholmod amd"),
    ("skinwright one component", "cholmod metis"),
    ("skinwright one component", "superlu"),
]
OPERATOR_SIZES = ("20k", "100k", "300k")
TOLERANCE = {"1M": 5e-6}
DEFAULT_TOLERANCE = 1e-6


def main() -> None:
    """All sizes that were asked for, smallest first."""
    parser = argparse.ArgumentParser(description="Measure Skinwright and its peers.")
    parser.add_argument("--sizes", default=",".join(meshes.SIZES), help="of 5k,20k,100k,300k,1M")
    parser.add_argument("--blenders", nargs="*", default=[], help="Pythons with bpy, for the operator's time")
    arguments = parser.parse_args()
    asked = arguments.sizes.split(",")
    unknown = [size for size in asked if size not in meshes.SIZES]
    if unknown:
        parser.error(f"there is no size {unknown[0]}; there are {', '.join(meshes.SIZES)}")
    ANSWERS.mkdir(parents=True, exist_ok=True)
    load = os.getloadavg()[0]
    figures = {size: measure_size(size) for size in meshes.SIZES if size in asked}
    operators = [line for python in arguments.blenders for line in measure_operator(python, asked)]
    results.write(figures, PLANS, operators, HERE, load)
    print(f"{HERE / 'results.md'}\n{HERE / 'results.png'}")


def measure_size(size: str) -> dict[str, dict]:
    """Medians of every method on one size, and the largest differences between the answers."""
    meshes.load("source"), meshes.load(size)
    methods = [name for name in METHODS if _fits(name, size)]
    measured: dict[str, list[dict]] = {name: [] for name in methods}
    for number in range(PLANS[size].rounds):
        for name in methods:
            if number and size == "1M" and name in ONCE:
                continue
            measured[name].append(measure(name, size))
            print(f"{size:>5}  {name:26} {measured[name][-1]['wall']:9.3f} s", flush=True)
    for ours, peer in SAME_ANSWER:
        if peer in measured:
            measured[peer][0]["difference"] = check_equal(ours, peer, size)
    return {name: median(entries) for name, entries in measured.items()}


def measure(name: str, size: str) -> dict:
    """One process of bench/measure.py."""
    answer = ANSWERS / _answer_name(name, size)
    command = [sys.executable, str(HERE / "measure.py"), name, size]
    command += ["--repeat", str(PLANS[size].calls), "--answer", str(answer)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIME_LIMIT, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{name} failed on {size}:\n{done.stdout}{done.stderr}")
    return json.loads(done.stdout.splitlines()[-1])


def measure_operator(python: str, sizes: list[str]) -> list[str]:
    """A table of the operator in the Blender of this Python, for the sizes that an artist would wait for."""
    command = [python, str(HERE / "operator_wall.py"), *(size for size in sizes if size in OPERATOR_SIZES)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIME_LIMIT, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{command} failed:\n{done.stdout}{done.stderr}")
    # Blender's own messages stand between them.
    return [line for line in done.stdout.splitlines() if line.startswith("|")] + [""]


def median(entries: list[dict]) -> dict:
    """Entry by entry; the difference was taken once."""
    combined = {key: statistics.median(entry[key] for entry in entries) for key in ("wall", "cpu", "peak_mb")}
    stages = {stage: statistics.median(entry["stages"][stage] for entry in entries) for stage in entries[0]["stages"]}
    return combined | {"stages": stages, "difference": entries[0].get("difference")}


def check_equal(ours: str, peer: str, size: str) -> float:
    """Largest difference of a weight; ends the run where masks or weights differ more than rounding explains."""
    first, second = (np.load(ANSWERS / _answer_name(name, size)) for name in (ours, peer))
    if "matched" in second and (first["matched"] != second["matched"]).any():
        raise SystemExit(f"{ours} and {peer} match different vertices on {size}: the times mean nothing.")
    difference = float(abs(_rows(first) - _rows(second)).max())
    if difference > TOLERANCE.get(size, DEFAULT_TOLERANCE):
        raise SystemExit(f"{ours} and {peer} differ by {difference:.1e} on {size}: the times mean nothing.")
    return difference


def _rows(answer: Mapping[str, np.ndarray]) -> sp.csr_matrix:
    indptr = answer["indptr"]
    return sp.csr_matrix((answer["values"], answer["bones"], indptr), shape=(len(indptr) - 1, 60), dtype=np.float64)


def _answer_name(name: str, size: str) -> str:
    return f"{name.replace(' ', '_')}-{size}.npz"


def _fits(name: str, size: str) -> bool:
    sizes = list(meshes.SIZES)
    return name not in LARGEST or sizes.index(size) <= sizes.index(LARGEST[name])


if __name__ == "__main__":
    main()
