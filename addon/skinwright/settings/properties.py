"""Blender properties made from the declarations of the features, and read back as plain values."""

from collections.abc import Iterable
from typing import Any, get_args

import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ..declared import Params, Setting, declared


def properties(kind: type[Params], names: Iterable[str] | None = None) -> dict[str, Any]:
    """The annotations of a class that has these settings, or all that a property can hold."""
    chosen = declared(kind)
    if names is not None:
        chosen = {name: chosen[name] for name in names}
    defaults = {name: kind.__dataclass_fields__[name].default for name in chosen}  # type: ignore[attr-defined]
    made = {name: as_property(hint, one, defaults[name]) for name, (hint, one) in chosen.items()}
    return {name: prop for name, prop in made.items() if prop is not None}


def as_property(hint: Any, one: Setting, default: Any) -> Any:
    """One property; None for a setting that is an object of several."""
    texts = {"name": one.label, "description": one.sentence}
    if one.choices:
        items = [(value.upper(), *labels) for value, labels in one.choices.items()]
        return EnumProperty(**texts, items=items, default=default.upper())
    types = {hint, *get_args(hint)}
    if bool in types:
        return BoolProperty(**texts, default=default)
    if types & {int, float}:
        return _number(int in types, texts, one, default)
    return StringProperty(**texts) if str in types else None


def _number(whole: bool, texts: dict[str, str], one: Setting, default: Any) -> Any:
    span = {"min": one.least, "max": one.most, "default": one.shown if default is None else default}
    span["soft_min"] = one.least if one.soft_least is None else one.soft_least
    span["soft_max"] = one.most if one.soft_most is None else one.soft_most
    if whole:
        return IntProperty(**texts, **{key: int(value) for key, value in span.items()})
    return FloatProperty(**texts, **span, subtype=one.unit, precision=one.precision, step=one.step)


def values(settings: Any, kind: type[Params]) -> dict[str, Any]:
    """The plain values of the settings that `settings` has as properties."""
    return {
        name: _plain(getattr(settings, name), hint, one)
        for name, (hint, one) in declared(kind).items()
        if hasattr(settings, name) and not (one.shown is not None)
    }


def _plain(value: Any, hint: Any, one: Setting) -> Any:
    if one.choices:
        return next(choice for choice in one.choices if choice.upper() == value)
    return decimal(value, one) if isinstance(value, float) else value


def decimal(value: float, one: Setting) -> float:
    """The number the artist reads: Blender keeps 32 bits, and 0.05 would come out as 0.0500000007."""
    for exact in (one.least, one.most):
        if np.float32(value) == np.float32(exact):
            return float(exact)
    return float(str(np.float32(value)))


def last_used(properties: Any, settings: Any, names: Iterable[str]) -> None:
    """Make what an operator was given, by its redo panel or by a script, the panel's settings."""
    for name in names:
        if properties.is_property_set(name) and getattr(settings, name) != getattr(properties, name):
            setattr(settings, name, getattr(properties, name))


def reset(settings: Any, names: Iterable[str]) -> None:
    """Give settings their defaults."""
    for name in names:
        settings.property_unset(name)
