"""The settings of a transfer as plain values: what the panel, a script and a JSON file have in common."""

import math
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, get_args, get_origin

Groups = Literal["BONE_DEFORM", "BONE_SELECT", "ALL", "ACTIVE"]


@dataclass(frozen=True)
class Mask:
    """A vertex group read as match mask, see scene.mask."""

    group: str
    reading: Literal["STEER", "PAINTED"] = "STEER"
    threshold: float = 0.5
    invert: bool = False


@dataclass(frozen=True)
class TransferParams:
    """Angles in radians, absolute lengths in world units; an absolute length wins over its relative form.

    `mask` None leaves each target its own, as picked in the panel. `threads` 0 takes all.
    """

    groups: Groups = "BONE_DEFORM"
    evaluated: bool = False
    method: Literal["paper", "confidence"] = "paper"
    softness: float = 0.7
    max_distance: float | None = None
    relative_max_distance: float = 0.05
    max_normal_angle: float = math.radians(35)
    match_flipped_normals: bool = True
    mask: Mask | None = None
    smoothness_length: float | None = None
    relative_smoothness_length: float = 0.05
    smoothing_iterations: int = 0
    smoothing_factor: float = 0.2
    max_influences: int = 0
    island_policy: Literal["bridge", "nearest", "rigid", "skip"] = "bridge"
    small_islands: Literal["auto", "rigid", "solved"] = "auto"
    mix_factor: float = 1.0
    selected_only: bool = False
    add_armature: bool = True
    make_single_user: bool = False
    threads: int = 0

    def native(self) -> dict[str, Any]:
        """The keyword arguments of the native transfer; the mask is the caller's."""
        names = (
            "method softness max_distance relative_max_distance max_normal_angle match_flipped_normals "
            "smoothness_length relative_smoothness_length smoothing_iterations smoothing_factor max_influences "
            "island_policy small_islands threads"
        )
        return {name: getattr(self, name) for name in names.split()}


def from_json(settings: dict[str, Any]) -> TransferParams:
    """Settings from a JSON object: the names of TransferParams, `max_normal_angle` in degrees, `mask` an object.

    Raises ValueError for a name that is none of them or a value of another type.
    """
    values = _checked(TransferParams, settings)
    if values.get("mask") is not None:
        values["mask"] = Mask(**_checked(Mask, settings["mask"]))
    if "max_normal_angle" in values:
        values["max_normal_angle"] = math.radians(values["max_normal_angle"])
    return TransferParams(**values)


def to_json(params: TransferParams) -> dict[str, Any]:
    """The inverse of from_json, so that a report tells how it was made."""
    values = vars(replace(params, max_normal_angle=math.degrees(params.max_normal_angle)))
    return values | {"mask": vars(params.mask) if params.mask else None}


def _checked(kind: type, settings: Any) -> dict[str, Any]:
    if not isinstance(settings, dict):
        raise ValueError(f"settings must be a JSON object, not {settings!r}")
    known = {field.name: field.type for field in fields(kind)}
    for name, value in settings.items():
        if name not in known:
            raise ValueError(f"there is no setting {name}; there are {', '.join(sorted(known))}")
        if not _fits(value, known[name]):
            raise ValueError(f"setting {name} cannot be {value!r}")
    return dict(settings)


def _fits(value: Any, kind: Any) -> bool:
    if get_origin(kind) is Literal:
        return value in get_args(kind)
    if get_args(kind):
        return any(_fits(value, option) for option in get_args(kind))
    if kind is Mask:
        return isinstance(value, dict)
    if isinstance(value, bool) or kind is bool:
        return isinstance(value, bool) and kind is bool
    return isinstance(value, (int, float) if kind is float else kind)
