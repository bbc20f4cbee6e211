"""The two cases of the evaluation: a body whose true weights were disturbed, and the poses it is sculpted in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import character
import numpy as np
import scipy.sparse as sp

POSES: dict[str, character.Rotations] = {
    "A": {
        "lowerarm01.L": ((0, 1, 0), -100),
        "lowerleg01.L": ((1, 0, 0), 90),
        "upperleg01.L": ((1, 0, 0), -60),
        "upperarm01.L": ((0, 0, 1), -40),
    },
    "B": {
        "lowerarm01.L": ((0, 1, 0.6), -50),
        "upperarm01.L": ((0, 0, 1), 40),
        "lowerleg01.L": ((1, 0.2, 0), 45),
        "upperleg01.L": ((0, 0, 1), 25),
        "wrist.L": ((1, 0, 0), 60),
    },
    "C": {
        "upperarm01.L": ((0, 1, 0), -60),
        "lowerarm02.L": ((1, 0, 0), 70),
        "upperleg01.L": ((1, 0, 0), 60),
        "upperleg02.L": ((0, 1, 0), 40),
        "foot.L": ((1, 0, 0), 30),
    },
    "D": {
        "upperarm01.L": ((1, 0, 1), 50),
        "lowerarm01.L": ((0, 1, 0), -70),
        "upperleg01.L": ((1, 0, 1), -40),
        "lowerleg01.L": ((1, 0, 0), 60),
    },
}
"""D is never sculpted."""

TOUCHED = 5e-4
"""Metres from the truth in pose A from which a vertex counts as sculpted."""


@dataclass(frozen=True)
class Case:
    """A body with its true weights (V, B), those it starts with, and pose_from_rest by pose."""

    name: str
    body: character.Character
    truth: np.ndarray
    start: np.ndarray
    poses: dict[str, np.ndarray]

    @cached_property
    def touched(self) -> np.ndarray:
        """The vertices (n,) that an artist would touch: those that are off in pose A."""
        off = np.linalg.norm(self.sculpt("A") - self.body.posed(self.start, self.poses["A"]), axis=1)
        return np.flatnonzero(off > TOUCHED)

    def sculpt(self, pose: str) -> np.ndarray:
        """Where the true weights put every vertex (V, 3)."""
        return self.body.posed(self.truth, self.poses[pose])

    def errors(self, weights: np.ndarray) -> dict[str, np.ndarray]:
        """Millimetres from the truth of every vertex (V,), by pose."""
        return {
            name: 1e3 * np.linalg.norm(self.body.posed(weights, pose) - self.sculpt(name), axis=1)
            for name, pose in self.poses.items()
        }


def load(wheel: Path) -> tuple[Case, Case]:
    """Weights smoothed too much, and one bone a vertex."""
    body = character.load(wheel)
    truth = largest(body.weights, 4)
    poses = {name: body.pose(rotations) for name, rotations in POSES.items()}
    smooth = Case("over-smoothed", body, truth, largest(oversmoothed(body, truth), 4), poses)
    rigid = Case("one bone a vertex", body, truth, np.eye(len(body.bones))[truth.argmax(axis=1)], poses)
    return smooth, rigid


def largest(weights: np.ndarray, n: int) -> np.ndarray:
    """Only the `n` largest of each row, summing to 1."""
    order = np.argsort(-weights, axis=1, kind="stable")[:, :n]
    kept = np.zeros_like(weights)
    np.put_along_axis(kept, order, np.take_along_axis(weights, order, axis=1), axis=1)
    return kept / kept.sum(axis=1, keepdims=True)


def oversmoothed(body: character.Character, weights: np.ndarray, iterations: int = 25) -> np.ndarray:
    """Halfway to the neighbours' mean, again and again."""
    edges = body.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edges = np.unique(np.vstack([edges, edges[:, ::-1]]), axis=0)
    neighbours = sp.coo_matrix((np.ones(len(edges)), edges.T), shape=(len(weights),) * 2).tocsr()
    mean = sp.diags(1 / np.maximum(np.asarray(neighbours.sum(axis=1)).ravel(), 1)) @ neighbours
    for _ in range(iterations):
        weights = 0.5 * weights + 0.5 * (mean @ weights)
    return weights
