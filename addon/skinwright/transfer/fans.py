"""The source's quads as fans of four triangles about their centres.

A diagonal bends the weights inside a quad, and a quad and its mirror image are often cut along different ones: of a
symmetric body the weights at mirrored places would differ. A fan has no diagonal.
"""

import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows
from ..scene.faces import Quads
from ..scene.mesh import Geometry


def surface(geometry: Geometry) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Positions (V + Q, 3), the centres of the convex quads last, and triangles."""
    corners, first = geometry.quads.corners, geometry.quads.first
    if not len(corners):
        return geometry.positions, geometry.triangles
    places = geometry.positions[corners].astype(np.float64)
    centres = ((places[:, 0] + places[:, 2]) + (places[:, 1] + places[:, 3])) / 4
    number = np.arange(len(corners), dtype=np.uint32) + np.uint32(len(geometry.positions))
    fans = [np.stack([corners[:, k], corners[:, (k + 1) % 4], number], axis=1) for k in range(4)]
    other = np.ones(len(geometry.triangles), bool)
    other[first] = other[first + 1] = False
    return (
        np.concatenate([geometry.positions, centres.astype(np.float32)]),
        np.concatenate([geometry.triangles[other], np.stack(fans, axis=1).reshape(-1, 3)]),
    )


def rows(given: Rows, quads: Quads) -> Rows:
    """Rows (V + Q) with those of the centres last: the mean of the corners' rows, each of which counts the same."""
    if not len(quads.corners):
        return given
    of_corners = csr.take_rows(given, quads.corners.reshape(-1).astype(np.int64))
    entry = csr.entry_vertices(of_corners)
    sums = csr.row_sums(of_corners)
    shares = of_corners.values / np.maximum(sums, np.finfo(np.float32).tiny)[entry]
    centres = csr.from_entries(entry // 4, of_corners.bones, shares / 4, len(quads.corners))
    indptr = np.concatenate([given.indptr, given.indptr[-1] + centres.indptr[1:]])
    return Rows(indptr, np.concatenate([given.bones, centres.bones]), np.concatenate([given.values, centres.values]))
