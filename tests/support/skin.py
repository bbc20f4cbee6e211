"""Skin whose seams are closed: its pieces, what is inside, and the refiner of a character."""

import igl
import numpy as np
import skinwright_native as native
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


def weld(positions, triangles):
    """Triangles over first vertices of equal position, so that seams do not count."""
    _, first, inverse = np.unique(positions, axis=0, return_index=True, return_inverse=True)
    return first[inverse.ravel()][triangles]


def pieces(triangles: np.ndarray, n_vertices: int) -> np.ndarray:
    """(V,) the connected component of each vertex."""
    sides = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(sides)), (sides[:, 0], sides[:, 1])), (n_vertices, n_vertices))
    return connected_components(graph)[1]


def edges(triangles: np.ndarray) -> np.ndarray:
    """(E, 2) each edge once."""
    sides = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    return np.unique(np.sort(sides, axis=1), axis=0)


def stretch(rest: np.ndarray, positions: np.ndarray, edges: np.ndarray) -> float:
    """The 99.9 % quantile of the edges' lengths against rest."""
    lengths = [np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1) for x in (rest, positions)]
    return float(np.quantile(lengths[1] / np.maximum(lengths[0], 1e-9), 0.999))


def winding(positions: np.ndarray, triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Generalised winding numbers (n,)."""
    number = getattr(igl, "fast_winding_number", None) or igl.fast_winding_number_for_meshes
    return number(positions.astype(float), triangles.astype(np.int64), points)


def volume(positions: np.ndarray, triangles: np.ndarray, step: float) -> float:
    """Inside by the winding number, on a grid: what is enclosed twice counts once, and holes are closed."""
    low, high = positions.min(0), positions.max(0)
    axes = [np.arange(a - step, b + step, step) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    return float((winding(positions, triangles, points) > 0.5).sum() * step**3)


def refiner_of(character, **settings) -> native.Refiner:
    """The native object of a character (`posed.Character`)."""
    weights = native.Weights.from_dense(character.weights)
    arrays = character.positions, character.triangles, weights, character.parents, character.segments
    return native.Refiner(*arrays, **settings)
