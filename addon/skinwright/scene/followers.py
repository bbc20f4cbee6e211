"""What moves a mesh beside its weights, or overrules them: told in a phrase each, and ended on demand."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import bpy
from mathutils import Matrix

from . import armature, modifiers

# Modifiers that take the shape of other objects; all others look at their places at most.
_FOLLOWS_A_SHAPE = {"BOOLEAN", "CURVE", "LATTICE", "MESH_DEFORM", "NODES", "SHRINKWRAP", "SURFACE_DEFORM"}


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
        *_drivers(obj, world),
        *_armatures(obj, sources),
        *_switched_off(obj, sources),
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
        targets = armature.constraint_targets(constraint)
        followed = [target for target in targets if _is_moved(target) or _is_bone(target, constraint)]
        if followed:
            phrase = f"has the constraint {constraint.name}, which follows {followed[0].name}"
            found.append(Follower(phrase, partial(_mute, obj, constraint, world)))
    return found


def _drivers(obj: bpy.types.Object, world: Matrix) -> list[Follower]:
    """Drivers of the object's place by what a pose moves."""
    found = []
    for curve in obj.animation_data.drivers if obj.animation_data else ():
        if curve.mute or not curve.data_path.removeprefix("delta_").startswith(("location", "rotation", "scale")):
            continue
        targets = [target for variable in curve.driver.variables for target in variable.targets]
        bones = [t.id for t in targets if isinstance(t.id, bpy.types.Object) and (t.bone_target or _is_moved(t.id))]
        bones += [t.id for t in targets if isinstance(t.id, bpy.types.Object) and "pose.bones" in t.data_path]
        if bones:
            phrase = f"has a driver on {curve.data_path}, which follows {bones[0].name}"
            found.append(Follower(phrase, partial(_mute, obj, curve, world)))
    return found


def _is_bone(target: bpy.types.Object, constraint: bpy.types.Constraint) -> bool:
    """Whether the constraint follows a bone of the armature `target`."""
    return target.type == "ARMATURE" and (constraint.type == "ARMATURE" or bool(getattr(constraint, "subtarget", "")))


def _is_moved(target: bpy.types.Object) -> bool:
    """Whether a pose moves the object as a whole: it hangs on a bone, by parents or constraints."""
    ancestor: bpy.types.Object | None = target
    while ancestor:
        bones = (_is_bone(other, c) for c in ancestor.constraints for other in armature.constraint_targets(c))
        if (ancestor.parent and ancestor.parent_type == "BONE") or any(bones):
            return True
        ancestor = ancestor.parent
    return False


def _mute(obj: bpy.types.Object, follows: bpy.types.Constraint | bpy.types.FCurve, world: Matrix) -> None:
    follows.mute = True
    obj.matrix_world = world


def _armatures(obj: bpy.types.Object, sources: list[bpy.types.Object]) -> list[Follower]:
    """Armature modifiers that are not bound as the source is; ending one removes it."""
    models = [model for model in armature.modifiers(sources[0]) if model.show_viewport]
    found: list[tuple[tuple, tuple[str, bpy.types.ArmatureModifier]]] = []
    seen = [(model.object, _binding(model)) for model in models]
    for modifier in armature.modifiers(obj):
        if not modifier.show_viewport:
            continue
        phrase = _binding_phrase(modifier, models, armature.rigs(sources[0]))
        bound = (modifier.object, _binding(modifier))
        if not phrase and bound not in seen and bound in [b for b, _ in found]:
            phrase = f"is deformed by {modifier.object.name} twice, the second time by the modifier {modifier.name}"
        if bound in seen:
            seen.remove(bound)
        found.append((bound, (phrase, modifier)))
    listed = [Follower(phrase, partial(obj.modifiers.remove, m)) for _, (phrase, m) in found if phrase]
    by_modifier = [rig for (rig, _), (phrase, _) in found if not phrase]
    if obj.parent_type == "ARMATURE" and obj.parent in by_modifier and sources[0].parent_type != "ARMATURE":
        phrase = f"is deformed by {obj.parent.name} twice, by a modifier and as its child"
        listed.append(Follower(phrase, partial(setattr, obj, "parent_type", "OBJECT")))
    return listed


def _switched_off(obj: bpy.types.Object, sources: list[bpy.types.Object]) -> list[Follower]:
    """Armature modifiers that are off where the source's are on; ending one turns it on."""
    models = armature.modifiers(sources[0])
    found = []
    for modifier in armature.modifiers(obj):
        for name, where in (("show_viewport", "the viewport"), ("show_render", "renders")):
            on = [model for model in models if getattr(model, name) and model.object == modifier.object]
            if on and not getattr(modifier, name):
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
    """Modifiers that carry the mesh along with what a pose moves: the source's surface, bones, what hangs on them."""
    found = []
    for modifier in modifiers.shown(obj):
        followed = [other for other in _looked_at(modifier) if _moves(other, modifier, sources)]
        if followed and modifier.type != "ARMATURE" and modifiers.moves(modifier):
            phrase = f"has the modifier {modifier.name}, which follows {followed[0].name} too"
            found.append(Follower(phrase, partial(_hide, modifier)))
    return found


def _looked_at(modifier: bpy.types.Modifier) -> list[bpy.types.Object]:
    """The objects that a modifier's settings, inputs and nodes name."""
    pointers = [p for p in modifier.bl_rna.properties if p.type == "POINTER" and p.fixed_type.identifier == "Object"]
    found = [getattr(modifier, pointer.identifier) for pointer in pointers]
    if modifier.type == "NODES" and modifier.node_group:
        sockets = [socket for node in modifier.node_group.nodes for socket in node.inputs if socket.type == "OBJECT"]
        found += [*_node_inputs(modifier), *(socket.default_value for socket in sockets)]
    return [other for other in dict.fromkeys(found) if other]


def _node_inputs(modifier: bpy.types.NodesModifier) -> list[bpy.types.Object | None]:
    """The objects given to a node tree. Blender 5.2 keeps inputs as properties, those before as ID properties."""
    sockets = [item for item in modifier.node_group.interface.items_tree if item.item_type == "SOCKET"]
    names = [s.identifier for s in sockets if s.in_out == "INPUT" and s.socket_type == "NodeSocketObject"]
    if hasattr(modifier, "properties"):
        inputs = [getattr(modifier.properties.inputs, name, None) for name in names]
        return [getattr(given, "value", None) for given in inputs]
    return [modifier.get(name) for name in names]


def _moves(other: bpy.types.Object, modifier: bpy.types.Modifier, sources: list[bpy.types.Object]) -> bool:
    """Whether a pose changes what the modifier sees of the object."""
    if other.type == "ARMATURE":
        return modifier.type == "HOOK"
    if _is_moved(other):
        return True
    hooked = any(m.type == "HOOK" and m.object and m.object.type == "ARMATURE" for m in other.modifiers)
    return modifier.type in _FOLLOWS_A_SHAPE and (other in sources or bool(armature.rigs(other)) or hooked)


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
