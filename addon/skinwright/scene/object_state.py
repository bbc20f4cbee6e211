"""What an operation may change of an object: weights, mesh, rest shape, modifiers, constraints, parent, place.

Everything is brought back if the operation fails halfway, whichever line of it and whichever of its objects.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import bpy

from . import rest_shape, weight_state
from .rest_shape import RestShape
from .weight_state import WeightState

_PLACE: tuple[str, ...] = ("parent", "parent_type", "parent_bone", "matrix_parent_inverse", "location", "scale")
_PLACE += ("rotation_euler", "rotation_quaternion", "rotation_axis_angle")


@dataclass(frozen=True)
class _Modifier:
    """Settings by name, without those that Blender keeps for itself."""

    name: str
    kind: str
    settings: dict[str, Any]


@dataclass(frozen=True)
class _State:
    object: bpy.types.Object
    mesh: bpy.types.Mesh
    weights: WeightState
    shape: RestShape | None
    modifiers: list[_Modifier]
    muted: dict[str, bool]
    place: dict[str, Any]


@contextmanager
def all_or_nothing(objects: Sequence[bpy.types.Object], *, reshaped: Sequence[bpy.types.Object] = ()) -> Iterator[None]:
    """Whatever exception leaves the block, `objects` are as they were before; the rest shape of those in `reshaped`."""
    before = [_capture(obj, obj in reshaped) for obj in objects]
    try:
        yield
    except BaseException:
        for state in before:
            _bring_back(state)
        raise


def _capture(obj: bpy.types.Object, with_shape: bool) -> _State:
    return _State(
        object=obj,
        mesh=obj.data,
        weights=weight_state.capture(obj),
        shape=rest_shape.read(obj) if with_shape else None,
        modifiers=[_Modifier(modifier.name, modifier.type, _settings(modifier)) for modifier in obj.modifiers],
        muted={constraint.name: constraint.mute for constraint in obj.constraints},
        place={name: _value(getattr(obj, name)) for name in _PLACE},
    )


def _settings(modifier: bpy.types.Modifier) -> dict[str, Any]:
    names = [prop.identifier for prop in modifier.bl_rna.properties if not prop.is_readonly]
    return {name: _value(getattr(modifier, name)) for name in names}


def _value(value: Any) -> Any:
    """Vectors and matrices by value: Blender's own show what is there later."""
    return value.copy() if hasattr(value, "copy") and not isinstance(value, bpy.types.ID) else value


def _bring_back(state: _State) -> None:
    """Part by part: what cannot be brought back, say of an object that is gone, does not hinder the rest."""
    parts: list[Callable[[_State], None]] = [_mesh_back, _modifiers_back, _place_back, _weights_back, _shape_back]
    for part in parts:
        try:
            part(state)
        except (ReferenceError, RuntimeError, TypeError, AttributeError) as error:
            print(f"Skinwright: a part of an object could not be brought back: {error}", file=sys.stderr)


def _mesh_back(state: _State) -> None:
    copy = state.object.data
    if copy != state.mesh:
        state.object.data = state.mesh
        if copy.users == 0:
            bpy.data.meshes.remove(copy)


def _modifiers_back(state: _State) -> None:
    obj, names = state.object, {modifier.name for modifier in state.modifiers}
    for modifier in [m for m in obj.modifiers if m.name not in names]:
        obj.modifiers.remove(modifier)
    for index, kept in enumerate(state.modifiers):
        modifier = obj.modifiers.get(kept.name) or obj.modifiers.new(kept.name, kept.kind)
        obj.modifiers.move(list(obj.modifiers).index(modifier), index)
        now = _settings(modifier)
        for name, value in kept.settings.items():
            if now[name] != value:
                setattr(modifier, name, value)


def _place_back(state: _State) -> None:
    for constraint in state.object.constraints:
        if constraint.mute != state.muted.get(constraint.name, constraint.mute):
            constraint.mute = not constraint.mute
    for name, value in state.place.items():
        if _value(getattr(state.object, name)) != value:
            setattr(state.object, name, value)


def _weights_back(state: _State) -> None:
    weight_state.apply(state.object, state.weights)


def _shape_back(state: _State) -> None:
    if state.shape is not None:
        rest_shape.restore(state.object, state.shape)
        state.object.data.update()
