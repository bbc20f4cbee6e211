"""The settings of automatic weights as Blender properties."""

from typing import TYPE_CHECKING, Any

from ..autoskin.params import AutoskinParams
from .properties import properties, values

_NAMES = [
    "method",
    "max_influences",
    "stiffness",
    "resolution",
    "geometry",
    "join_borders",
    "selected_bones",
    "selected_only",
    "mask_group",
    "mix_factor",
    "symmetrize",
    "make_parent",
]


class AutoskinSettings:
    """What the operator asks; a mix-in."""

    __annotations__ = properties(AutoskinParams, _NAMES)
    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """The properties, which mypy cannot see."""

    def to_params(self, threads: int = 0) -> AutoskinParams:
        """As plain values. Raises SettingError for a value outside its range."""
        return AutoskinParams(**values(self, AutoskinParams), threads=threads)
