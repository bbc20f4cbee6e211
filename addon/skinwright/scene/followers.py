"""What moves a mesh beside its weights, or overrules them: told in a phrase each, and ended on demand."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import bpy
from mathutils import Matrix

from . import armature, modifiers

_FOLLOWS_A_SURFACE = {"SURFACE_DEFORM": "target", "MESH_DEFORM": "object"}


@dataclass(frozen=True)
class Follower:
    """`phrase` continues "the target ..."; `end` makes the weights alone count."""

    phrase: str
    end: Callable[[], None]


def others(
    obj: bpy.types.Object, sources: list[bpy.types.Object], groups: Iterable[str], world: Matrix
) -> list[Follower]:
    """Everything beside the new weights that moves `obj` with the character of `sources` or writes its `groups`.

    `world` is where the object is to stay once a parent or constraint lets it go.
    """
    return [
        *_parents(obj, sources, world),
        *_constraints(obj, world),
        *_armatures(obj, sources),
        *_surfaces(obj, sources),
        *_overruling(obj, set(groups)),
    ]


def _parents(obj: bpy.types.Object, sources: list[bpy.types.Object], world: Matrix) -> list[Follower]:
    parent = obj.parent
    if parent is None:
        return []
    if obj.parent_type == "BONE" and parent.type == "ARMATURE":
        phrase = f"is parented to the bone {obj.parent_bone} of {parent.name}"
        return [Follower(phrase, partial(_let_go, obj, parent, world))]
    if obj.parent_type in ("VERTEX", "VERTEX_3") and parent in sources:
        return [Follower(f"is parented to vertices of {parent.name}", partial(_let_go, obj, parent.parent, world))]
    carried = parent
    while carried.parent and carried.parent_type != "BONE":
        carried = carried.parent
    if carried.parent and carried.parent_type == "BONE":
        phrase = f"hangs on {carried.name}, which is parented to the bone {carried.parent_bone}"
        return [Follower(phrase, partial(_let_go, obj, carried.parent, world))]
    return []


def _let_go(obj: bpy.types.Object, parent: bpy.types.Object | None, world: Matrix) -> None:
    """Parent to another object as a whole, where the mesh stays put."""
    obj.parent, obj.parent_type, obj.parent_bone = parent, "OBJECT", ""
    obj.matrix_parent_inverse = parent.matrix_world.inverted_safe() if parent else Matrix.Identity(4)
    obj.matrix_world = world


def _constraints(obj: bpy.types.Object, world: Matrix) -> list[Follower]:
    found = []
    for constraint in obj.constraints:
        followed = [target for target in armature.constraint_targets(constraint) if _is_carried(target, constraint)]
        if followed:
            phrase = f"has the constraint {constraint.name}, which follows {followed[0].name}"
            found.append(Follower(phrase, partial(_mute, obj, constraint, world)))
    return found


def _is_carried(target: bpy.types.Object, constraint: bpy.types.Constraint) -> bool:
    """Whether a pose moves what the constraint follows: a bone, or what is parented to one."""
    if target.type == "ARMATURE":
        return constraint.type == "ARMATURE" or bool(getattr(constraint, "subtarget", ""))
    ancestor: bpy.types.Object | None = target
    while ancestor:
        if ancestor.parent_type == "BONE":
            return True
        ancestor = ancestor.parent
    return False


def _mute(obj: bpy.types.Object, constraint: bpy.types.Constraint, world: Matrix) -> None:
    constraint.mute = True
    obj.matrix_world = world


def _armatures(obj: bpy.types.Object, sources: list[bpy.types.Object]) -> list[Follower]:
    """Armature modifiers that are not bound as the source is; ending one removes it."""
    models = [model for model in armature.modifiers(sources[0]) if model.show_viewport]
    found = []
    for modifier in armature.modifiers(obj):
        phrase = _binding_phrase(modifier, models, armature.rigs(sources[0])) if modifier.show_viewport else ""
        if phrase:
            found.append(Follower(phrase, partial(obj.modifiers.remove, modifier)))
    return found


def _binding_phrase(
    modifier: bpy.types.ArmatureModifier,
    models: list[bpy.types.ArmatureModifier],
    rigs: list[bpy.types.Object],
) -> str:
    if rigs and modifier.object not in rigs:
        return f"is deformed by {modifier.object.name} and not by {rigs[0].name}"
    bindings = [_binding(model) for model in models if model.object == modifier.object]
    if _binding(modifier) in bindings or (not bindings and _is_plain(modifier)):
        return ""
    name = f"has the modifier {modifier.name}, which"
    if not modifier.use_vertex_groups:
        return f"{name} binds by bone envelopes and not by groups"
    if modifier.use_bone_envelopes:
        return f"{name} binds by bone envelopes too"
    if modifier.vertex_group:
        return f"{name} acts in the group {modifier.vertex_group} only"
    return f"{name} has other settings than that of {models[0].id_data.name}" if models else ""


def _binding(modifier: bpy.types.ArmatureModifier) -> tuple:
    return tuple(getattr(modifier, name) for name in armature.BINDING)


def _is_plain(modifier: bpy.types.ArmatureModifier) -> bool:
    """Whether it does what armature parenting does: by groups alone, on all of the mesh."""
    return modifier.use_vertex_groups and not modifier.use_bone_envelopes and not modifier.vertex_group


def _surfaces(obj: bpy.types.Object, sources: list[bpy.types.Object]) -> list[Follower]:
    """Modifiers that carry the mesh along with the source's surface, or hook it to bones."""
    found = []
    for modifier in modifiers.shown(obj):
        followed = getattr(modifier, _FOLLOWS_A_SURFACE.get(modifier.type, ""), None)
        if modifier.type == "HOOK" and modifier.object and modifier.object.type == "ARMATURE":
            followed = modifier.object
        if followed and (followed in sources or armature.rigs(followed) or followed.type == "ARMATURE"):
            phrase = f"has the modifier {modifier.name}, which follows {followed.name} too"
            found.append(Follower(phrase, partial(_hide, modifier)))
    return found


def _overruling(obj: bpy.types.Object, groups: set[str]) -> list[Follower]:
    """Modifiers that change the groups before the armature reads them."""
    found = []
    for modifier in modifiers.shown(obj):
        if modifier.type == "ARMATURE":
            break
        if modifiers.transfers_weights(modifier) or modifiers.written_group(modifier) in groups:
            phrase = f"has the modifier {modifier.name}, which overrules the weights written"
            found.append(Follower(phrase, partial(_hide, modifier)))
    return found


def _hide(modifier: bpy.types.Modifier) -> None:
    modifier.show_viewport = modifier.show_render = False
