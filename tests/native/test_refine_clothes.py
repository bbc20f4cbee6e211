"""Refined clothes: several pieces, some of them open, on coarse limbs."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import skinwright_native as native
from support.glb import data_folder

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def refined():
    """Solves a body in one of the shared poses: (new pairs within one piece, volume against rest)."""
    folder = data_folder()
    sys.path.append(str(ROOT / "bench"))
    pytest.importorskip("igl")
    evaluation = pytest.importorskip("refine_eval")
    conventions = json.loads((folder / "poses.json").read_text())
    bodies: dict = {}

    def solve(path, pose, quality):
        if path not in bodies:
            bodies.clear()
            character = evaluation.rc.read(folder / path)
            triangles = evaluation.weld(character.positions, character.triangles)
            triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)].astype(np.uint32)
            bodies[path] = character, triangles, evaluation.character_refiner(character)
        character, triangles, refiner = bodies[path]
        posed = evaluation.rc.pose(character, conventions["poses"][pose], conventions)
        positions = refiner.solve(posed, quality=quality)
        arrays = character, triangles, positions
        return own_pairs(evaluation, *arrays), volume(evaluation, *arrays)

    return solve


def own_pairs(evaluation, character, triangles, positions) -> int:
    """Pairs within one piece that do not intersect at rest."""
    at_rest = {tuple(pair) for pair in native.intersecting_pairs(character.positions, triangles).tolist()}
    new = {tuple(pair) for pair in native.intersecting_pairs(positions, triangles).tolist()} - at_rest
    piece = evaluation.pieces(triangles, len(positions))[triangles[:, 0]]
    return sum(piece[a] == piece[b] for a, b in new)


def volume(evaluation, character, triangles, positions) -> float:
    """Change of what is inside by the winding number, on a grid."""
    step = np.ptp(character.positions, axis=0).max() / 120

    def inside(places):
        axes = [np.arange(a - step, b + step, step) for a, b in zip(places.min(0), places.max(0), strict=True)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
        return (evaluation.winding(places.astype(float), triangles.astype(np.int64), points) > 0.5).sum()

    return inside(positions) / inside(character.positions) - 1


def test_trousers_keep_their_volume_though_other_pieces_are_open(refined):
    pairs, change = refined("qm_men/Suit.glb", "squat", "bake")
    assert pairs <= 2
    assert abs(change) < 0.02


@pytest.mark.parametrize("quality", ["live", "bake"])
def test_a_loose_sleeve_does_not_pull_at_the_forearm(refined, quality):
    pairs, change = refined("qm_men/Casual.glb", "elbows", quality)
    assert pairs == 0
    assert abs(change) < 0.01


def test_folds_that_pushing_leaves_at_a_hem_are_taken_out(refined):
    pairs, change = refined("qm_women/Casual.glb", "sit", "bake")
    assert pairs == 0
    assert abs(change) < 0.02
