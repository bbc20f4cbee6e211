"""The peers, from public libraries: the pipeline of the paper's authors on libigl, CHOLMOD, SuperLU.

The algorithm is Abdrashitov et al. 2023, with our energy (S + l^2 S M^-1 S) so that the
answers can be compared. Two things are faster here than in the authors' code, in the peers' favour: the normal test
and the search for the vertices to smooth are vectorised.
"""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
import scipy.sparse as sp
from meshes import Mesh
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import splu

RELATIVE_DISTANCE = 0.05
MAX_ANGLE = np.radians(35)
RELATIVE_SMOOTHNESS = 0.05
SMOOTHING_FACTOR = 0.2


@dataclass(frozen=True)
class Matches:
    """For each target vertex: the blended row (V, 60) of its closest point, its distance, and whether it matched."""

    weights: np.ndarray
    distance: np.ndarray
    matched: np.ndarray


def diagonal(mesh: Mesh) -> float:
    """Length of the bounding box's diagonal."""
    return float(np.linalg.norm(np.ptp(mesh.positions.astype(float), axis=0)))


def closest_points(source: Mesh, target: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """libigl's AABB tree: squared distances, triangle indices, points."""
    return igl.point_mesh_squared_distance(
        target.positions.astype(float), source.positions.astype(float), source.triangles.astype(np.int64)
    )


def match(source: Mesh, target: Mesh) -> Matches:
    """Closest points, blended rows, and the test of distance and normals (paper section 3.1)."""
    squared, index, point = closest_points(source, target)
    positions, triangles = source.positions.astype(float), source.triangles.astype(np.int64)
    corners = triangles[index]
    share = igl.barycentric_coordinates(point, *(np.ascontiguousarray(positions[corners[:, k]]) for k in range(3)))
    rows = np.einsum("vk,vkb->vb", share, source.weights.astype(float)[corners])
    source_normal = np.einsum("vk,vkx->vx", share, _vertex_normals(source)[corners])
    source_normal /= np.linalg.norm(source_normal, axis=1, keepdims=True)
    cosine = np.einsum("vx,vx->v", source_normal, _vertex_normals(target))
    distance = np.sqrt(squared)
    near = distance <= RELATIVE_DISTANCE * diagonal(target)
    return Matches(rows, distance, near & (np.abs(cosine) >= np.cos(MAX_ANGLE)))


def energy(mesh: Mesh, smoothness: float) -> sp.csc_matrix:
    """S + l^2 S M^-1 S with cotangent stiffness and Voronoi areas (paper section 3.2)."""
    positions, triangles = mesh.positions.astype(float), mesh.triangles.astype(np.int64)
    stiffness = -igl.cotmatrix(positions, triangles)
    area = igl.massmatrix(positions, triangles, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    if stiffness.nnz == 0 or not area.all():
        raise RuntimeError("libigl returned an empty matrix: this libigl does not go with this numpy")
    return (stiffness + smoothness**2 * stiffness @ sp.diags(1 / area) @ stiffness).tocsc()


def transfer(source: Mesh, target: Mesh, smoothing_passes: int) -> tuple[np.ndarray, np.ndarray]:
    """The whole pipeline; gives rows (V, 60) and the mask of matched vertices."""
    matches = match(source, target)
    known = np.flatnonzero(matches.matched)
    quadratic = energy(target, RELATIVE_SMOOTHNESS * diagonal(source))
    nothing = sp.csc_matrix((0, len(target.positions)))
    weights = igl.min_quad_with_fixed(
        quadratic,
        np.zeros(matches.weights.shape),
        known,
        np.ascontiguousarray(matches.weights[known]),
        nothing,
        np.zeros((0, matches.weights.shape[1])),
        True,
    )
    weights = normalised(weights)
    if smoothing_passes:
        weights = smooth(weights, target, matches, smoothing_passes)
    return weights, matches.matched


def smooth(weights: np.ndarray, target: Mesh, matches: Matches, passes: int) -> np.ndarray:
    """Vertex by vertex in Python, as the authors wrote it (paper, end of section 3.3)."""
    neighbours = igl.adjacency_list(target.triangles.astype(np.int64))
    region = _near_unmatched(target, matches)
    for _ in range(passes):
        smoothed = weights.copy()
        for i in region:
            mean = weights[neighbours[i]].mean(axis=0)
            smoothed[i] = (1 - SMOOTHING_FACTOR) * weights[i] + SMOOTHING_FACTOR * mean
        weights = smoothed
    return normalised(weights)


def normalised(weights: np.ndarray) -> np.ndarray:
    """No negative weights, rows that sum to 1."""
    weights = np.maximum(weights, 0)
    return weights / weights.sum(axis=1, keepdims=True)


def cholmod(matrix: sp.csc_matrix, right: np.ndarray, ordering: str) -> np.ndarray:
    """Order, factor and solve with CHOLMOD, supernodal; `ordering` is amd or metis."""
    from sksparse.cholmod import cholesky

    return cholesky(matrix, mode="supernodal", ordering_method=ordering).solve_A(right)


def superlu(matrix: sp.csc_matrix, right: np.ndarray) -> np.ndarray:
    """Order, factor and solve with SciPy's SuperLU in its symmetric mode."""
    options = {"SymmetricMode": True}
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options).solve(right)


def one_component(mesh: Mesh, smoothness: float) -> tuple[sp.csc_matrix, np.ndarray, np.ndarray]:
    """Interior vertices unknown, boundary vertex i on bone i % 60: the matrix, the right-hand sides, the interior."""
    boundary = np.unique(igl.boundary_facets(mesh.triangles.astype(np.int64))[0])
    interior = np.setdiff1d(np.arange(len(mesh.positions)), boundary)
    quadratic = energy(mesh, smoothness)[interior]
    known = np.zeros((len(boundary), 60))
    known[np.arange(len(boundary)), boundary % 60] = 1
    return quadratic[:, interior].tocsc(), -(quadratic[:, boundary] @ known), interior


def _vertex_normals(mesh: Mesh) -> np.ndarray:
    return igl.per_vertex_normals(
        mesh.positions.astype(float), mesh.triangles.astype(np.int64), igl.PER_VERTEX_NORMALS_WEIGHTING_TYPE_AREA
    )


def _near_unmatched(target: Mesh, matches: Matches) -> np.ndarray:
    """Unmatched vertices, and those that can be reached from one along edges within the matching distance."""
    edges = igl.edges(target.triangles.astype(np.int64))
    first, second = target.positions.astype(float)[edges.T]
    length = np.linalg.norm(first - second, axis=1)
    graph = sp.coo_matrix((length, edges.T), shape=[len(target.positions)] * 2).tocsr()
    reach = RELATIVE_DISTANCE * diagonal(target)
    unmatched = np.flatnonzero(~matches.matched)
    along_edges = dijkstra(graph, directed=False, indices=unmatched, limit=reach, min_only=True)
    return np.flatnonzero(np.isfinite(along_edges))
