"""Refined clothes: several pieces, some of them open, on coarse limbs."""

import json

import numpy as np
import pytest
import skinwright_native as native
from support import posed, skin
from support.glb import data_folder

GRID = 120
"""Steps of the grid of volumes along the longest side."""


class Body:
    """A character of the shared data and its refiner."""

    def __init__(self, folder, path):
        self.conventions = json.loads((folder / "poses.json").read_text())
        self.character = posed.read(folder / path)
        triangles = skin.weld(self.character.positions, self.character.triangles)
        self.triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)].astype(np.uint32)
        self.refiner = skin.refiner_of(self.character)

    def pose(self, name):
        """One of the shared poses, or a place in a clip as "clip 25%"."""
        if name in self.conventions["poses"]:
            return posed.pose(self.character, self.conventions["poses"][name], self.conventions)
        clip, share = name.rsplit(" ", 1)
        seconds = posed.length(self.character, clip) * float(share.rstrip("%")) / 100
        return posed.clip(self.character, clip, seconds)

    def own_pairs(self, positions) -> int:
        """Pairs within one piece that do not intersect at rest."""
        at_rest, now = (
            {tuple(pair) for pair in native.intersecting_pairs(x, self.triangles).tolist()}
            for x in (self.character.positions, positions)
        )
        piece = skin.pieces(self.triangles, len(positions))[self.triangles[:, 0]]
        return sum(piece[a] == piece[b] for a, b in now - at_rest)

    def change(self, positions) -> float:
        """By how much the volume differs from rest, as a share."""
        rest = self.character.positions
        step = np.ptp(rest, axis=0).max() / GRID
        return skin.volume(positions, self.triangles, step) / skin.volume(rest, self.triangles, step) - 1


@pytest.fixture(scope="module")
def body():
    """Reads a character, the last one only once."""
    folder, read = data_folder(), {}

    def of(path):
        if path not in read:
            read.clear()
            read[path] = Body(folder, path)
        return read[path]

    return of


def test_trousers_keep_their_volume_though_other_pieces_are_open(body):
    suit = body("qm_men/Suit.glb")
    refined = suit.refiner.solve(suit.pose("squat"), quality="bake")
    assert suit.own_pairs(refined) <= 2
    assert abs(suit.change(refined)) < 0.02


@pytest.mark.parametrize("quality", ["live", "bake"])
def test_a_loose_sleeve_does_not_pull_at_the_forearm(body, quality):
    casual = body("qm_men/Casual.glb")
    refined = casual.refiner.solve(casual.pose("elbows"), quality=quality)
    assert casual.own_pairs(refined) == 0
    assert abs(casual.change(refined)) < 0.01


def test_folds_that_pushing_leaves_at_a_hem_are_taken_out(body):
    casual = body("qm_women/Casual.glb")
    refined = casual.refiner.solve(casual.pose("sit"), quality="bake")
    assert casual.own_pairs(refined) == 0
    assert abs(casual.change(refined)) < 0.02


@pytest.mark.parametrize("quality", ["live", "bake"])
def test_small_parts_in_large_cells_are_not_torn(body, quality):
    mannequin = body("animations/mannequin_clips.glb")
    refined = mannequin.refiner.solve(mannequin.pose("Idle_Loop 25%"), quality=quality)
    assert skin.stretch(mannequin.character.positions, refined, skin.edges(mannequin.triangles)) < 2
