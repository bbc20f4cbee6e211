"""Runs one method on one size in a process of its own and prints what it took, as one line of JSON.

    python bench/measure.py METHOD SIZE [--repeat N] [--answer FILE]

Reading the meshes, importing and preparing the arguments are not timed; peak memory is that of the whole process.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests" / "support"))
import meshes

Answer = dict[str, Any]  # weights: rows (V, 60), dense or CSR; matched: mask; seconds: of the native call, by stage
Run = Callable[[], Answer]


def ours(size: str, smoothing_passes: int) -> Run:
    """Arrays in, arrays out, all threads."""
    import skinwright_native as native

    source, target = meshes.load("source"), meshes.load(size)
    rows = _csr(source.weights)

    def run() -> Answer:
        weights = native.Weights(*rows, 60)
        result = native.transfer_weights(
            source.positions,
            source.triangles,
            weights,
            target.positions,
            target.triangles,
            smoothing_iterations=smoothing_passes,
        )
        return _native_answer(result)

    return run


def ours_one_component(size: str) -> Run:
    """All interior vertices in one system, 60 active bones: the mesh is its own source, only its boundary matches."""
    import skinwright_native as native
    from peers import one_component

    target = meshes.load(size)
    n = len(target.positions)
    interior = one_component(target, 0)[2]
    mask = np.full(n, 2, np.uint8)
    mask[interior] = 0
    bones = (np.arange(n) % 60).astype(np.uint32)
    weights = native.Weights(np.arange(n + 1, dtype=np.uint32), bones, np.ones(n, np.float32), 60)
    geometry = (target.positions, target.triangles)

    def run() -> Answer:
        answer = _native_answer(native.transfer_weights(*geometry, weights, *geometry, mask=mask))
        return {"weights": answer["weights"][interior], "seconds": answer["seconds"]}

    return run


def ours_closest_points(size: str) -> Run:
    """The hierarchy built and queried; preparing the body finds its normals as well, which the peer spares itself."""
    import skinwright_native as native

    source, target = meshes.load("source"), meshes.load(size)
    weights = native.Weights(*_csr(source.weights), 60)

    def run() -> Answer:
        native.Source(source.positions, source.triangles, weights).closest_points(target.positions)
        return {}

    return run


def libigl(size: str, smoothing_passes: int) -> Run:
    """The pipeline of the paper's authors."""
    from peers import transfer

    source, target = meshes.load("source"), meshes.load(size)

    def run() -> Answer:
        weights, matched = transfer(source, target, smoothing_passes)
        return {"weights": weights, "matched": matched}

    return run


def libigl_closest_points(size: str) -> Run:
    """libigl's AABB tree, built and queried."""
    from peers import closest_points

    source, target = meshes.load("source"), meshes.load(size)

    def run() -> Answer:
        closest_points(source, target)
        return {}

    return run


def solver(size: str, name: str, *options: str) -> Run:
    """A peer's order + factor + solve of the one-component system."""
    import peers

    target = meshes.load(size)
    matrix, right, _ = peers.one_component(target, peers.RELATIVE_SMOOTHNESS * peers.diagonal(target))

    def run() -> Answer:
        return {"weights": peers.normalised(getattr(peers, name)(matrix, right, *options))}

    return run


def blender(size: str, name: str) -> Run:
    """Inside Blender: our add-on, or Blender's own Data Transfer."""
    import in_blender

    return getattr(in_blender, name)(meshes.load("source"), meshes.load(size))


METHODS: dict[str, Callable[[str], Run]] = {
    "skinwright": lambda size: ours(size, 0),
    "skinwright smoothed": lambda size: ours(size, 10),
    "skinwright one component": ours_one_component,
    "skinwright closest points": ours_closest_points,
    "libigl": lambda size: libigl(size, 0),
    "libigl smoothed": lambda size: libigl(size, 10),
    "libigl closest points": libigl_closest_points,
    "cholmod amd": lambda size: solver(size, "cholmod", "amd"),
    "cholmod metis": lambda size: solver(size, "cholmod", "metis"),
    "superlu": lambda size: solver(size, "superlu"),
    "blender add-on": lambda size: blender(size, "add_on"),
    "blender data transfer": lambda size: blender(size, "data_transfer"),
}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("method", choices=METHODS)
    parser.add_argument("size", choices=meshes.SIZES)
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--answer", type=Path)
    arguments = parser.parse_args()
    run = METHODS[arguments.method](arguments.size)
    walls, cpus, stages = [], [], []
    for _ in range(arguments.repeat):
        wall, cpu = time.perf_counter(), time.process_time()
        answer = run()
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
        stages.append(answer.pop("seconds", {}))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    if arguments.answer:
        _save(arguments.answer, answer)
    seconds = {stage: statistics.median(entry[stage] for entry in stages) for stage in stages[0]}
    figures = {"wall": statistics.median(walls), "cpu": statistics.median(cpus), "peak_mb": peak, "stages": seconds}
    print(json.dumps(figures), flush=True)
    os._exit(0)  # bpy 4.5 may hang for ever in its destructors


def _csr(dense: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rows = sp.csr_matrix(dense)
    return rows.indptr.astype(np.uint32), rows.indices.astype(np.uint32), rows.data.astype(np.float32)


def _native_answer(result: Any) -> Answer:
    weights = result.weights
    arrays = (weights.values, weights.bones, weights.indptr)
    rows = sp.csr_matrix(arrays, shape=(len(result.matched), weights.n_bones))
    return {"weights": rows, "matched": result.matched, "seconds": result.report["seconds"]}


def _save(path: Path, answer: Answer) -> None:
    if "weights" in answer:
        rows = sp.csr_matrix(answer.pop("weights"))
        np.savez(path, values=rows.data, bones=rows.indices, indptr=rows.indptr, **answer)


if __name__ == "__main__":
    main()
