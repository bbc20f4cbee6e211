"""What the operators of refinement work on, and why they cannot."""

from bpy.types import Context, Object

from ... import native
from ...scene import armature
from ..modal import brush_session

MODES = {"OBJECT", "POSE"}


def target(context: Context) -> Object | None:
    """The active mesh; in Pose mode the selected one, or the only one, that the armature deforms."""
    active = context.active_object
    if active is None or active.type == "MESH":
        return active
    meshes = [obj for obj in context.view_layer.objects if obj.type == "MESH" and armature.find(obj) == active]
    chosen = [obj for obj in meshes if obj.select_get()] or meshes
    return chosen[0] if len(chosen) == 1 else None


def found(context: Context) -> Object:
    """The target, which `refusal` has seen."""
    obj = target(context)
    assert obj is not None
    return obj


def refusal(context: Context, purpose: str) -> str:
    """Why nothing can be refined now, or nothing; `purpose` ends the sentence."""
    if native.problem() or brush_session.refusal():
        return native.problem() or brush_session.refusal()
    if context.mode not in MODES:
        return f"Go to Object or Pose mode to {purpose}"
    obj = target(context)
    if obj is None:
        return f"Select the mesh to {purpose}"
    return "" if armature.find(obj) else f"{obj.name} has no armature: give it an Armature modifier"


def chosen_joints(context: Context, obj: Object) -> set[str]:
    """The selected bones, in Pose mode."""
    rig = armature.find(obj)
    return armature.selected_bones(rig) if context.mode == "POSE" and rig else set()
