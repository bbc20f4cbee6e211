"""What is refused before anything is read or written, and what is worth a warning."""

from typing import Any

import bpy
import numpy as np

from ..scene import armature, editable, mesh, mirror, sides, stack, vertex_groups
from ..scene.error import SceneError
from . import strangers
from .inputs import Body, Garment
from .params import TransferParams


def check_objects(source: bpy.types.Object, targets: list[bpy.types.Object], params: TransferParams) -> None:
    """Raise SceneError for objects that cannot give or take weights; every one of them is named."""
    check_source(source, targets)
    problems = [target_problem(source, target, targets, params) for target in targets]
    if any(problems):
        raise SceneError("; ".join(problem for problem in problems if problem))


def check_source(source: bpy.types.Object, targets: list[bpy.types.Object]) -> None:
    """Raise SceneError where there is nothing to take weights from, or nothing to give them to."""
    if source.type != "MESH":
        raise SceneError(f"{source.name} is not a mesh: pick the mesh of the body as source")
    if not targets:
        raise SceneError("There is nothing to transfer to: select one or more meshes")


def target_problem(
    source: bpy.types.Object, target: bpy.types.Object, targets: list[bpy.types.Object], params: TransferParams
) -> str:
    """Why a target cannot take weights, or nothing."""
    if target == source:
        return f"{target.name} is source and target at once: pick another source or deselect it"
    if target.type != "MESH":
        return f"{target.name} is not a mesh: deselect it or convert it"
    if lost := editable.problem(target):
        return lost
    return "" if params.make_single_user else editable.shared(target, (source, *targets))


def source_warnings(body: Body, native_report: dict[str, Any]) -> list[str]:
    """About the source, worth a look; the native report is that of any of its garments."""
    found = [
        sentence for sentence in (_left_out(body), _source_mirror(body), _shaped(body), _envelopes(body)) if sentence
    ]
    found += strangers.warnings(body.objects, body.rigs, body.bones)
    if body.bones and native_report["source_unnormalised"]:
        count = native_report["source_unnormalised"]
        found.append(f"{count} vertices of {body.name} have weights that do not sum to 1, and were normalised")
    if body.bones and native_report["source_unweighted"]:
        count = native_report["source_unweighted"]
        found.append(f"{count} vertices of {body.name} have no weights, so nothing matches there")
    return found


def garment_warnings(body: Body, garment: Garment, params: TransferParams) -> list[str]:
    """About one target, worth a look; asked before it is written."""
    found = (
        _alignment(body, garment),
        _shear(body, garment),
        _mirror(body, garment),
        _unseen(garment),
        _pose(body, garment, params),
        _rig(body, garment),
        _other_bones(body, garment, params),
        _sharing(garment, params),
    )
    return [sentence for sentence in found if sentence]


def _alignment(body: Body, garment: Garment) -> str:
    a, b = body.geometry, garment.shape.geometry
    diagonal = float(np.linalg.norm(a.size))
    (a_low, a_high), (b_low, b_high) = a.bounds, b.bounds
    gap = np.maximum(a_low - b_high, b_low - a_high).max()
    if gap > 0.05 * diagonal or not 0.002 * diagonal < np.linalg.norm(b.size) < 3 * diagonal:
        return f"{garment.object.name} and {body.object.name} hardly overlap: are they aligned and of one scale?"
    return ""


def _shear(body: Body, garment: Garment) -> str:
    sheared = [obj.name for obj in (body.object, garment.object) if mesh.is_sheared(obj)]
    if not sheared:
        return ""
    return f"The scale of a parent shears {' and '.join(sheared)}: apply it if the angles of the match look wrong"


def _mirror(body: Body, garment: Garment) -> str:
    shape = garment.shape
    return mirror.warning(garment.object, shape.matrix, shape.geometry.positions, body.armature, body.opposite)


def _envelopes(body: Body) -> str:
    """What moves the body beside its weights moves no garment in the same way."""
    for obj in body.objects:
        phrase = armature.envelopes(obj)
        if phrase:
            return (
                f"{obj.name} {phrase}, which its weights do not tell, so garments will move otherwise: "
                "bind it by Vertex Groups alone and transfer again"
            )
    return ""


def _left_out(body: Body) -> str:
    """Modifiers with which the body would have no surface, or none that has weights."""
    if not body.unseen:
        return ""
    return (
        f"With {body.unseen} there are no faces that have weights, so it was left out: apply it and weight what it "
        "makes if that shape counts"
    )


def _shaped(body: Body) -> str:
    """What shapes the body's pose by places that stay where they are moves no garment in the same way."""
    for obj in body.objects:
        found = stack.shaping_the_pose(obj, body.objects)
        if found:
            return (
                f"The modifier {found[0].name} of {obj.name} comes after the armature and shapes its pose, which no "
                "weights can follow: move it above the Armature modifier"
            )
    return ""


def _source_mirror(body: Body) -> str:
    """Blender's mirroring leaves weights of such names on the side they were painted for."""
    posed = [(obj, modifier) for obj in body.objects for modifier in mirror.after_the_pose(obj)]
    if posed:
        obj, modifier = posed[0]
        return (
            f"The modifier {modifier.name} of {obj.name} comes after the armature and mirrors its pose, which no "
            "weights can follow: move it above the Armature modifier"
        )
    name = sides.unflippable(body.opposite)
    mirrored = [obj for obj in body.objects if mirror.before_the_pose(obj)]
    if not mirrored or not name:
        return ""
    return (
        f"The Mirror modifier of {mirrored[0].name} cannot tell that {body.opposite[name]} mirrors {name}: "
        "both sides of the body follow the bones of one, and so will what is next to it"
    )


def _unseen(garment: Garment) -> str:
    """Shapes that are visible, but of which no vertex of the mesh knows."""
    unseen = garment.shape.unseen
    if not unseen:
        return ""
    one = "the modifier" if len(unseen) == 1 else "the modifiers"
    return (
        f"What {one} {', '.join(unseen)} of {garment.object.name} makes was not taken into account: "
        "apply it if the match should be with the shape it makes"
    )


def _pose(body: Body, garment: Garment, params: TransferParams) -> str:
    """The pose of an armature that carries the body's own counts too, unless it carries the target as well."""
    if params.geometry == "CURRENT" or armature.follows_any(garment.object, body.rigs):
        return ""
    along = set(armature.moving([garment.object])) - set(body.rigs)
    posed = [rig for rig in armature.moving(body.objects) if rig not in along and armature.is_posed(rig)]
    if not posed:
        return ""
    return (
        f"{posed[0].name} is posed, and shapes in rest pose were compared: "
        f"set Geometry to Current if {garment.object.name} was fitted on the posed body, to bind it in this pose"
    )


def _rig(body: Body, garment: Garment) -> str:
    rigs = armature.rigs(garment.object)
    if not rigs or set(rigs) & set(body.rigs):
        return ""
    rig = rigs[0]
    missing = [name for name in body.bones if name in body.chosen and name not in rig.data.bones]
    if not missing:
        return ""
    return f"{rig.name}, which deforms {garment.object.name}, lacks {len(missing)} of the bones, {missing[0]} for one"


def _other_bones(body: Body, garment: Garment, params: TransferParams) -> str:
    """Weights of bones that the body lacks stay, as they move what is the garment's own."""
    if params.groups not in ("BONE_DEFORM", "ALL"):
        return ""
    names = [name for name in garment.names if name not in body.bones and name not in garment.locks]
    if not names or not (vertex_groups.read(garment.object, names).values > 0).any():
        return ""
    return (
        f"{garment.object.name} keeps its weights in {len(names)} groups of bones {body.object.name} lacks "
        f"({names[0]} for one), and the new ones fill what they leave: remove those groups if they should not count"
    )


def _sharing(garment: Garment, params: TransferParams) -> str:
    return "" if params.make_single_user else editable.changes_others(garment.object)
