"""Seams of a target that are almost closed, as in files that round: they are not welded, and come apart in poses."""

import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..scene import mesh, places, vertex_groups
from .inputs import Garment

# A gap is almost closed below this part of the diagonal, and below this part of the edges there.
_OF_DIAGONAL = 1e-3
_OF_EDGES = 0.2
# Half the sum of differences between two rows.
_COMES_APART = 0.05
_FEWEST = 3
_MOST_POINTS = 4000


def warning(garment: Garment) -> str:
    """A sentence if borders nearly lie on each other and follow other bones, or nothing; asked after the write."""
    positions, diagonal = garment.shape.geometry.positions, float(np.linalg.norm(garment.shape.geometry.size))
    border = mesh.border(garment.object)
    if len(border) < 2 * _FEWEST:
        return ""
    edges = np.linalg.norm(positions[border[:, 0]] - positions[border[:, 1]], axis=1)
    reach = min(_OF_DIAGONAL * diagonal, _OF_EDGES * float(np.median(edges)))
    one, other, gaps = _pairs(positions, np.unique(border), reach)
    if len(one) < _FEWEST:
        return ""
    rows = vertex_groups.read(garment.object, garment.names)
    apart = csr.half_l1(csr.take_rows(rows, one), csr.take_rows(rows, other)) > _COMES_APART
    if int(apart.sum()) < _FEWEST:
        return ""
    weld = 1.1 * float(gaps[apart].max()) / diagonal
    return (
        f"Borders of {garment.object.name} lie up to {gaps[apart].max():.2g} apart and follow other bones at "
        f"{int(apart.sum())} vertices, so that gaps will open: set Weld to {weld:.1e} if they are seams"
    )


def _pairs(
    positions: NDArray[np.float32], border: NDArray[np.int64], reach: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Border vertices (n,), others (n,) within `reach` but not at the same place, and the gaps (n,)."""
    number = places.numbers(positions[border])
    border = border[np.unique(number, return_index=True)[1]]
    points, tree = positions[border].tolist(), places.tree(positions[border])
    asked = np.unique(np.linspace(0, len(points) - 1, min(len(points), _MOST_POINTS)).astype(np.int64)).tolist()
    found = [(i, *near[1:]) for i in asked for near in tree.find_n(points[i], 3) if near[1] != i and near[2] <= reach]
    found = [pair for pair in found if pair[2] > 0]
    one, other, gaps = (np.array(column) for column in zip(*found, strict=True)) if found else (np.zeros(0),) * 3
    return border[one.astype(np.int64)], border[other.astype(np.int64)], gaps.astype(np.float64)
