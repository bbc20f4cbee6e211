"""Confidence transfer once more, by brute force in NumPy and SciPy: what the native module is measured against.

Every pair of a vertex and a source triangle is looked at; nothing is shared with the module but the formulas.
"""

from dataclasses import dataclass

import numpy as np
import oracle
import scipy.sparse as sp
from scipy.sparse.linalg import splu

DIRECTION, HYSTERESIS, TIE = 0.015, 0.8, 0.3
SLACK = 1 + 8 * TIE**2
EQUALLY_NEAR, FLOOR, GAP, TILT, LEAST_COSINE, HELD = 1e-6, 1e-3, 0.93, 2.8, 0.05, 0.25
KEPT, STRETCH, DETAIL_TILT, DETAIL_GAP, STEEP = 0.85, 0.5, 4, 0.05, 25.0
REACH = 1.5


@dataclass
class Trusted:
    """Per target vertex: rows (V, B), gap (V), cosine (V), mean point on the source (V, 3)."""

    rows: np.ndarray
    gap: np.ndarray
    cosine: np.ndarray
    point: np.ndarray


def size(positions: np.ndarray, triangles: np.ndarray) -> float:
    """4.2 times the root mean square distance of the surface from its centroid, sampled at edge midpoints, which is
    exact for a quadratic."""
    corners = positions[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    middle = (corners + np.roll(corners, 1, axis=1)) / 2
    centroid = (area[:, None] * middle.mean(axis=1)).sum(axis=0) / area.sum()
    return 4.2 * np.sqrt((area * ((middle - centroid) ** 2).sum(axis=2).mean(axis=1)).sum() / area.sum())


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)


def source_normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals; vertices at one place, as at the seams between the parts of a body, share one."""
    _, one = np.unique(positions, axis=0, return_inverse=True)
    sums = np.zeros((one.max() + 1, 3))
    np.add.at(sums, one.ravel(), oracle.vertex_normals(positions, triangles))
    return unit(sums)[one.ravel()]


def closest_on_triangles(point: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Barycentric shares (T, 3) of the point of each triangle (T, 3, 3) that is closest to `point`."""
    shares, squared = np.zeros((len(corners), 3)), np.full(len(corners), np.inf)
    for k in range(3):
        start, edge = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
        along = ((point - start) * edge).sum(axis=1) / np.maximum((edge**2).sum(axis=1), 1e-300)
        along = np.clip(along, 0, 1)
        distance = ((point - start - along[:, None] * edge) ** 2).sum(axis=1)
        nearer = distance < squared
        squared[nearer] = distance[nearer]
        shares[nearer] = 0
        shares[nearer, k], shares[nearer, (k + 1) % 3] = 1 - along[nearer], along[nearer]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    doubled = np.maximum((normal**2).sum(axis=1), 1e-300)
    in_b = (np.cross(point - a, c - a) * normal).sum(axis=1) / doubled
    in_c = (np.cross(b - a, point - a) * normal).sum(axis=1) / doubled
    inside = (in_b >= 0) & (in_c >= 0) & (in_b + in_c <= 1)
    shares[inside] = np.stack([1 - in_b - in_c, in_b, in_c], axis=1)[inside]
    return shares


def trusted(source: tuple, target: tuple) -> Trusted:
    """The rows of `target` (positions, triangles) on `source` (positions, triangles, weights)."""
    positions, triangles, weights = source
    points, faces = target
    extent, dense = size(positions, triangles), oracle.normalised(weights).toarray()
    corners, body_normals = positions[triangles], source_normals(positions, triangles)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    normals = unit(oracle.vertex_normals(points, faces))
    sides = unit(np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]))
    around = [sides[(faces == i).any(axis=1)] for i in range(len(points))]
    found = Trusted(np.zeros((len(points), dense.shape[1])), *(np.zeros(len(points)) for _ in range(2)), points.copy())
    for i, (point, normal) in enumerate(zip(points, normals, strict=True)):
        shares = closest_on_triangles(point, corners)
        on = np.einsum("tk,tki->ti", shares, corners)
        distance = np.linalg.norm(on - point, axis=1)
        body_normal = unit(np.einsum("tk,tki->ti", shares, body_normals[triangles]))
        cosine = body_normal @ normal
        cost = distance**2 + 2 * (DIRECTION * extent) ** 2 * (1 - np.clip(cosine, -1, 1))
        near = distance <= distance.min() + EQUALLY_NEAR * extent
        best_near, best = cost[near].min(), cost.min()
        may_move = np.sqrt(best_near) - distance.min() > 1e-3 * DIRECTION * extent
        moves = may_move and best < HYSTERESIS * best_near
        best = best if moves else best_near
        smallest = (EQUALLY_NEAR * extent) ** 2
        tied = (near | moves) & (cost <= SLACK * best + smallest)
        weight = area[tied] * np.exp(-(cost[tied] - best) / (2 * TIE**2 * (best + smallest)))
        weight /= weight.sum()
        blended = np.einsum("tk,tkb->tb", shares[tied], dense[triangles[tied]])
        found.rows[i] = weight @ (blended / blended.sum(axis=1, keepdims=True))
        # Creases and hems: of the directions around the vertex, the one that agrees best.
        agreement = np.abs(body_normal[tied] @ np.vstack([normal, around[i]]).T).max(axis=1)
        found.gap[i], found.cosine[i] = weight @ distance[tied], weight @ agreement
        found.point[i] = weight @ on[tied]
    return found


def lengths(found: Trusted, extent: float, softness: float = 0.7) -> np.ndarray:
    tangent = 1 / np.maximum(np.abs(found.cosine), LEAST_COSINE) ** 2 - 1
    growth = found.gap * (GAP + TILT * tangent)
    return softness * growth + np.minimum(FLOOR * extent, found.gap / 2) + EQUALLY_NEAR * extent


def edge_trust(found: Trusted, edges: np.ndarray, lengths: np.ndarray, extent: float) -> np.ndarray:
    """How far the change of weight along each edge (E, 2) is the source's own."""
    a, b = edges.T
    stretch = np.linalg.norm(found.point[a] - found.point[b], axis=1) / lengths
    gap = np.maximum(found.gap[a], found.gap[b]) / (DETAIL_GAP * extent)
    cosine = np.minimum(np.abs(found.cosine[a]), np.abs(found.cosine[b]))
    steepness = 0.5 * np.abs(found.rows[a] - found.rows[b]).sum(axis=1) * extent / lengths
    steep = 1 + (steepness / STEEP) ** 2
    return KEPT / steep * cosine**DETAIL_TILT / ((1 + (np.maximum(stretch - 1, 0) / STRETCH) ** 2) * (1 + gap**4))


def transfer(source: tuple, target: tuple, softness: float = 0.7) -> np.ndarray:
    """Raw weights (V, B) before clamping, all islands reached, without a mask."""
    positions, triangles = target[0], oracle.clean(target[1])
    found, extent = trusted(source, target), size(*source[:2])
    h = lengths(found, extent, softness)
    S, mass = oracle.stiffness_and_mass(positions, triangles)
    edges = np.unique(np.sort(np.vstack([triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1), axis=0)
    long = np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)
    shortest = np.full(len(positions), np.inf)
    np.minimum.at(shortest, edges, long[:, None])
    confidence = REACH * mass / h**2
    scaled = -np.asarray(S[edges[:, 0], edges[:, 1]]).ravel() * edge_trust(found, edges, long, extent)
    across = sp.coo_matrix((scaled, edges.T), S.shape)
    guided = (sp.diags(np.asarray((across + across.T).sum(axis=1)).ravel()) - across - across.T) @ found.rows
    free, held = np.flatnonzero(h >= HELD * shortest), np.flatnonzero(h < HELD * shortest)
    X = found.rows.copy()
    if len(free):
        S = S.tocsr()
        X[free] = corrected(S, mass, confidence, h, found.rows, guided, free, held)
    return X


def corrected(S, mass, confidence, h, rows, guided, free, held):
    """Two harmonic passes, and one step towards `S M^-1 S W + M h^-4 W = M h^-4 rows + S M^-1 guided` from there,
    preconditioned by the passes."""
    factor = splu((S[np.ix_(free, free)] + sp.diags(confidence[free])).tocsc())
    X = rows.copy()
    for _ in range(2):
        right = confidence[:, None] * X + guided
        X[free] = factor.solve(right[free] - S[np.ix_(free, held)] @ rows[held])
    bent = (S @ X - guided) / mass[:, None]
    bent[held] = 0
    defect = (mass / h**4)[:, None] * (rows - X) - S @ bent
    return X[free] + factor.solve(mass[free, None] * factor.solve(defect[free]))
