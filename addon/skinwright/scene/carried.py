"""What moves an object as a whole with a pose: parents, constraints and drivers, its own and those of its ancestors."""

from collections.abc import Iterator, Sequence

import bpy

from . import armature

# Constraints that follow the surface or the course of another object, and not only its place.
_FOLLOWS_A_SHAPE = {"CLAMP_TO", "FOLLOW_PATH", "SHRINKWRAP"}

# The objects that have been looked at on the way, so that a circle of constraints ends.
_Seen = frozenset[bpy.types.Object]


def by_parent(obj: bpy.types.Object, sources: Sequence[bpy.types.Object]) -> str:
    """A phrase that continues "the object ..." if its parent carries it along with a pose, or nothing."""
    parent = obj.parent
    if parent is None:
        return ""
    if obj.parent_type == "BONE" and parent.type == "ARMATURE":
        return f"is parented to the bone {obj.parent_bone} of {parent.name}"
    if obj.parent_type in ("VERTEX", "VERTEX_3") and is_deformed(parent, sources):
        return f"is parented to vertices of {parent.name}"
    return ""


def by_constraints(
    obj: bpy.types.Object, sources: Sequence[bpy.types.Object], seen: _Seen = frozenset()
) -> Iterator[tuple[str, bpy.types.Constraint]]:
    """The constraints by which the object follows a pose, with a phrase each."""
    for constraint in obj.constraints:
        for target in armature.constraint_targets(constraint):
            if _is_bone(target, constraint) or _is_spot(target, constraint, sources) or _moves(target, sources, seen):
                yield f"has the constraint {constraint.name}, which follows {target.name}", constraint
                break


def by_drivers(
    obj: bpy.types.Object, sources: Sequence[bpy.types.Object], seen: _Seen = frozenset()
) -> Iterator[tuple[str, bpy.types.FCurve]]:
    """The drivers of the object's place that look at what a pose moves, with a phrase each."""
    for curve in obj.animation_data.drivers if obj.animation_data else ():
        if curve.mute or not curve.data_path.removeprefix("delta_").startswith(("location", "rotation", "scale")):
            continue
        targets = [target for variable in curve.driver.variables for target in variable.targets]
        targets = [target for target in targets if isinstance(target.id, bpy.types.Object)]
        for target in targets:
            if target.bone_target or "pose.bones" in target.data_path or _moves(target.id, sources, seen):
                yield f"has a driver on {curve.data_path}, which follows {target.id.name}", curve
                break


def by_ancestors(obj: bpy.types.Object, sources: Sequence[bpy.types.Object], seen: _Seen = frozenset()) -> str:
    """A phrase if the object hangs on one that a pose moves, or nothing. Armatures of the sources carry them too."""
    own = armature.rigs(sources[0]) if sources else []
    ancestor = obj.parent
    while ancestor and ancestor not in own and ancestor not in seen:
        found = _first(ancestor, sources, seen)
        if found:
            return f"hangs on {ancestor.name}, which {found}"
        ancestor = ancestor.parent
    return ""


def is_carried(obj: bpy.types.Object, sources: Sequence[bpy.types.Object], seen: _Seen = frozenset()) -> bool:
    """Whether a pose moves the object as a whole."""
    return bool(_first(obj, sources, seen) or by_ancestors(obj, sources, seen | {obj}))


def is_deformed(obj: bpy.types.Object, sources: Sequence[bpy.types.Object]) -> bool:
    """Whether a pose changes the shape of the object."""
    hooked = any(m.type == "HOOK" and m.object and m.object.type == "ARMATURE" for m in obj.modifiers)
    return obj in sources or bool(armature.rigs(obj)) or hooked


def _first(obj: bpy.types.Object, sources: Sequence[bpy.types.Object], seen: _Seen) -> str:
    """The first reason for which a pose moves the object itself."""
    seen = seen | {obj}
    found = by_parent(obj, sources)
    found = found or next((phrase for phrase, _ in by_constraints(obj, sources, seen)), "")
    return found or next((phrase for phrase, _ in by_drivers(obj, sources, seen)), "")


def _moves(target: bpy.types.Object, sources: Sequence[bpy.types.Object], seen: _Seen) -> bool:
    return target not in seen and is_carried(target, sources, seen)


def _is_bone(target: bpy.types.Object, constraint: bpy.types.Constraint) -> bool:
    """Whether the constraint follows a bone of the armature `target`."""
    return target.type == "ARMATURE" and (constraint.type == "ARMATURE" or bool(getattr(constraint, "subtarget", "")))


def _is_spot(target: bpy.types.Object, constraint: bpy.types.Constraint, sources: Sequence[bpy.types.Object]) -> bool:
    """Whether the constraint follows vertices, or the surface, of an object that a pose deforms."""
    follows = constraint.type in _FOLLOWS_A_SHAPE or bool(getattr(constraint, "subtarget", ""))
    return target.type != "ARMATURE" and follows and is_deformed(target, sources)
