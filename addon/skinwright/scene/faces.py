"""Faces as triangles. Quads are cut such that mirrored ones are cut alike, whichever corner the file begins with."""

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

# Two diagonals are as good as each other if the sines of the angles that they face differ by less: both give the same
# Laplacian then.
_TIE = 1e-6
_FOUR = np.arange(4, dtype=np.int64)
# Quads looked at together: their arrays stay in the processor's cache.
_AT_A_TIME = 8192


@dataclass(frozen=True)
class Quads:
    """Convex quads: `corners` (Q, 4) around each, and the `first` (Q,) of the two triangles that it is cut into."""

    corners: NDArray[np.uint32]
    first: NDArray[np.int64]


def no_quads() -> Quads:
    """Of a mesh that has none."""
    return Quads(np.empty((0, 4), np.uint32), np.empty(0, np.int64))


def blenders_triangles(mesh: bpy.types.Mesh) -> NDArray[np.uint32]:
    """(T, 3) as Blender cuts the faces."""
    corners = _corners(mesh)
    if corners is not None and len(mesh.loops) == 3 * len(mesh.polygons):
        return corners.reshape(-1, 3).astype(np.uint32)  # triangles only: these are read a hundred times as fast
    mesh.calc_loop_triangles()
    triangles = np.empty(len(mesh.loop_triangles) * 3, np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    return triangles.reshape(-1, 3).astype(np.uint32)


def triangulated(mesh: bpy.types.Mesh, positions: NDArray[np.float32]) -> tuple[NDArray[np.uint32], Quads]:
    """The faces of a mesh whose vertices lie at `positions` (V, 3).

    A convex quad is cut along the diagonal that faces the smaller angles (Delaunay); a concave one where it can be.
    Other faces are cut as Blender does it.
    """
    corners = _corners(mesh)
    if corners is None or len(corners) == 3 * len(mesh.polygons):
        return blenders_triangles(mesh), no_quads()
    start = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_start", start)
    quad = np.flatnonzero(np.diff(start, append=len(corners)) == 4)
    if not quad.size:
        return blenders_triangles(mesh), no_quads()
    is_all = len(quad) == len(start)
    of_quads = corners if is_all else corners[start[quad].astype(np.int64)[:, None] + _FOUR]
    around: NDArray[np.uint32] = of_quads.reshape(-1, 4).astype(np.uint32)
    other, convex = _cuts(positions, around)
    first = start[quad].astype(np.int64) - 2 * quad  # n corners make n - 2 triangles
    quads = Quads(around[convex], first[convex])
    turned = np.where(other[:, None], np.roll(around, -1, axis=1), around)
    halves = turned[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 2, 3)
    if is_all:
        return halves.reshape(-1, 3), quads
    triangles = blenders_triangles(mesh)
    triangles[first], triangles[first + 1] = halves[:, 0], halves[:, 1]
    return triangles, quads


def _corners(mesh: bpy.types.Mesh) -> NDArray[np.int32] | None:
    """(L,) the vertices around each face, one face after the other; None in Edit mode, where they are not kept."""
    return _attribute(mesh, ".corner_vert", len(mesh.loops))


def around(mesh: bpy.types.Mesh) -> list[NDArray[np.int64]]:
    """(F,) where the corners of each face start, and two sums over its vertices that tell faces of others apart."""
    start = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_start", start)
    vertices = stored(mesh, ".corner_vert", mesh.loops, "vertex_index").astype(np.int64)
    if not start.size:
        return [vertices]
    sums: list[NDArray[np.int64]] = [np.add.reduceat(each, start) for each in (vertices, vertices**2)]
    return [start.astype(np.int64), *sums]


def stored(
    mesh: bpy.types.Mesh, name: str, elements: bpy.types.bpy_prop_collection, property_name: str, size: int = 1
) -> NDArray[np.int32]:
    """(n size,) integers of all elements: the attribute is copied at once, the property is asked of one by one.

    The attribute is missing in Edit mode.
    """
    values = _attribute(mesh, name, len(elements) * size)
    if values is None:
        values = np.empty(len(elements) * size, np.int32)
        elements.foreach_get(property_name, values)
    return values


def _attribute(mesh: bpy.types.Mesh, name: str, count: int) -> NDArray[np.int32] | None:
    """(count,) the integers of an attribute, if there is one."""
    attribute = mesh.attributes.get(name)
    if attribute is None:
        return None
    values = np.empty(count, np.int32)
    attribute.data.foreach_get("value", values)
    return values


def _cuts(positions: NDArray[np.float32], around: NDArray[np.uint32]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(Q,) whether each quad is cut from its second corner instead of its first, and whether it is convex."""
    axes = np.ascontiguousarray(positions.T, np.float64)
    parts = [_cuts_of_some(axes, around[at : at + _AT_A_TIME]) for at in range(0, len(around), _AT_A_TIME)]
    other, convex = zip(*parts, strict=True)
    return np.concatenate(other), np.concatenate(convex)


def _cuts_of_some(axes: NDArray[np.float64], around: NDArray[np.uint32]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The same of a few, whose vertices have the coordinates `axes` (3, V)."""
    place = [axes[:, np.ascontiguousarray(around[:, k])] for k in range(4)]
    edge = [place[(k + 1) % 4] - place[k] for k in range(4)]
    normal = [_cross(edge[k - 1], edge[k]) for k in range(4)]
    sine = [np.sqrt(_dot(n, n)) for n in normal]
    cosine = [-_dot(edge[k - 1], edge[k]) for k in range(4)]
    size = np.sqrt(_dot(edge[0], edge[0]) * _dot(edge[1], edge[1]) * _dot(edge[2], edge[2]) * _dot(edge[3], edge[3]))
    first_cut, second_cut = _dot(normal[1], normal[3]), _dot(normal[0], normal[2])
    facing = [sine[k] * cosine[k + 2] + cosine[k] * sine[k + 2] for k in range(2)]
    is_better = facing[1] - facing[0] < -_TIE * size
    return (first_cut < 0) | (second_cut > 0) & is_better, (first_cut > 0) & (second_cut > 0)


def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the columns of (3, Q)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
