"""A target's mesh with the halves that its Mirror modifiers add, and rows folded back to its own vertices.

Every own vertex has one or more images in the completed mesh: itself, its mirrored copies, and, to symmetrise, the
vertex on the other side. A row is the mean of its images' rows, those of the other side with left and right exchanged.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows
from ..scene.mesh import Geometry, transformed
from ..scene.mirror import Reflection


@dataclass(frozen=True)
class Completion:
    """`geometry` has the own vertices first; image[k] (I,) is an image of the own vertex origin[k], flipped or not.

    `opposite` (B,) is the column that a flipped column becomes.
    """

    geometry: Geometry
    n_own: int
    image: NDArray[np.int64]
    origin: NDArray[np.int64]
    flipped: NDArray[np.bool_]

    @property
    def is_plain(self) -> bool:
        """Whether every vertex stands for itself alone."""
        return len(self.image) == self.n_own

    def fold(self, rows: Rows, opposite: NDArray[np.int64]) -> Rows:
        """Rows of the own vertices; one that no image has a row for is empty."""
        if self.is_plain:
            return rows
        order = np.argsort(self.origin, kind="stable")
        images = csr.take_rows(rows, self.image[order])
        entry = csr.entry_vertices(images)
        origin, flipped = self.origin[order][entry], self.flipped[order][entry]
        bones = np.where(flipped, opposite[images.bones], images.bones)
        has_row = np.diff(images.indptr) > 0
        count = np.bincount(self.origin[order][has_row], minlength=self.n_own)
        values = images.values.astype(np.float64) / np.maximum(count, 1)[origin]
        return csr.from_entries(origin, bones, values, self.n_own)

    def spread(self, values: NDArray) -> NDArray:
        """Values of the own vertices (n,) for every vertex of the completed mesh."""
        if len(self.geometry.positions) == self.n_own:
            return values
        spread = np.empty(len(self.geometry.positions), values.dtype)
        spread[self.image] = values[self.origin]
        return spread


def plain(geometry: Geometry) -> Completion:
    """Nothing to complete."""
    own = np.arange(len(geometry.positions), dtype=np.int64)
    return Completion(geometry, len(own), own, own, np.zeros(len(own), bool))


def complete(geometry: Geometry, reflections: list[Reflection]) -> Completion:
    """The mesh with its mirrored halves, joined where the modifier merges them."""
    done = plain(geometry)
    for reflection in reflections:
        done = _reflect(done, reflection)
    return done


def _reflect(done: Completion, reflection: Reflection) -> Completion:
    positions, triangles = done.geometry.positions, done.geometry.triangles
    mirrored = transformed(positions, reflection.world)
    apart = np.linalg.norm(mirrored - positions, axis=1) > reflection.merged
    number = np.arange(len(positions), dtype=np.int64)
    number[apart] = len(positions) + np.arange(int(apart.sum()), dtype=np.int64)
    return Completion(
        Geometry(
            np.concatenate([positions, mirrored[apart]]),
            _with_copies(triangles, number, apart),
            _with_copies(done.geometry.wires, number, apart),
        ),
        done.n_own,
        np.concatenate([done.image, number[done.image]]),
        np.concatenate([done.origin, done.origin]),
        np.concatenate([done.flipped, done.flipped ^ reflection.flips]),
    )


def _with_copies(elements: NDArray[np.uint32], number: NDArray[np.int64], apart: NDArray[np.bool_]) -> NDArray:
    """Triangles or edges (n, k) and their mirrored copies, turned over; none of what lies in the mirror."""
    own = elements.astype(np.int64)
    copies = number[own][apart[own].any(axis=1)][:, ::-1]
    return np.ascontiguousarray(np.concatenate([elements, copies.astype(np.uint32)]))


def symmetrised(done: Completion, opposite_vertex: NDArray[np.int64]) -> Completion:
    """With the vertex on the other side as one more image; `opposite_vertex` (n,) is -1 where there is none."""
    own = np.flatnonzero(opposite_vertex >= 0)
    return Completion(
        done.geometry,
        done.n_own,
        np.concatenate([done.image, opposite_vertex[own]]),
        np.concatenate([done.origin, own]),
        np.concatenate([done.flipped, np.ones(len(own), bool)]),
    )
