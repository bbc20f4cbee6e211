"""Letting an armature deform a mesh, at the place in its stack of modifiers where the pose belongs."""

import bpy

from . import armature, stack


def attach(obj: bpy.types.Object, source: bpy.types.Object) -> list[str]:
    """Let the armatures that deform `source` deform `obj`: by modifiers of the same settings. Returns their names."""
    place = stack.place_of_armature(obj, [source])
    models = [model for model in armature.modifiers(source) if model.show_viewport]
    added = []
    for rig in [m.object for m in models] or [armature.find(source)]:
        added.append(_add_modifier(obj, rig, place))
        place += 1
    for modifier, model in zip(added, models, strict=False):
        for name in armature.BINDING:
            setattr(modifier, name, getattr(model, name))
    return [modifier.name for modifier in added]


def bind(obj: bpy.types.Object, rig: bpy.types.Object, *, make_parent: bool = False) -> None:
    """Let armature `rig` deform `obj`; and carry it along if it has no parent and `make_parent`."""
    _add_modifier(obj, rig, stack.place_of_armature(obj, []))
    if make_parent and obj.parent is None:
        obj.parent = rig
        obj.matrix_parent_inverse = rig.matrix_world.inverted_safe()


def _add_modifier(obj: bpy.types.Object, rig: bpy.types.Object, place: int) -> bpy.types.ArmatureModifier:
    name = obj.modifiers.new(rig.name, "ARMATURE").name
    stack.move(obj, name, place)
    modifier = obj.modifiers[name]  # moving exchanges what the modifiers point to
    modifier.object = rig
    return modifier
