"""The meshes of a character as they are shown at rest, end to end, with the halves that Mirror modifiers add."""

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows
from ..scene import mirror, orientation, shapes, sides
from ..transfer import completion


@dataclass(frozen=True)
class Whole:
    """Own vertices first, those of the k-th mesh from starts[k] to starts[k + 1], then the mirrored ones (E).

    A mirrored vertex is a copy of the own vertex `origin` (E,), with left and right exchanged where `flipped` (E,).
    """

    positions: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    starts: list[int]
    origin: NDArray[np.int64]
    flipped: NDArray[np.bool_]

    def rows(self, own: Rows, rig: bpy.types.Object, names: Sequence[str]) -> Rows:
        """The rows of all vertices over the groups `names`, from those of the own ones."""
        if not len(self.origin):
            return own
        index, opposite = {name: j for j, name in enumerate(names)}, sides.opposites(rig, names)
        other = np.array([index.get(opposite[name], j) for name, j in index.items()], np.uint32)
        copies = csr.take_rows(own, self.origin)
        bones = np.where(self.flipped[csr.entry_vertices(copies)], other[copies.bones], copies.bones)
        return csr.concatenated([own, copies._replace(bones=bones.astype(np.uint32))])


def read(meshes: Sequence[bpy.types.Object], *rigs: bpy.types.Object) -> Whole:
    """By shape keys in use and the modifiers that keep the vertices; `rigs` are shown at rest too."""
    with shapes.looked_at([*meshes, *rigs], "AS_SHOWN"):
        seen = [shapes.read_target(obj, "AS_SHOWN") for obj in meshes]
        parts = [_completed(obj, shape) for obj, shape in zip(meshes, seen, strict=True)]
    starts = np.cumsum([0, *(part.n_own for part in parts)], dtype=np.int64).tolist()
    mirrored = np.cumsum([starts[-1], *(len(p.geometry.positions) - p.n_own for p in parts)], dtype=np.int64)
    triangles, origin, flipped = [], [], []
    for part, start, end, first in zip(parts, starts, starts[1:], mirrored, strict=False):
        own, copies = part.n_own, len(part.geometry.positions) - part.n_own
        number = np.concatenate(
            [np.arange(start, end, dtype=np.uint32), np.arange(first, first + copies, dtype=np.uint32)]
        )
        triangles.append(number[part.geometry.triangles])
        is_copy = part.image >= own
        order = part.image[is_copy].argsort(kind="stable")
        origin.append(start + part.origin[is_copy][order])
        flipped.append(part.flipped[is_copy][order])
    positions = [part.geometry.positions[: part.n_own] for part in parts]
    positions += [part.geometry.positions[part.n_own :] for part in parts]
    joined = [np.concatenate(each) for each in (positions, triangles, origin, flipped)]
    return Whole(joined[0], orientation.outward(joined[0], joined[1]), starts, joined[2], joined[3])


def _completed(obj: bpy.types.Object, shape: shapes.Shape) -> completion.Completion:
    found = mirror.reflections(obj, shape.matrix, shape.geometry.positions)
    return completion.complete(shape.geometry, found)
