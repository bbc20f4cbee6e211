"""Settings, each declared once with name, default, range, unit and sentence; no Blender here.

The settings of a feature are one frozen dataclass derived from `Params`, its fields made by `setting`. From it follow
the Blender properties (`settings/properties.py`), JSON and the command line. Whoever makes such an object, its values
are checked here.
"""

import math
import sys
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from numbers import Real
from typing import Any, Literal, TypeVar, cast, get_args, get_origin, get_type_hints

from .errors import Refused

Unit = Literal["NONE", "FACTOR", "ANGLE", "DISTANCE"]
# Of each value that may be chosen: its label, and what it means.
Choices = dict[str, tuple[str, str]]


class SettingError(Refused):
    """A setting that is outside its range."""


@dataclass(frozen=True)
class Setting:
    """What is declared of a setting. Ranges are inclusive; sliders of the panel stop at the soft ends.

    `native` says that the native call of the feature has a keyword of the same name, default and range. `shown` is the
    value a panel starts with where the default is None.
    """

    label: str
    sentence: str
    least: float = 0
    most: float = math.inf
    soft_least: float | None = None
    soft_most: float | None = None
    unit: Unit = "NONE"
    precision: int = 2
    step: float = 3
    choices: Choices = field(default_factory=dict)
    shown: Any = None
    native: bool = False


def setting(default: Any, label: str, sentence: str, **more: Any) -> Any:
    """The field of a `Params` class; `more` are fields of Setting. A default of MISSING means that there is none."""
    return field(default=default, metadata={"setting": Setting(label, sentence, **more)})


def threads() -> Any:
    """The setting that every feature has."""
    sentence = "Processor threads a calculation may take; 0 takes all"
    return setting(0, "Threads", sentence, most=1024, soft_most=64, native=True)


def max_influences(native: bool = False) -> Any:
    """One limit for those that write weights and those that check them."""
    sentence = "Most bones a vertex may follow, 4 or 8 for most game engines; 0 sets no limit"
    return setting(0, "Limit", sentence, most=255, soft_most=8, native=native)


class Params:
    """Base of frozen dataclasses of settings. Raises SettingError for a value outside its range."""

    def __post_init__(self) -> None:
        """The one check of ranges."""
        for name, (kind, one) in declared(type(self)).items():
            check(name, getattr(self, name), kind, one)


P = TypeVar("P", bound=Params)


def declared(kind: type) -> dict[str, tuple[Any, Setting]]:
    """Type and declaration of every setting, in order."""
    hints = get_type_hints(kind)
    return {f.name: (hints[f.name], f.metadata["setting"]) for f in fields(kind) if "setting" in f.metadata}


def check(name: str, value: Any, kind: Any, one: Setting) -> None:
    """Raise SettingError where a value is none that `name` can have."""
    if one.choices:
        if value not in one.choices:
            raise SettingError(f"{name} is {value!r}, but must be one of {', '.join(one.choices)}")
    elif _is_number(value) and _scalar(kind) in (int, float) and not _in_range(value, one):
        raise SettingError(f"{name} is {_shown(value, one)}, but must {_range(one)}")


def _in_range(value: Any, one: Setting) -> bool:
    """What is not a number is in no range, nor is what no double can hold."""
    return bool(one.least <= value <= one.most and abs(value) <= sys.float_info.max)


def from_json(kind: type[P], values: Any) -> P:
    """Settings from a JSON object of their names; angles in degrees, settings of several values as objects.

    Raises ValueError for a name that is none of them or a value of another type, SettingError for one out of range.
    """
    if not isinstance(values, dict):
        raise ValueError(f"settings must be a JSON object, not {_short(values)}")
    known = declared(kind)
    made = {}
    for name, value in values.items():
        if name not in known:
            raise ValueError(f"there is no setting {name}; there are {', '.join(sorted(known))}")
        hint, one = known[name]
        part = _part(hint)
        if not (part and isinstance(value, dict)) and not fits(value, hint):
            raise ValueError(f"setting {name} cannot be {_short(value)}")
        made[name] = from_json(part, value) if part and value is not None else _inside(name, value, hint, one)
    required = [f.name for f in fields(cast(Any, kind)) if f.default is MISSING]
    missing = [name for name in required if name not in made]
    if missing:
        raise ValueError(f"setting {missing[0]} is missing from {_short(values)}")
    return kind(**made)


def to_json(params: Params) -> dict[str, Any]:
    """The inverse of from_json, so that a report tells how it was made."""
    return {name: _outside(getattr(params, name), one) for name, (_, one) in declared(type(params)).items()}


def native_keywords(params: Params) -> dict[str, Any]:
    """The settings that the native call has too."""
    return {name: getattr(params, name) for name, (_, one) in declared(type(params)).items() if one.native}


def is_plain(kind: Any) -> bool:
    """Whether a setting is one value, not an object of several."""
    return _part(kind) is None


def described(kind: Any, one: Setting, default: Any) -> str:
    """Sentence, range and default in a line, for a command's help."""
    if one.choices:
        span = f"{', '.join(one.choices)}; "
    else:
        span = f"{_shown(one.least, one)} to {_shown(one.most, one)}; " if _scalar(kind) in (int, float) else ""
    return f"{one.sentence} ({span}default {_outside(default, one)})"


def _inside(name: str, value: Any, kind: Any, one: Setting) -> Any:
    """A value as JSON has it, as the dataclass has it."""
    if not _is_number(value):
        return value
    if one.unit == "ANGLE":
        check(name, value, float, _in_degrees(one))
        return min(math.radians(value), one.most)
    check(name, value, kind, one)
    return float(value) if _scalar(kind) is float else value


def _in_degrees(one: Setting) -> Setting:
    return Setting(one.label, one.sentence, math.degrees(one.least), math.degrees(one.most))


def _outside(value: Any, one: Setting) -> Any:
    if isinstance(value, Params):
        return to_json(value)
    return math.degrees(value) if one.unit == "ANGLE" and value is not None else value


def fits(value: Any, kind: Any) -> bool:
    """Whether a value is of this type; whole numbers are also fractions, and truth values are no numbers."""
    if get_origin(kind) is Literal:
        return value in get_args(kind)
    if get_args(kind):
        return any(fits(value, option) for option in get_args(kind))
    if isinstance(value, bool) or kind is bool:
        return isinstance(value, bool) and kind is bool
    return isinstance(value, (int, float) if kind is float else kind)


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _scalar(kind: Any) -> Any:
    """The type beside None."""
    options = [option for option in get_args(kind) if option is not type(None)]
    return options[0] if len(options) == 1 and get_origin(kind) is not Literal else kind


def _part(kind: Any) -> Any:
    """The class of settings that one setting holds."""
    inner = _scalar(kind)
    return inner if isinstance(inner, type) and is_dataclass(inner) else None


def _range(one: Setting) -> str:
    low, high = _shown(one.least, one), _shown(one.most, one)
    return f"lie between {low} and {high}" if math.isfinite(one.most) else f"be a finite number, {low} or more"


def _shown(value: float, one: Setting) -> str:
    if isinstance(value, int) and abs(value) >= 1 << 63:
        return "a number beyond 64 bits"
    return f"{math.degrees(value):g} degrees" if one.unit == "ANGLE" else f"{value:.9g}"


def _short(value: Any) -> str:
    if isinstance(value, int) and abs(value) >= 1 << 63:
        return "a number beyond 64 bits"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
