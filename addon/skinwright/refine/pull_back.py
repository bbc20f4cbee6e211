"""What a posed offset is at rest, before the armature: the inverse of each vertex's blended transform."""

import numpy as np
from numpy.typing import NDArray

from .. import csr
from .character import Character
from .sampling import Sample, below

# Below this determinant a blended matrix has nearly collapsed, and its inverse is damped.
COLLAPSED = 0.05
_DAMPING = 0.2


def rest_offsets(character: Character, sample: Sample, offsets: NDArray[np.float32]) -> NDArray[np.float64]:
    """(V, 3) what must be added at rest for the posed shape of `sample` to move by `offsets` (V, 3)."""
    moved = np.flatnonzero(np.abs(offsets).max(axis=1) > 0)
    result = np.zeros(offsets.shape)
    if moved.size:
        blended = blended_matrices(character, sample)[moved]
        result[moved] = np.einsum("nij,nj->ni", inverse(blended), offsets[moved])
    return result


def blended_matrices(character: Character, sample: Sample) -> NDArray[np.float64]:
    """(V, 3, 3) of each vertex: its share of the turned bones decides between rest and turned."""
    return blend(share_of(character, sample.bone), sample.rotation(character), character.preserve_volume)


def share_of(character: Character, bone: int) -> NDArray[np.float64]:
    """(V,) the part of each vertex's weights that the bone and those below it have."""
    rows = character.rows
    vertex, total = csr.entry_vertices(rows), csr.row_sums(rows)
    turned = rows.values * below(character, bone)[rows.bones]
    part = np.bincount(vertex, weights=turned, minlength=len(total))
    return part / np.where(total > 0, total, 1)


def blend(share: NDArray[np.float64], turned: NDArray[np.float64], by_quaternions: bool) -> NDArray[np.float64]:
    """(V, 3, 3) between no turn and `turned` (3, 3), as the Armature modifier blends."""
    if not by_quaternions:
        return np.eye(3) + share[:, None, None] * (turned - np.eye(3))
    cosine = np.clip((np.trace(turned) - 1) / 2, -1, 1)
    angle = np.arccos(cosine)
    skew = turned - turned.T
    axis = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    length = np.linalg.norm(axis)
    if length < 1e-9:
        return np.broadcast_to(np.eye(3), (len(share), 3, 3))
    x, y, z = axis / length
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    # A weighted sum of two quaternions about one axis, made unit again.
    half = np.arctan2(share * np.sin(angle / 2), 1 - share + share * np.cos(angle / 2))
    sine, versine = np.sin(2 * half), 1 - np.cos(2 * half)
    return np.eye(3) + sine[:, None, None] * cross + versine[:, None, None] * (cross @ cross)


def inverse(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3, 3) inverses; those of nearly collapsed matrices are damped (Tikhonov), else spikes would grow."""
    result = np.empty_like(matrices)
    collapsed = np.abs(np.linalg.det(matrices)) < COLLAPSED
    result[~collapsed] = np.linalg.inv(matrices[~collapsed])
    u, size, v = np.linalg.svd(matrices[collapsed])
    damped = size / (size**2 + _DAMPING**2)
    result[collapsed] = np.einsum("nji,nj,nkj->nik", v, damped, u)
    return result
