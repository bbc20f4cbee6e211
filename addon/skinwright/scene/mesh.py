"""Meshes as arrays in world space, at rest; shapes.py has what modifiers and shape keys make of them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property

import bmesh
import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from . import faces
from .error import SceneError


@dataclass(frozen=True)
class Geometry:
    """positions (V, 3) f32 in world units, triangles (T, 3) u32 whose winding gives outward normals in the world.

    `wires` (E, 2) u32 are the edges of no face, `quads` those faces that are convex quads.
    """

    positions: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    wires: NDArray[np.uint32]
    quads: faces.Quads = field(default_factory=faces.no_quads)

    @cached_property
    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest coordinates (3,), world units."""
        coordinates = np.ascontiguousarray(self.positions.T)  # NumPy is slow along the longer axis
        return coordinates.min(axis=1), coordinates.max(axis=1)

    @property
    def size(self) -> NDArray[np.float32]:
        """Edge lengths (3,) of the bounding box, world units."""
        low, high = self.bounds
        return high - low


def read(obj: bpy.types.Object) -> Geometry:
    """The object's own vertices in world space at rest: the Basis, without modifiers.

    Raises SceneError for an empty mesh, a coordinate that is not finite and a world matrix that flattens the object.
    """
    return placed(obj, obj.matrix_world, rest_positions(obj.data), obj.data)


def placed(obj: bpy.types.Object, matrix: Matrix, local: NDArray[np.float32], shape: bpy.types.Mesh) -> Geometry:
    """Local positions (V, 3) of `obj`, in the world that its `matrix` leads to, with the faces and wires of `shape`."""
    _check_connected(obj, shape)
    world = np.array(matrix, dtype=np.float64)
    is_mirrored = _checked_determinant(obj, world) < 0
    with np.errstate(all="ignore"):  # numbers that are not finite are looked for next
        positions = transformed(local, world)
    _check_finite(obj, positions)
    triangles, quads = faces.triangulated(shape, positions)
    if is_mirrored:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
        quads = faces.Quads(np.ascontiguousarray(quads.corners[:, ::-1]), quads.first)
    return Geometry(positions, triangles, wires_of(shape), quads)


def transformed(positions: NDArray[np.float32], matrix: NDArray[np.float64]) -> NDArray[np.float32]:
    """Positions (V, 3) moved by an affine matrix (4, 4).

    Axis by axis: a product of long matrices would wake NumPy's BLAS, whose threads then hold a core for 0.1 s.
    """
    x, y, z = positions.T.astype(np.float64)
    moved = np.empty_like(positions)
    for axis, (a, b, c, d) in enumerate(matrix[:3]):
        moved[:, axis] = a * x + b * y + c * z + d
    return moved


def is_sheared(obj: bpy.types.Object) -> bool:
    """Whether the object's axes are not at right angles in the world."""
    axes = np.array(obj.matrix_world.to_3x3(), dtype=np.float64)
    axes /= np.linalg.norm(axes, axis=0)
    return bool(np.abs(axes.T @ axes - np.eye(3)).max() > 1e-3)


def selected(obj: bpy.types.Object) -> NDArray[np.bool_]:
    """(V,) the vertices selected in Edit mode or by the paint mask, whose faces count while painting."""
    mesh = obj.data
    select = np.zeros(len(mesh.vertices), bool)
    if obj.mode != "WEIGHT_PAINT" or not mesh.use_paint_mask:
        mesh.vertices.foreach_get("select", select)
        return select
    faces, corners = np.empty(len(mesh.polygons), bool), np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("select", faces)
    mesh.polygons.foreach_get("loop_total", corners)
    vertices = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", vertices)
    select[vertices[np.repeat(faces, corners)]] = True
    return select


def active_vertex(obj: bpy.types.Object) -> int | None:
    """The vertex picked last, else the first selected one; None without any."""
    if obj.mode == "EDIT":
        edited = bmesh.from_edit_mesh(obj.data)
        active = edited.select_history.active
        if isinstance(active, bmesh.types.BMVert):
            return active.index
        return next((vertex.index for vertex in edited.verts if vertex.select), None)
    chosen = np.flatnonzero(selected(obj))
    return int(chosen[0]) if chosen.size else None


def edges(obj: bpy.types.Object) -> NDArray[np.int32]:
    """(E, 2) vertices of the edges."""
    return _ends(obj.data)


def border(obj: bpy.types.Object) -> NDArray[np.int32]:
    """(E, 2) the edges of exactly one face."""
    return _ends(obj.data)[np.bincount(_sides(obj.data), minlength=len(obj.data.edges)) == 1]


def _ends(mesh: bpy.types.Mesh) -> NDArray[np.int32]:
    """(E, 2) vertices of the edges."""
    return faces.stored(mesh, ".edge_verts", mesh.edges, "vertices", 2).reshape(-1, 2)


def _sides(mesh: bpy.types.Mesh) -> NDArray[np.int32]:
    """(L,) the edge after each corner of the faces."""
    return faces.stored(mesh, ".corner_edge", mesh.loops, "edge_index")


def select(obj: bpy.types.Object, chosen: NDArray[np.bool_]) -> None:
    """Select these vertices (V,) and what lies wholly between them; not in Edit mode."""
    mesh = obj.data
    mesh.vertices.foreach_set("select", chosen)
    mesh.edges.foreach_set("select", chosen[edges(obj)].all(axis=1))
    start, corner = np.empty(len(mesh.polygons), np.int32), np.empty(len(mesh.loops), np.int32)
    mesh.polygons.foreach_get("loop_start", start)
    mesh.loops.foreach_get("vertex_index", corner)
    if start.size:
        mesh.polygons.foreach_set("select", np.logical_and.reduceat(chosen[corner], start))
    mesh.update()


def other_users(obj: bpy.types.Object) -> list[str]:
    """Names of the other objects that show the same mesh, and with it the same vertex groups."""
    return [other.name for other in bpy.data.objects if other.data == obj.data and other != obj]


def in_collections_of(obj: bpy.types.Object) -> list[bpy.types.Object]:
    """The visible meshes of the collections that hold the object, and of the collections in those."""
    found = [other for collection in obj.users_collection for other in collection.all_objects]
    return [other for other in dict.fromkeys(found) if other.type == "MESH" and other.visible_get()]


@contextmanager
def object_mode(context: bpy.types.Context) -> Iterator[None]:
    """Leave Edit mode, where weights can be neither read nor written, and come back with the same objects in it.

    What scripts have just moved, added or removed is where it now is.
    """
    edited = list(context.objects_in_mode) if context.mode == "EDIT_MESH" else []
    if edited:
        bpy.ops.object.mode_set(mode="OBJECT")
    context.view_layer.update()
    try:
        yield
    finally:
        if edited:
            with _only_selected(context, edited):
                bpy.ops.object.mode_set(mode="EDIT")


@contextmanager
def _only_selected(context: bpy.types.Context, objects: list[bpy.types.Object]) -> Iterator[None]:
    """Entering Edit mode takes every selected mesh along: select just these for the moment."""
    before = list(context.view_layer.objects.selected)
    for obj in {*before, *objects}:
        obj.select_set(obj in objects)
    try:
        yield
    finally:
        for obj in {*before, *objects}:
            obj.select_set(obj in before)


def check_world(*objects: bpy.types.Object) -> None:
    """Raise SceneError for an object, or an armature, whose world matrix flattens everything in it."""
    for obj in objects:
        _checked_determinant(obj, np.array(obj.matrix_world, dtype=np.float64))


def _checked_determinant(obj: bpy.types.Object, matrix: NDArray[np.float64]) -> float:
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    determinant = float(np.linalg.det(matrix[:3, :3]))
    if not np.isfinite(matrix).all() or abs(determinant) <= 1e-9 * max(lengths) ** 3:
        raise SceneError(f"{obj.name} is scaled to nothing along an axis: give it a scale other than 0")
    return determinant


def rest_positions(mesh: bpy.types.Mesh) -> NDArray[np.float32]:
    """(V, 3) local positions that modifiers start from."""
    # With shape keys it is the Basis that the armature deforms; the mesh's own positions may lag behind it.
    if mesh.shape_keys:
        return vectors(mesh.shape_keys.reference_key.data, "co")
    return positions(mesh)


def positions(mesh: bpy.types.Mesh) -> NDArray[np.float32]:
    """(V, 3) local positions of a mesh, evaluated or not."""
    if not mesh.vertices:
        return np.empty((0, 3), np.float32)
    return vectors(mesh.attributes["position"].data, "vector")


def vectors(collection: bpy.types.bpy_prop_collection, name: str) -> NDArray[np.float32]:
    """(n, 3) of a vector property of every element."""
    values = np.empty(len(collection) * 3, np.float32)
    collection.foreach_get(name, values)
    return values.reshape(-1, 3)


def _check_finite(obj: bpy.types.Object, positions: NDArray[np.float32]) -> None:
    finite = np.isfinite(positions)
    if not finite.all():
        bad = np.flatnonzero(~finite.all(axis=1))
        raise SceneError(f"{obj.name} has a coordinate that is not a number at vertex {bad[0]}: move or delete it")


def triangles(obj: bpy.types.Object) -> NDArray[np.uint32]:
    """(T, 3) of its faces as they are, before modifiers. Raises SceneError if there are none."""
    if not obj.data.polygons:
        raise SceneError(f"{obj.name} has no faces: this works along surfaces, so give it some")
    return faces.blenders_triangles(obj.data)


def _check_connected(obj: bpy.types.Object, mesh: bpy.types.Mesh) -> None:
    if not mesh.polygons and not mesh.edges:
        raise SceneError(f"{obj.name} has no faces and no edges: weights are carried over them, so give it some")


def wires_of(mesh: bpy.types.Mesh) -> NDArray[np.uint32]:
    """(E, 2) the edges of no face."""
    loose = np.ones(len(mesh.edges), bool)
    loose[_sides(mesh)] = False
    return _ends(mesh)[loose].astype(np.uint32) if loose.any() else np.empty((0, 2), np.uint32)


def check_faces(obj: bpy.types.Object, geometry: Geometry) -> None:
    """Raise SceneError for a source that has no surface."""
    if not len(geometry.triangles):
        raise SceneError(f"{obj.name} has no faces: weights are taken from a surface, so pick a mesh that has one")
