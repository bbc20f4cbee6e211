"""Strokes on both sides of a mesh: the other side is sculpted in the mirror image of the pose.

So that a symmetric mesh with symmetric weights stays symmetric, whatever pose its two sides are in.
"""

from collections.abc import Sequence

import bpy
import numpy as np
from numpy.typing import NDArray

from ..scene import symmetry
from ..scene.bendy import Columns
from ..scene.error import SceneError

_FLIP = np.diag([-1.0, 1.0, 1.0, 1.0])


class Mirror:
    """Partners of vertices and bones across the plane x = 0 of the mesh."""

    def __init__(
        self, obj: bpy.types.Object, names: Sequence[str], columns: Columns, positions: NDArray[np.float32]
    ) -> None:
        """Raises SceneError where sides do not correspond."""
        flipped = symmetry.flipped(list(names))
        if flipped is None:
            raise SceneError(f"Not every bone of {obj.name} has its other side: name them alike, or turn Mirror X off")
        if (columns.joint >= 0).any():
            raise SceneError(f"{obj.name} follows B-bones, whose strokes cannot be mirrored: turn Mirror X off")
        self._bone = flipped
        self._partner = symmetry.partners(positions)
        if not (self._partner >= 0).any():
            raise SceneError(f"No vertex of {obj.name} has a partner across its local X: turn Mirror X off")

    def of_pose(self, matrices: NDArray[np.float64]) -> NDArray[np.float64]:
        """(J, 4, 4) the mirror image of a pose."""
        return _FLIP @ matrices[self._bone] @ _FLIP

    def of_stroke(self, vertices: NDArray, targets: NDArray) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
        """Partners that the brush has not touched itself, and where they go."""
        other = self._partner[vertices]
        chosen = (other >= 0) & ~np.isin(other, vertices)
        mirrored = targets[chosen] * np.array([-1, 1, 1], np.float32)
        return other[chosen].astype(np.uint32), np.ascontiguousarray(mirrored, np.float32)
