"""What a transfer reads from the source: one mesh, or several that are one body."""

from dataclasses import dataclass
from functools import cached_property

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows
from ..scene import armature, evaluation, mesh, shapes, sides
from ..scene.error import SceneError
from . import parts
from .params import TransferParams


@dataclass(frozen=True)
class Body:
    """The source as read.

    `objects` are the meshes that are its body, the picked one first; `rigs` the armatures that deform it. The rows over
    `bones` sum to 1 and are carried over together. `fields` are groups beside them (cloth pins, masks), each carried
    over by itself. `chosen` names the groups to be written. `opposite` has the other side's bone of every bone.
    `hidden` names what hides a part of the surface, and the points (n, 3) there; `unseen` what was left out.
    """

    object: bpy.types.Object
    objects: list[bpy.types.Object]
    rigs: list[bpy.types.Object]
    geometry: mesh.Geometry
    bones: list[str]
    bone_weights: Rows
    fields: list[str]
    field_weights: Rows
    chosen: set[str]
    opposite: dict[str, str]
    hidden: tuple[str, NDArray[np.float32]] | None = None
    unseen: str = ""

    @property
    def armature(self) -> bpy.types.Object | None:
        """The armature that counts most."""
        return self.rigs[0] if self.rigs else None

    @property
    def is_partial(self) -> bool:
        """Whether only some of its bones are written."""
        return not set(self.bones) <= self.chosen

    @cached_property
    def unturned(self) -> NDArray[np.float64]:
        """(4, 4) the world without the source's own rotation: the size of a box along the axes depends on no rotation
        there."""
        axes = np.array(self.object.matrix_world.to_3x3(), dtype=np.float64)
        left, _, right = np.linalg.svd(axes)
        turn = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
        matrix = np.eye(4)
        matrix[:3, :3] = turn.T
        return matrix

    @cached_property
    def flaws(self) -> dict[str, int]:
        """Vertices without weights of bones, and with weights that do not sum to 1 (to 1e-3), by the report's names."""
        sums = csr.row_sums(self.bone_weights)
        off = np.abs(np.divide(1, sums, out=np.ones_like(sums), where=sums > 0) - 1) > 1e-3
        return {"source_unweighted": int((sums <= 0).sum()), "source_unnormalised": int(off.sum())}

    @property
    def name(self) -> str:
        """All its meshes."""
        return " + ".join(obj.name for obj in self.objects)


def read_body(source: bpy.types.Object, params: TransferParams, targets: list[bpy.types.Object] | None = None) -> Body:
    """The source's shape and the weights of the groups that take part; `targets` are never part of it."""
    evaluation.bring_up_to_date([source])  # which meshes continue it is told by their places
    objects = _body_objects(source, targets or [], params)
    evaluation.bring_up_to_date(objects)
    rigs = _rigs(objects)
    bones, chosen = choose_groups(objects, rigs, params.groups)
    fields = [name for name in chosen if name not in bones]
    with shapes.looked_at(objects, params.geometry):
        seen = [shapes.read_source(obj, params.geometry, bones + fields) for obj in objects]
        hidden = [
            shapes.masked(obj, params.geometry, shape.geometry.positions)
            for obj, (shape, _) in zip(objects, seen, strict=True)
        ]
    geometry = parts.united([shape.geometry for shape, _ in seen])
    mesh.check_faces(source, geometry)
    rows = parts.united_rows([rows for _, rows in seen])
    bone_weights, field_weights = _split_columns(rows, len(bones))
    return Body(
        object=source,
        objects=objects,
        rigs=rigs,
        geometry=geometry,
        bones=bones,
        bone_weights=bone_weights,
        fields=fields,
        field_weights=field_weights,
        chosen=set(chosen),
        opposite=sides.opposites(rigs[0] if rigs else None, bones),
        hidden=next((each for each in hidden if each), None),
        unseen=_unseen(objects, [shape for shape, _ in seen]),
    )


def _unseen(objects: list[bpy.types.Object], seen: list[shapes.Shape]) -> str:
    """The modifiers that were left out, in words, or nothing."""
    left_out = [(obj.name, shape.unseen) for obj, shape in zip(objects, seen, strict=True) if shape.unseen]
    return " and ".join(f"the modifier {', '.join(names)} of {name}" for name, names in left_out)


def _split_columns(rows: Rows, n_left: int) -> tuple[Rows, Rows]:
    """Rows over the first `n_left` columns, and over the rest."""
    last = int(rows.bones.max(initial=0))
    left = np.arange(max(last + 1, n_left), dtype=np.int64) < n_left
    return csr.take_columns(rows, left), csr.take_columns(rows, ~left)


def _body_objects(
    source: bpy.types.Object, targets: list[bpy.types.Object], params: TransferParams
) -> list[bpy.types.Object]:
    """The picked mesh and those it stands for."""
    others = {
        "OBJECT": lambda: [],
        "PARTS": lambda: _continuing(source, targets, params.geometry),
        "ARMATURE": lambda: armature.deformed_meshes(armature.rigs(source)),
        "COLLECTION": lambda: mesh.in_collections_of(source),
    }[params.source_scope]()
    found = [source, *(obj for obj in others if obj != source and obj not in targets)]
    return [obj for obj in found if obj == source or (obj.vertex_groups and obj.data.polygons)]


def _continuing(source: bpy.types.Object, targets: list[bpy.types.Object], look: shapes.Look) -> list[bpy.types.Object]:
    """The visible meshes on the source's armature whose borders lie on its own, as the head of a body in parts."""
    rigs = armature.rigs(source)
    others = [o for o in armature.deformed_meshes(rigs) if o != source and o not in targets and o.data.polygons]
    if not others or not source.data.polygons:
        return []
    try:
        with shapes.looked_at([source, *others], look):
            geometries = [shapes.read_target(obj, look).geometry for obj in (source, *others)]
    except SceneError:  # one of them cannot be read: the source itself is read next, and says so
        return []
    together = next(group for group in parts.groups(geometries) if 0 in group)
    return [others[number - 1] for number in together if number]


def _rigs(objects: list[bpy.types.Object]) -> list[bpy.types.Object]:
    """The armatures that deform them, which must be the same for all."""
    rigs = armature.rigs(objects[0]) or [rig for rig in [armature.find(objects[0])] if rig]
    for obj in objects[1:]:
        other = [rig for rig in armature.rigs(obj) if rig not in rigs]
        if other:
            raise SceneError(
                f"{obj.name} is deformed by {other[0].name} and {objects[0].name} is not: "
                "weights of one body follow one armature, so leave one of the meshes out"
            )
    return rigs


def choose_groups(
    objects: list[bpy.types.Object], rigs: list[bpy.types.Object], subset: str
) -> tuple[list[str], list[str]]:
    """The groups that are bones, and those to be written. Without an armature all groups are, if all are wanted."""
    source = objects[0]
    groups = list(dict.fromkeys(group.name for obj in objects for group in obj.vertex_groups))
    if not groups:
        raise SceneError(f"{source.name} has no vertex groups to transfer: pick a body that has weights")
    if not rigs:
        return _choose_without_armature(source, groups, subset)
    deforming = set().union(*(armature.deform_bones(rig) for rig in rigs))
    active = source.vertex_groups.active
    wanted = {
        "ALL": set(groups),
        "ACTIVE": {active.name if active else ""},
        "BONE_DEFORM": deforming,
        "BONE_SELECT": deforming.intersection(*[set().union(*(armature.selected_bones(rig) for rig in rigs))]),
    }[subset]
    # Where only a group's vertices follow an armature, the targets need that group.
    wanted = wanted | armature.masking_groups(source)
    chosen = [name for name in groups if name in wanted]
    if not set(chosen) - armature.masking_groups(source):
        kind = "selected deform bone" if subset == "BONE_SELECT" else "deform bone"
        raise SceneError(
            f"No vertex group of {source.name} has the name of a {kind} of {rigs[0].name}: "
            "select other bones, rename the groups, or set Groups to All Groups"
        )
    return [name for name in groups if name in deforming], chosen


def _choose_without_armature(source: bpy.types.Object, groups: list[str], subset: str) -> tuple[list[str], list[str]]:
    if subset == "ALL":
        return groups, groups
    if subset == "ACTIVE":
        return [], [source.vertex_groups.active.name]
    raise SceneError(
        f"{source.name} has no armature to tell which of its groups are bones: "
        "give it an Armature modifier, or set Groups to All Groups"
    )
