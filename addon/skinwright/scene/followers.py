"""What moves a mesh beside its weights, or overrules them: told in a phrase each, and ended on demand."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import bpy
import numpy as np
from mathutils import Matrix

from .. import csr
from . import armature, attaching, carried, modifiers, shapes, stack, vertex_groups

# Nodes store weights as they are.
_SAME_WEIGHT = 1e-4


@dataclass(frozen=True)
class Follower:
    """`phrase` continues "the target ..."; `end` makes the weights alone count."""

    phrase: str
    end: Callable[[], None]


@dataclass(frozen=True)
class _Binding:
    """How weights are to act: in armatures `rigs`, as in the modifiers `models` of a source, `as_child` if as a child
    of one too."""

    rigs: list[bpy.types.Object]
    models: list[bpy.types.ArmatureModifier]
    as_child: bool


def others(
    obj: bpy.types.Object, sources: list[bpy.types.Object], groups: Iterable[str], world: Matrix
) -> list[Follower]:
    """Everything beside the new weights that moves `obj` with the character of `sources` or writes its `groups`.

    `world` is where the object is to stay once a parent or constraint lets it go.
    """
    model = sources[0]
    binding = _Binding(armature.rigs(model), armature.modifiers(model), model.parent_type == "ARMATURE")
    return _others(obj, sources, binding, set(groups), world)


def phrases(obj: bpy.types.Object, rig: bpy.types.Object, groups: Iterable[str]) -> list[str]:
    """What beside weights in `groups`, for the bones of `rig`, moves `obj`; or writes these groups."""
    found = _others(obj, [obj], _Binding([rig], [], as_child=False), set(groups), obj.matrix_world.copy())
    return [follower.phrase for follower in found]


def _others(
    obj: bpy.types.Object, sources: list[bpy.types.Object], binding: _Binding, groups: set[str], world: Matrix
) -> list[Follower]:
    return [
        *_parents(obj, sources, world),
        *_constraints(obj, sources, world),
        *_drivers(obj, sources, world),
        *_armatures(obj, binding),
        *_switched_off(obj, binding),
        *_surfaces(obj, sources),
        *_caches(obj),
        *shaping(obj, sources),
        *_overruled(obj, groups),
    ]


def _parents(obj: bpy.types.Object, sources: list[bpy.types.Object], world: Matrix) -> list[Follower]:
    phrase = carried.by_parent(obj, sources)
    if phrase:
        carrier = obj.parent if obj.parent_type == "BONE" else obj.parent.parent
        return [Follower(phrase, partial(_let_go, obj, carrier, world))]
    phrase = carried.by_ancestors(obj, sources)
    if phrase:
        return [Follower(phrase, partial(_let_go, obj, next(iter(armature.rigs(sources[0])), None), world))]
    if armature.deforms_as_parent(obj) and obj.parent.type != "ARMATURE" and carried.is_deformed(obj.parent, sources):
        phrase = f"is deformed as a child of {obj.parent.name}, which follows the pose too"
        return [Follower(phrase, partial(setattr, obj, "parent_type", "OBJECT"))]
    return []


def _let_go(obj: bpy.types.Object, parent: bpy.types.Object | None, world: Matrix) -> None:
    """Parent to another object as a whole, where the mesh stays put."""
    obj.parent, obj.parent_type, obj.parent_bone = parent, "OBJECT", ""
    obj.matrix_parent_inverse = parent.matrix_world.inverted_safe() if parent else Matrix.Identity(4)
    obj.matrix_world = world


def _constraints(obj: bpy.types.Object, sources: list[bpy.types.Object], world: Matrix) -> list[Follower]:
    found = carried.by_constraints(obj, sources)
    return [Follower(phrase, partial(_mute, obj, constraint, world)) for phrase, constraint in found]


def _drivers(obj: bpy.types.Object, sources: list[bpy.types.Object], world: Matrix) -> list[Follower]:
    """Drivers of the object's place by what a pose moves."""
    return [Follower(phrase, partial(_mute, obj, curve, world)) for phrase, curve in carried.by_drivers(obj, sources)]


def _mute(obj: bpy.types.Object, follows: bpy.types.Constraint | bpy.types.FCurve, world: Matrix) -> None:
    follows.mute = True
    obj.matrix_world = world


def _armatures(obj: bpy.types.Object, binding: _Binding) -> list[Follower]:
    """Armature modifiers that are not bound as the source is; ending one removes it."""
    models, rigs = [model for model in binding.models if model.show_viewport], binding.rigs
    found: list[tuple[tuple, tuple[str, bpy.types.ArmatureModifier]]] = []
    seen = [(model.object, _settings(model)) for model in models]
    for modifier in armature.modifiers(obj):
        if not modifier.show_viewport and (modifier.object in rigs or not modifier.show_render):
            continue  # told by _switched_off, or it does nothing
        phrase = _binding_phrase(modifier, models, rigs)
        bound = (modifier.object, _settings(modifier))
        if not phrase and bound not in seen and bound in [b for b, _ in found]:
            phrase = f"is deformed by {modifier.object.name} twice, the second time by the modifier {modifier.name}"
        if bound in seen:
            seen.remove(bound)
        found.append((bound, (phrase, modifier)))
    listed = [Follower(phrase, partial(obj.modifiers.remove, m)) for _, (phrase, m) in found if phrase]
    parent = obj.parent if armature.deforms_as_parent(obj) else None
    if rigs and parent and parent.type == "ARMATURE" and parent not in rigs:
        phrase = f"is deformed as a child of {parent.name} and not by {rigs[0].name}"
        listed.append(Follower(phrase, partial(setattr, obj, "parent_type", "OBJECT")))
    by_modifier = [rig for (rig, _), (phrase, _) in found if not phrase]
    if obj.parent_type == "ARMATURE" and obj.parent in by_modifier and not binding.as_child:
        phrase = f"is deformed by {obj.parent.name} twice, by a modifier and as its child"
        listed.append(Follower(phrase, partial(setattr, obj, "parent_type", "OBJECT")))
    return listed


def _switched_off(obj: bpy.types.Object, binding: _Binding) -> list[Follower]:
    """Armature modifiers that are off where the source's are on; ending one turns it on."""
    found = []
    for modifier in armature.modifiers(obj):
        for name, where in (("show_viewport", "the viewport"), ("show_render", "renders")):
            on = [model.object for model in binding.models if getattr(model, name)] if binding.models else binding.rigs
            if modifier.object in on and not getattr(modifier, name):
                phrase = f"has the modifier {modifier.name}, which is off in {where}"
                found.append(Follower(phrase, partial(_switch_on, modifier)))
                break
    return found


def _switch_on(modifier: bpy.types.Modifier) -> None:
    modifier.show_viewport = modifier.show_render = True


def _binding_phrase(
    modifier: bpy.types.ArmatureModifier,
    models: list[bpy.types.ArmatureModifier],
    rigs: list[bpy.types.Object],
) -> str:
    if rigs and modifier.object not in rigs:
        return f"is deformed by {modifier.object.name} and not by {rigs[0].name}"
    bindings = [_settings(model) for model in models if model.object == modifier.object]
    if _settings(modifier) in bindings or (not bindings and _is_plain(modifier)):
        return ""
    name = f"has the modifier {modifier.name}, which"
    if not modifier.use_vertex_groups:
        return f"{name} binds by bone envelopes and not by groups"
    if modifier.use_bone_envelopes:
        return f"{name} binds by bone envelopes too"
    if modifier.vertex_group:
        return f"{name} acts in the group {modifier.vertex_group} only"
    return f"{name} has other settings than that of {models[0].id_data.name}" if models else ""


def _settings(modifier: bpy.types.ArmatureModifier) -> tuple:
    return tuple(getattr(modifier, name) for name in armature.BINDING)


def _is_plain(modifier: bpy.types.ArmatureModifier) -> bool:
    """Whether it does what armature parenting does: by groups alone, on all of the mesh."""
    return modifier.use_vertex_groups and not modifier.use_bone_envelopes and not modifier.vertex_group


def _surfaces(obj: bpy.types.Object, sources: list[bpy.types.Object]) -> list[Follower]:
    """Modifiers that carry the mesh along with what a pose moves: the source's surface, bones, what hangs on them."""
    found = []
    for modifier in modifiers.used(obj):
        followed = stack.follows_pose(modifier, sources)
        if followed and modifier.type != "ARMATURE" and modifiers.moves(modifier):
            phrase = f"has the modifier {modifier.name}, which follows {followed[0].name} too"
            found.append(Follower(phrase, partial(_hide, modifier)))
    return found


def _caches(obj: bpy.types.Object) -> list[Follower]:
    """Modifiers that put the vertices where a file says, whatever the weights say."""
    playing = [m for m in modifiers.used(obj) if modifiers.plays_a_file(m)]
    return [Follower(f"has the modifier {m.name}, which plays a cache", partial(_hide, m)) for m in playing]


def shaping(obj: bpy.types.Object, sources: list[bpy.types.Object]) -> list[Follower]:
    """Modifiers after the armature that shape its pose as they should shape the mesh at rest."""
    return [
        Follower(
            f"has the modifier {modifier.name} after its armature, so that it shapes the pose and not the mesh at rest",
            partial(_lift, obj, modifier.name),
        )
        for modifier in stack.shaping_the_pose(obj, sources)
    ]


def _lift(obj: bpy.types.Object, name: str) -> None:
    """Put the armature below this modifier, or the modifier above the armature."""
    first = next((i for i, m in enumerate(obj.modifiers) if m.type == "ARMATURE" and m.object), None)
    if first is not None and first < obj.modifiers.find(name):
        stack.move(obj, name, first)
    if armature.deforms_as_parent(obj) and obj.parent.type == "ARMATURE":
        attaching.bind(obj, obj.parent)
        obj.parent_type = "OBJECT"


def _overruled(obj: bpy.types.Object, groups: set[str]) -> list[Follower]:
    return [
        Follower(f"has the modifier {m.name}, which overrules the weights written", partial(_hide, m))
        for m in overruling(obj, groups)
    ]


def overruling(obj: bpy.types.Object, groups: set[str]) -> list[bpy.types.Modifier]:
    """Modifiers that change the groups before the armature reads them."""
    found = []
    for modifier in modifiers.used(obj):
        if modifier.type == "ARMATURE":
            break
        by_settings = modifiers.transfers_weights(modifier) or modifiers.written_group(modifier) in groups
        if by_settings or _rewrites(obj, modifier, groups):
            found.append(modifier)
    return found


def _rewrites(obj: bpy.types.Object, modifier: bpy.types.Modifier, groups: set[str]) -> bool:
    """Whether nodes change the weights in these groups, which only their result tells, or lose them."""
    if modifier.type != "NODES" or not modifier.show_viewport:
        return False
    names = sorted(groups)
    before, after = vertex_groups.read(obj, names), shapes.weights_after(obj, modifier, names)
    if len(before.indptr) != len(after.indptr):
        return bool((before.values > 0).any()) and not (after.values > 0).any()
    before, after = (csr.keep_entries(rows, rows.values > 0) for rows in (before, after))
    same = np.array_equal(before.indptr, after.indptr) and np.array_equal(before.bones, after.bones)
    return not same or bool(np.abs(before.values - after.values).max(initial=0) > _SAME_WEIGHT)


def _hide(modifier: bpy.types.Modifier) -> None:
    modifier.show_viewport = modifier.show_render = False
