"""An object's shape in three ways: its mesh alone, as it is shown but in rest pose, or as it is shown now."""

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Literal

import bpy
import numpy as np
from numpy.typing import NDArray

from ..csr import Rows
from . import armature, faces, mesh, modifiers, places, poses, vertex_groups
from .error import SceneError

# REST is the mesh alone (with shape keys its Basis); AS_SHOWN adds shape keys in use and modifiers, but no pose;
# CURRENT is what the viewport shows.
Look = Literal["REST", "AS_SHOWN", "CURRENT"]


@dataclass(frozen=True)
class Shape:
    """What was seen of an object: `matrix` (4, 4) is its place in the world, `unseen` names what was left out."""

    geometry: mesh.Geometry
    matrix: NDArray[np.float64]
    unseen: list[str]


@contextmanager
def looked_at(objects: list[bpy.types.Object], look: Look) -> Iterator[None]:
    """Show the rest pose of every armature that moves one of these objects, unless the pose is what is looked at."""
    moving = armature.moving(objects) if look == "AS_SHOWN" else []
    with ExitStack() as stack:
        for rig in moving:
            if armature.is_posed(rig):
                stack.enter_context(poses.at_rest(rig))
        yield


def read_source(obj: bpy.types.Object, look: Look, names: list[str]) -> tuple[Shape, Rows]:
    """Shape and weights in the groups `names`, of the vertices that all its modifiers leave; inside `looked_at`.

    Modifiers that leave no faces, or lose the weights, are left out and named as unseen.
    """
    if look == "REST" or not _is_shaped(obj, look):
        return _plain(obj), vertex_groups.read(obj, names)
    with _evaluable(obj) as shown, _without(_reweighting_after_the_pose(shown)):
        making = [m for m in modifiers.shown(shown) if not modifiers.keeps_vertices(m) and m.type != "MASK"]
        for off in ([], *([modifier] for modifier in reversed(making))):
            found = _evaluated_source(obj, shown, off, names)
            if not making or _is_sound(obj, found, names):
                return found
        return _evaluated_source(obj, shown, making, names)


def _evaluated_source(
    obj: bpy.types.Object, shown: bpy.types.Object, off: list[bpy.types.Modifier], names: list[str]
) -> tuple[Shape, Rows]:
    """Without the modifiers `off`. Without any it may have no faces, which is no error yet."""
    with _without(off), _evaluated_mesh(shown) as (evaluated, seen):
        rows = vertex_groups.read_evaluated(evaluated, seen, names)
        if len(obj.data.polygons) and not len(seen.polygons):
            triangles, wires = np.empty((0, 3), np.uint32), np.empty((0, 2), np.uint32)
            nothing = mesh.Geometry(np.empty((0, 3), np.float32), triangles, wires)
            return Shape(nothing, np.array(shown.matrix_world), []), rows
        geometry = mesh.placed(obj, shown.matrix_world, mesh.positions(seen), seen)
        return Shape(geometry, np.array(shown.matrix_world), [modifier.name for modifier in off]), rows


def _is_sound(obj: bpy.types.Object, found: tuple[Shape, Rows], names: list[str]) -> bool:
    """Whether it has faces, and weights, if the mesh itself has."""
    shape, rows = found
    if len(obj.data.polygons) and not len(shape.geometry.triangles):
        return False
    return bool((rows.values > 0).any()) or not (vertex_groups.read(obj, names).values > 0).any()


@contextmanager
def _evaluated_mesh(shown: bpy.types.Object) -> Iterator[tuple[bpy.types.Object, bpy.types.Mesh]]:
    """The evaluated object, and its mesh with the groups that modifiers leave."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = shown.evaluated_get(depsgraph)
    try:
        yield evaluated, evaluated.to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph)
    finally:
        evaluated.to_mesh_clear()


def masked(obj: bpy.types.Object, look: Look, left: NDArray[np.float32]) -> tuple[str, NDArray[np.float32]] | None:
    """The object and Mask modifiers that hide a part of its surface, and the points (n, 3) there; inside `looked_at`.

    `left` (m, 3) are those that `read_source` gave. Parts that hang on nothing visible, as helper geometry does, do not
    count.
    """
    masks = [m for m in modifiers.shown(obj) if m.type == "MASK"]
    if look == "REST" or not masks:
        return None
    with _without(masks):
        whole = read_source(obj, look, [])[0].geometry
    same = places.numbers(np.concatenate([whole.positions, left]))
    place, visible = same[: len(whole.positions)], same[len(whole.positions) :]
    part = places.connected(place, whole.triangles)
    gone = ~np.isin(place, visible)
    cut = gone & np.isin(part, part[~gone])
    names = " and ".join(m.name for m in masks)
    return (f"the modifier {names} of {obj.name}", whole.positions[cut]) if cut.any() else None


def _reweighting_after_the_pose(obj: bpy.types.Object) -> list[bpy.types.Modifier]:
    """The modifiers that change weights once the armature has used them."""
    last = max((i for i, m in enumerate(obj.modifiers) if m.type == "ARMATURE" and m.show_viewport), default=-1)
    return [m for m in obj.modifiers[last + 1 :] if modifiers.changes_weights(m)] if last >= 0 else []


def read_target(obj: bpy.types.Object, look: Look) -> Shape:
    """The shape of the mesh's own vertices, by the modifiers that keep them; inside `looked_at`."""
    if look == "REST" or not _is_shaped(obj, look):
        return _plain(obj)
    with _evaluable(obj) as shown:
        local, unseen = _kept_positions(shown, look)
        geometry = mesh.placed(obj, shown.matrix_world, local, obj.data)
        return Shape(geometry, np.array(shown.matrix_world), unseen)


def before_the_pose(obj: bpy.types.Object) -> NDArray[np.float32]:
    """(V, 3) local positions that the armature deforms: by shape keys in use and the modifiers before it, at rest.

    Modifiers that make other vertices are left out. Raises SceneError if Geometry Nodes do.
    """
    place = next((i for i, m in enumerate(obj.modifiers) if m.type == "ARMATURE" and m.show_viewport), 0)
    if not keys_in_use(obj) and not any(m.show_viewport and modifiers.moves(m) for m in list(obj.modifiers)[:place]):
        return mesh.rest_positions(obj.data)
    with looked_at([obj], "AS_SHOWN"), _evaluable(obj) as shown:
        before = [m for m in list(shown.modifiers)[:place] if modifiers.keeps_vertices(m) or m.type == "NODES"]
        local = _positions_without(shown, [m for m in shown.modifiers if m not in before])
    if len(local) != len(obj.data.vertices):
        raise SceneError(f"{obj.name} has Geometry Nodes before its armature, which make other vertices: apply them")
    return local


def weights_after(obj: bpy.types.Object, modifier: bpy.types.Modifier, names: list[str]) -> Rows:
    """What this modifier alone leaves of the mesh's weights in the groups `names`."""
    place = list(obj.modifiers).index(modifier)
    with (
        _evaluable(obj) as shown,
        _without(m for i, m in enumerate(shown.modifiers) if i != place),
        _evaluated_mesh(shown) as (evaluated, seen),
    ):
        return vertex_groups.read_evaluated(evaluated, seen, names)


def is_moved_by(obj: bpy.types.Object, modifier: bpy.types.Modifier, least: float) -> bool:
    """Whether this modifier moves the mesh's own vertices, by more than `least` of its size; nodes may make others."""
    place = list(obj.modifiers).index(modifier)
    with looked_at([obj], "AS_SHOWN"), _evaluable(obj) as shown:
        others = [m for m in list(shown.modifiers)[:place] if not modifiers.keeps_vertices(m)]
        others += list(shown.modifiers)[place + 1 :]
        before, after = _positions_without(shown, [*others, shown.modifiers[place]]), _positions_without(shown, others)
    if before.shape != after.shape or not before.size:
        return False
    return float(np.abs(after - before).max()) > least * float(np.ptp(before, axis=0).max())


def _plain(obj: bpy.types.Object) -> Shape:
    return Shape(mesh.read(obj), np.array(obj.matrix_world), [])


def _is_shaped(obj: bpy.types.Object, look: Look) -> bool:
    """Whether anything but the mesh itself makes the shape."""
    shown = modifiers.shown(obj)
    shaping = any(modifiers.moves(m) or modifiers.changes_weights(m) for m in shown) or keys_in_use(obj)
    shaping = shaping or (armature.deforms_as_parent(obj) and obj.parent.type != "ARMATURE")
    return shaping or (look == "CURRENT" and bool(armature.rigs(obj)))


def keys_in_use(obj: bpy.types.Object) -> bool:
    """Whether shape keys make another shape than the Basis; a key with a driver may."""
    keys = obj.data.shape_keys
    if keys is None:
        return False
    others = [key for key in keys.key_blocks if key != keys.reference_key and not key.mute]
    driven = bool(keys.animation_data and keys.animation_data.drivers)
    pinned = obj.show_only_shape_key and obj.active_shape_key != keys.reference_key
    return pinned or not keys.use_relative or bool(others and driven) or any(key.value != 0 for key in others)


def _kept_positions(obj: bpy.types.Object, look: Look) -> tuple[NDArray[np.float32], list[str]]:
    """(V, 3) local positions, and the modifiers that shape but had to be left out.

    Geometry Nodes are left out only if they change the number of vertices. In rest pose simulations are left out: they
    would run on from a pose that they have never seen.
    """
    off = [m for m in modifiers.shown(obj) if not modifiers.keeps_vertices(m) and m.type != "NODES"]
    if look == "AS_SHOWN":
        off += [m for m in modifiers.shown(obj) if m.type in ("CLOTH", "SOFT_BODY")]
    nodes = [m for m in modifiers.shown(obj) if m.type == "NODES"]
    local = _positions_without(obj, off)
    if nodes and not _keeps_its_faces(obj, off):
        off += nodes
        local = _positions_without(obj, off)
    if len(local) != len(obj.data.vertices):
        raise SceneError(f"{obj.name} has another number of vertices when evaluated: set Geometry to Rest")
    return local, [m.name for m in off if modifiers.hides_shape(m) or modifiers.keeps_vertices(m)]


def _keeps_its_faces(obj: bpy.types.Object, off: list[bpy.types.Modifier]) -> bool:
    """Whether without these modifiers each face has the vertices that it has in the mesh; it may be turned over."""
    with _without(off):
        seen = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        if len(seen.vertices) != len(obj.data.vertices):
            return False
        there, here = faces.around(seen), faces.around(obj.data)
        return len(there) == len(here) and all(np.array_equal(a, b) for a, b in zip(there, here, strict=True))


def _positions_without(obj: bpy.types.Object, off: list[bpy.types.Modifier]) -> NDArray[np.float32]:
    with _without(off):
        evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
        return mesh.positions(evaluated.data)


@contextmanager
def _without(off: Iterable[bpy.types.Modifier]) -> Iterator[None]:
    """Hide modifiers for the moment; those that are hidden already stay so."""
    hidden = [modifier for modifier in off if modifier.show_viewport]
    try:
        for modifier in hidden:
            modifier.show_viewport = False
        yield
    finally:
        for modifier in hidden:
            modifier.show_viewport = True


@contextmanager
def _evaluable(obj: bpy.types.Object) -> Iterator[bpy.types.Object]:
    """The object, or for the moment a stand-in that Blender evaluates although the object is hidden or excluded."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    if obj.evaluated_get(depsgraph).is_evaluated and obj.visible_get():
        yield obj
        return
    scene, stand_in = bpy.context.scene, obj.copy()
    stand_in.hide_viewport = False
    scene.collection.objects.link(stand_in)
    try:
        bpy.context.view_layer.update()
        yield stand_in
    finally:
        bpy.data.objects.remove(stand_in)
