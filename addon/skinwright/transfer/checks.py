"""What is refused before anything is read or written, and what is worth a warning."""

from typing import Any

import bpy
import numpy as np

from ..scene import armature, mesh, vertex_groups
from ..scene.error import SceneError
from .inputs import Body, Garment
from .params import TransferParams


def check_objects(source: bpy.types.Object, targets: list[bpy.types.Object], params: TransferParams) -> None:
    """Raise SceneError for objects that cannot give or take weights."""
    if source.type != "MESH":
        raise SceneError(f"{source.name} is not a mesh: pick the mesh of the body as source")
    if not targets:
        raise SceneError("There is nothing to transfer to: select one or more meshes")
    for target in targets:
        _check_target(source, target)
    if not params.make_single_user:
        _check_shared([source, *targets])


def _check_target(source: bpy.types.Object, target: bpy.types.Object) -> None:
    if target == source:
        raise SceneError(f"{target.name} is source and target at once: pick another source or deselect it")
    if target.type != "MESH":
        raise SceneError(f"{target.name} is not a mesh: deselect it or convert it")
    for data in (target, target.data):
        if not data.is_editable:
            origin = data.library.filepath if data.library else "another file"
            raise SceneError(
                f"{target.name} is linked from {origin}: make it local or a library override with its mesh"
            )


def _check_shared(objects: list[bpy.types.Object]) -> None:
    first: dict[bpy.types.ID, bpy.types.Object] = {}
    for obj in objects:
        other = first.setdefault(obj.data, obj)
        if other != obj:
            raise SceneError(
                f"{other.name} and {obj.name} share one mesh and so its weights: make it single-user first"
            )


def source_warnings(body: Body, native_report: dict[str, Any]) -> list[str]:
    """About the source, worth a look; the native report is that of any of its garments."""
    found = []
    rigs = {modifier.object for modifier in armature.modifiers(body.object)}
    if body.armature and len(rigs) > 1:
        found.append(f"{body.object.name} has {len(rigs)} armatures; {body.armature.name} was taken")
    if body.bones and native_report["source_unnormalised"]:
        count = native_report["source_unnormalised"]
        found.append(f"{count} vertices of {body.object.name} have weights that do not sum to 1, and were normalised")
    if body.bones and native_report["source_unweighted"]:
        count = native_report["source_unweighted"]
        found.append(f"{count} vertices of {body.object.name} have no weights, so nothing matches there")
    return found


def garment_warnings(body: Body, garment: Garment, params: TransferParams) -> list[str]:
    """About one target, worth a look; asked before it is written."""
    found = (
        _alignment(body, garment),
        _shear(body, garment),
        _mirror(garment),
        _pose(body, garment, params),
        _rig(body, garment),
        _other_bones(body, garment, params),
        _sharing(garment, params),
    )
    return [sentence for sentence in found if sentence]


def _alignment(body: Body, garment: Garment) -> str:
    a, b = body.geometry, garment.geometry
    diagonal = float(np.linalg.norm(a.size))
    (a_low, a_high), (b_low, b_high) = a.bounds, b.bounds
    gap = np.maximum(a_low - b_high, b_low - a_high).max()
    if gap > 0.05 * diagonal or not 0.02 * diagonal < np.linalg.norm(b.size) < 3 * diagonal:
        return f"{garment.object.name} and {body.object.name} hardly overlap: are they aligned and of one scale?"
    return ""


def _shear(body: Body, garment: Garment) -> str:
    sheared = [obj.name for obj in (body.object, garment.object) if mesh.is_sheared(obj)]
    if not sheared:
        return ""
    return f"The scale of a parent shears {' and '.join(sheared)}: apply it if the angles of the match look wrong"


def _mirror(garment: Garment) -> str:
    """Half a garment under a Mirror modifier gets the other half's weights by the groups' names."""
    half = [m for m in garment.object.modifiers if m.type == "MIRROR" and not m.use_mirror_vertex_groups]
    if not half:
        return ""
    return (
        f"Vertex Groups is off in the modifier {half[0].name} of {garment.object.name}: "
        "both sides will follow the bones of one"
    )


def _pose(body: Body, garment: Garment, params: TransferParams) -> str:
    follows = armature.find(garment.object)
    if params.evaluated or follows or body.armature is None or not armature.is_posed(body.armature):
        return ""
    return (
        f"{body.armature.name} is posed, and rest shapes were compared: "
        f"set Geometry to Current if {garment.object.name} was modelled on the posed body"
    )


def _rig(body: Body, garment: Garment) -> str:
    rig = armature.find(garment.object)
    if rig is None or rig == body.armature:
        return ""
    missing = [name for name in body.bones if name in body.chosen and name not in rig.data.bones]
    if not missing:
        return ""
    return f"{rig.name}, which deforms {garment.object.name}, lacks {len(missing)} of the bones, {missing[0]} for one"


def _other_bones(body: Body, garment: Garment, params: TransferParams) -> str:
    """Deforming weights that stay beside the new ones make them count for less."""
    rig = armature.find(garment.object)
    if rig is None or params.groups not in ("BONE_DEFORM", "ALL"):
        return ""
    others = armature.deform_bones(rig) - set(body.bones) - garment.locks
    names = sorted(others & {group.name for group in garment.object.vertex_groups})
    if not names or not (vertex_groups.read(garment.object, names).values > 0).any():
        return ""
    return (
        f"{garment.object.name} keeps its weights in {len(names)} groups of bones {body.object.name} lacks "
        f"({names[0]} for one): lock them to have the new weights fill what they leave, or remove them"
    )


def _sharing(garment: Garment, params: TransferParams) -> str:
    others = mesh.other_users(garment.object)
    if not others or params.make_single_user:
        return ""
    return f"{garment.object.name} shares its mesh with {', '.join(others)}, whose weights changed too"
