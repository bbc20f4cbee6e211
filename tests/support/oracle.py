"""Weight inpainting once more, from the paper, on libigl and SciPy: what the native module is measured against."""

from dataclasses import dataclass

import igl
import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

SLACK = 1e-5
"""Share of an island's mean edge that every triangle inequality must hold with."""


@dataclass
class Matching:
    """Per target vertex: distance, angle between normals (NaN where one is missing), blended rows (V, bones) sparse."""

    distance: np.ndarray
    angle: np.ndarray
    rows: sp.csr_matrix


def vertex_normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Area-weighted, not normalised."""
    corners = positions[triangles]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(positions)
    for k in range(3):
        np.add.at(normals, triangles[:, k], faces)
    return normals


def welded_normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The same, summed over coincident vertices, except where opposite sides cancel."""
    own = vertex_normals(positions, triangles)
    corners = positions[triangles]
    sizes = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    one = np.unique(positions, axis=0, return_inverse=True)[1].ravel()
    sums, total = np.zeros_like(own), np.zeros(len(own))
    np.add.at(sums, one, own)
    for k in range(3):
        np.add.at(total, one[triangles[:, k]], sizes)
    cancels = np.linalg.norm(sums, axis=1) <= 1e-3 * total
    return np.where(cancels[one, None], own, sums[one])


def closest_rows(source: tuple, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix]:
    """Squared distances, triangles and barycentric shares (points x source vertices) of the closest points."""
    positions, triangles, _ = source
    squared, faces, closest = igl.point_mesh_squared_distance(points, positions, triangles)
    corners = positions[triangles[faces]]
    barycentric = igl.barycentric_coordinates(closest, *(np.ascontiguousarray(corners[:, k]) for k in range(3)))
    barycentric = np.clip(np.nan_to_num(barycentric, nan=1 / 3), 0, None)
    barycentric /= barycentric.sum(axis=1, keepdims=True)
    at = (np.repeat(np.arange(len(points)), 3), triangles[faces].ravel())
    return squared, faces, sp.csr_matrix((barycentric.ravel(), at), (len(points), len(positions)))


def normalised(weights: sp.csr_matrix) -> sp.csr_matrix:
    """Rows divided by their sums, empty ones left empty."""
    sums = np.asarray(weights.sum(axis=1)).ravel()
    return (sp.diags(1 / np.where(sums > 0, sums, 1)) @ weights).tocsr()


def match(source: tuple, target: tuple) -> Matching:
    """Closest points of `target` (positions, triangles) on `source` (positions, triangles, weights)."""
    points, triangles = target
    squared, _, share = closest_rows(source, points)
    return _at_points(source, np.sqrt(squared), share, vertex_normals(points, triangles))


def ties(source: tuple, point: np.ndarray, normal: np.ndarray) -> Matching:
    """What every source triangle gives that is as near to `point` as the nearest one, within 1e-12 of the squared
    diagonal; a tie may take any of them."""
    positions, left, weights = source
    tolerance = 1e-12 * (np.ptp(positions, axis=0) ** 2).sum()
    shares, distances = [], []
    while True:
        squared, faces, share = closest_rows((positions, left, weights), point[None])
        if distances and squared[0] > distances[0] ** 2 + tolerance:
            normals = np.repeat(normal[None], len(shares), axis=0)
            return _at_points(source, np.array(distances), sp.vstack(shares).tocsr(), normals)
        shares.append(share)
        distances.append(np.sqrt(squared[0]))
        left = np.delete(left, faces[0], axis=0)


def _at_points(source: tuple, distance: np.ndarray, share: sp.csr_matrix, normals: np.ndarray) -> Matching:
    positions, triangles, weights = source
    source_normals = welded_normals(positions, triangles)
    source_normals /= np.maximum(np.linalg.norm(source_normals, axis=1, keepdims=True), 1e-300)
    blended = share @ source_normals
    angle = np.arctan2(np.linalg.norm(np.cross(normals, blended), axis=1), (normals * blended).sum(axis=1))
    missing = (np.linalg.norm(normals, axis=1) == 0) | (np.linalg.norm(blended, axis=1) == 0)
    return Matching(distance, np.where(missing, np.nan, angle), normalised(share @ normalised(weights)))


def islands(triangles: np.ndarray, count: int) -> np.ndarray:
    """Island of each vertex, -1 for one that no triangle uses."""
    edges = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    graph = sp.coo_matrix((np.ones(len(edges)), edges.T), (count, count))
    number = connected_components(graph, directed=False)[1]
    number[~np.isin(np.arange(count), triangles)] = -1
    return number


def stiffness_and_mass(positions: np.ndarray, triangles: np.ndarray) -> tuple[sp.csc_matrix, np.ndarray]:
    """S (positive semi-definite) and lumped Voronoi areas, by libigl; its intrinsic forms for mollified triangles."""
    lengths = np.linalg.norm(positions[triangles[:, [1, 2, 0]]] - positions[triangles[:, [2, 0, 1]]], axis=2)
    island = islands(triangles, len(positions))[triangles[:, 0]]
    mean = np.bincount(island, lengths.mean(axis=1)) / np.maximum(np.bincount(island), 1)
    missing = SLACK * mean[island] - (lengths.sum(axis=1) - 2 * lengths.max(axis=1))
    bad = missing > 0
    S = sp.csc_matrix((len(positions),) * 2)
    mass = np.zeros(len(positions))
    if (~bad).any():
        good = np.ascontiguousarray(triangles[~bad])
        used = np.unique(good)
        S = S - _padded(igl.cotmatrix(positions, good), len(positions))
        kept = np.searchsorted(used, good)
        mass[used] += igl.massmatrix(positions[used], kept, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
        assert S.nnz > 0 and mass.any(), "libigl returned an empty matrix"
    if bad.any():
        flat = np.ascontiguousarray(triangles[bad])
        used = np.unique(flat)
        mollified, local = np.ascontiguousarray(lengths[bad] + missing[bad, None]), np.searchsorted(used, flat)
        expand = sp.csr_matrix((np.ones(len(used)), (used, np.arange(len(used)))), (len(positions), len(used)))
        S = S - expand @ igl.cotmatrix_intrinsic(mollified, local) @ expand.T
        mass[used] += igl.massmatrix_intrinsic(mollified, local, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    return S.tocsc(), mass


def _padded(matrix, count: int):
    matrix = sp.csc_matrix(matrix)
    matrix.resize((count, count))
    return matrix


def clean(triangles: np.ndarray) -> np.ndarray:
    """Without triangles that repeat a vertex or another triangle's vertex set."""
    triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
    first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)[1]
    return triangles[np.sort(first)]


def inpaint(positions, triangles, matched, rows, smoothness_length) -> tuple[np.ndarray, np.ndarray]:
    """Unknowns (U,) and their raw weights (U, bones): sparse LU with two steps of refinement."""
    triangles = clean(triangles)
    island = islands(triangles, len(positions))
    has_match = np.isin(island, np.unique(island[matched & (island >= 0)])) & (island >= 0)
    unknown, known = np.flatnonzero(has_match & ~matched), np.flatnonzero(has_match & matched)
    S, mass = stiffness_and_mass(positions, triangles)
    inverse = sp.diags(1 / np.where(mass > 0, mass, 1))
    Q = (S + smoothness_length**2 * S @ inverse @ S).tocsc()
    A, b = Q[np.ix_(unknown, unknown)].tocsc(), -(Q[np.ix_(unknown, known)] @ rows[known]).toarray()
    if len(unknown) == 0:
        return unknown, b
    factor = splu(A)
    X = factor.solve(b)
    for _ in range(2):
        X += factor.solve(b - A @ X)
    return unknown, X
