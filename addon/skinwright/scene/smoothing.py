"""Corrective Smooth modifiers: whether a mesh has one that tidies up its pose, and giving another mesh the same."""

import bpy

from . import stack

_SETTINGS = ("factor", "iterations", "scale", "smooth_type", "use_only_smooth", "use_pin_boundary")


def after_the_pose(obj: bpy.types.Object) -> bpy.types.CorrectiveSmoothModifier | None:
    """The first that is on and comes after an armature."""
    posed = obj.parent_type == "ARMATURE"
    for modifier in obj.modifiers:
        posed = posed or modifier.type == "ARMATURE"
        if posed and modifier.type == "CORRECTIVE_SMOOTH" and modifier.show_viewport:
            return modifier
    return None


def copy(obj: bpy.types.Object, model: bpy.types.CorrectiveSmoothModifier) -> None:
    """Give `obj` a Corrective Smooth of the same settings right after its armatures, with its own rest shape."""
    armatures = [index for index, modifier in enumerate(obj.modifiers) if modifier.type == "ARMATURE"]
    modifier = obj.modifiers.new(model.name, "CORRECTIVE_SMOOTH")
    name = modifier.name
    stack.move(obj, name, armatures[-1] + 1 if armatures else 0)
    modifier = obj.modifiers[name]  # moving exchanges what the modifiers point to
    modifier.rest_source = "ORCO"
    for name in _SETTINGS:
        setattr(modifier, name, getattr(model, name))
