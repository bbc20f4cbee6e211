"""What the methods of the transfer cost against each other: CPU seconds, wall and peak memory, native module alone.

    python bench/method_speed.py [SIZES=5k,20k,100k,300k,1M] [--turns N]

The methods take turns in one process for each size; reading meshes and preparing arguments are not timed. Peak memory
is that of a process that runs one method once. Writes bench/method_speed.md.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests" / "support"))
import meshes

METHODS = ("paper", "confidence")
HEAD = """# The methods of the transfer against each other

Made by `python bench/method_speed.py` on the meshes of `make bench`, 60 bones: native module alone, medians of {turns}
turns (fewer from 300k on), {cores} cores, {system}; load before the run {load:.1f}.

| vertices | method | CPU s | of paper's | wall s | peak MB |
| ---: | :--- | ---: | ---: | ---: | ---: |
"""


def main() -> None:
    """Every size in processes of its own."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sizes", nargs="?", default="20k,100k,1M")
    parser.add_argument("--turns", type=int, default=9)
    parser.add_argument("--work", nargs="*", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        work(options.sizes, options.work, options.turns)
        return
    text = HEAD.format(turns=options.turns, cores=os.cpu_count(), system=platform.platform(), load=os.getloadavg()[0])
    for size in options.sizes.split(","):
        turns = options.turns if size in ("5k", "20k", "100k") else 3
        taken = child(size, METHODS, turns)
        peaks = {method: child(size, [method], 1)["peak"] for method in METHODS}
        for method in METHODS:
            cpu, wall = (statistics.median(taken[kind][method]) for kind in ("cpu", "wall"))
            pairs = zip(taken["cpu"][method], taken["cpu"]["paper"], strict=True)
            ratio = statistics.median(ours / paper for ours, paper in pairs)
            text += f"| {size} | {method} | {cpu:.3f} | {ratio:.2f} | {wall:.3f} | {peaks[method]:.0f} |\n"
    print(text)
    Path(__file__).with_suffix(".md").write_text(text, encoding="utf-8")


def child(size: str, methods: tuple[str, ...] | list[str], turns: int) -> dict:
    """What a process of its own has measured."""
    command = [sys.executable, __file__, size, "--turns", str(turns), "--work", *methods]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1200, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def work(size: str, methods: list[str], turns: int) -> None:
    """Lets the methods take turns and prints what each turn took; the first of several only warms up."""
    import scipy.sparse as sp
    import skinwright_native as native

    source, target = meshes.load("source"), meshes.load(size)
    rows = sp.csr_matrix(source.weights)
    arrays = (rows.indptr.astype(np.uint32), rows.indices.astype(np.uint32), rows.data.astype(np.float32))
    geometry = (source.positions, source.triangles)
    taken: dict[str, dict[str, list[float]]] = {kind: {method: [] for method in methods} for kind in ("cpu", "wall")}
    for turn in range(turns + (turns > 1)):
        for method in methods:
            weights = native.Weights(*arrays, rows.shape[1])
            wall, cpu = time.perf_counter(), time.process_time()
            settings: Any = {"method": method}
            native.transfer_weights(*geometry, weights, target.positions, target.triangles, **settings)
            if turn or turns == 1:
                taken["cpu"][method].append(time.process_time() - cpu)
                taken["wall"][method].append(time.perf_counter() - wall)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps(taken | {"peak": peak}))


if __name__ == "__main__":
    main()
