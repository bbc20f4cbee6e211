"""Random calls of the native module: sound answers, or errors of the classes it documents; no panic, no crash.

python tests/fuzz/native.py [--seconds 60] [--cases N] [--first SEED]
"""

import sys
from pathlib import Path

import numpy as np
import skinwright_native as native

sys.path.insert(0, str(Path(__file__).resolve().parent))
import characters
from characters import junk
from findings import NEVER, Run

ALLOWED = (native.SkinwrightError, TypeError, MemoryError, ValueError, OverflowError)


def soup(rng):
    """Positions and triangles: a grid or a soup, with what real files have wrong with them."""
    n = int(rng.integers(2, 9))
    if rng.random() < 0.6:
        x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
        positions = np.stack([x.ravel(), y.ravel(), 0.05 * rng.normal(size=n * n)], axis=1)
        first = (np.arange(n - 1)[None] + n * np.arange(n - 1)[:, None]).ravel()
        corners = ([first, first + 1, first + n + 1], [first, first + n + 1, first + n])
        triangles = np.concatenate([np.stack(each, axis=1) for each in corners])
    else:
        positions = rng.normal(size=(n * n, 3)) * 10.0 ** rng.integers(-6, 7)
        triangles = rng.integers(0, n * n, (int(rng.integers(0, 40)), 3))
    if rng.random() < 0.3:
        positions[rng.integers(0, len(positions), 4)] = positions[0]
    if rng.random() < 0.1:
        positions[rng.integers(len(positions))] = rng.choice([np.nan, np.inf, 1e38, -1e38])
    if rng.random() < 0.1 and len(triangles):
        triangles[rng.integers(len(triangles))] = rng.choice([-1, len(positions), 1 << 33, 0])
    return positions.astype(rng.choice([np.float32, np.float64])), triangles


def weights(rng, n_vertices):
    n_bones = int(rng.integers(1, 6))
    dense = rng.random((n_vertices, n_bones)) * (rng.random((n_vertices, n_bones)) < 0.6)
    if rng.random() < 0.7:
        dense /= np.maximum(dense.sum(axis=1, keepdims=True), 1e-9)
    if rng.random() < 0.1:
        dense[rng.integers(n_vertices), 0] = rng.choice([np.nan, np.inf, -1, 5])
    return native.Weights.from_dense(dense.astype(np.float32))


def settings(rng):
    """Some settings, most of them sound."""
    sound = {
        "max_distance": lambda: rng.random() * 2,
        "relative_max_distance": lambda: rng.random(),
        "max_normal_angle": lambda: rng.random() * 3,
        "match_flipped_normals": lambda: bool(rng.random() < 0.5),
        "smoothness_length": lambda: rng.random() * 10.0 ** rng.integers(-5, 4),
        "relative_smoothness_length": lambda: rng.random(),
        "smoothing_iterations": lambda: int(rng.integers(5)),
        "smoothing_factor": lambda: rng.random(),
        "max_influences": lambda: int(rng.integers(6)),
        "island_policy": lambda: str(rng.choice(["bridge", "nearest", "rigid", "skip"])),
    }
    names = [str(name) for name in rng.choice(list(sound), rng.integers(0, 5), replace=False)]
    return {name: junk(rng) if rng.random() < 0.1 else sound[name]() for name in names}


def check_rows(found, limit=None, empty_allowed=True):
    """Finite, from 0 to 1, rows that sum to 1."""
    values, sums = found.values, np.add.reduceat(np.append(found.values, 0), found.indptr[:-1])
    filled = np.diff(found.indptr) > 0
    assert np.isfinite(values).all() and (values >= 0).all() and (values <= 1 + 1e-6).all()
    assert np.abs(sums[filled] - 1).max(initial=0) < 1e-4, sums[filled]
    assert not limit or np.diff(found.indptr).max(initial=0) <= limit


def transfer(rng):
    source, target = soup(rng), soup(rng)
    keywords = settings(rng)
    if rng.random() < 0.3:
        keywords["mask"] = rng.integers(0, 3 + (rng.random() < 0.1), len(target[0]))
    made = native.transfer_weights(*source, weights(rng, len(source[0])), *target, **keywords)
    check_rows(made.weights, keywords.get("max_influences"))


def prepared(rng):
    """One object used again and again, jobs started and cancelled."""
    source, target = soup(rng), soup(rng)
    inpainting = native.Inpainting(native.Source(*source, weights(rng, len(source[0]))), *target)
    for _ in range(int(rng.integers(1, 6))):
        job = inpainting.start(**settings(rng))
        if rng.random() < 0.4:
            job.cancel()
        if rng.random() < 0.8:
            check_rows(job.result().weights)


def desparsify(rng):
    positions, triangles = soup(rng)
    rows = weights(rng, len(positions))
    parents = rng.integers(-1, max(rows.n_bones, 1), rows.n_bones)
    keywords = {"method": str(rng.choice(["hop", "surface"])), "n": junk(rng) if rng.random() < 0.1 else 3}
    shape = {"positions": positions, "triangles": triangles, "bone_segments": rng.normal(size=(rows.n_bones, 2, 3))}
    made = native.desparsify(rows, parents, **keywords, **shape)
    assert np.isfinite(made.values).all() and (made.values >= 0).all()


def sculpt(rng):
    positions, _ = soup(rng)
    rows = weights(rng, len(positions))
    solver = native.SculptSolver(positions, rows, kappa=junk(rng) if rng.random() < 0.1 else 0.01)
    poses = np.tile(np.eye(4), (rows.n_bones, 1, 1)) + rng.normal(size=(rows.n_bones, 4, 4)) * [
        [0.3],
        [0.3],
        [0.3],
        [0],
    ]
    solver.add_pose(poses)
    for _ in range(int(rng.integers(1, 5))):
        chosen = rng.choice(len(positions), rng.integers(1, len(positions)), replace=False)
        made = solver.stroke(chosen, rng.normal(size=(len(chosen), 3)))
        assert np.isfinite(made.weights.values).all() and (made.weights.values >= -1e-7).all()
        if rng.random() < 0.3:
            solver.undo()


def arrays(rng):
    """CSR of nonsense."""
    n = int(rng.integers(0, 6))
    native.Weights(rng.integers(-1, 8, n + 1), rng.integers(-1, 5, rng.integers(0, 8)), rng.normal(size=3), junk(rng))


CALLS = [transfer, transfer, prepared, desparsify, sculpt, arrays, *characters.CALLS]


def case(call, rng):
    try:
        call(rng)
    except ALLOWED as error:
        assert not any(word in str(error) for word in NEVER), error
        return f"refused, {type(error).__name__}"
    return "sound"


if __name__ == "__main__":
    run = Run("native boundary", cases=1_000_000)
    for seed, generator in run.cases():
        chosen = CALLS[int(generator.integers(len(CALLS)))]
        run.attempt(seed, chosen.__name__, case, chosen, generator)
    run.end()
