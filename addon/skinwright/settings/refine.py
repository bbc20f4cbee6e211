"""The settings of refinement as Blender properties."""

from typing import TYPE_CHECKING, Any

from bpy.types import PropertyGroup, UILayout

from ..refine.params import CorrectiveParams, RefineParams
from .properties import properties, values

_SOLVER = ["stretch", "volume", "bind", "energy", "self_collision", "cell"]
_SAMPLING = ["angle", "twist", "samples", "accuracy", "tolerance"]


class RefineSettings:
    """How skin is solved; a mix-in for operators."""

    __annotations__ = properties(RefineParams, _SOLVER)
    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """The properties, which mypy cannot see."""

    def to_params(self, threads: int = 0) -> RefineParams:
        """As plain values. Raises SettingError for a value outside its range."""
        return RefineParams(**values(self, RefineParams) | {"threads": threads})


class CorrectiveSettings:
    """That, and how joints are sampled; a mix-in for operators."""

    __annotations__ = properties(CorrectiveParams, [*_SOLVER, *_SAMPLING])
    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """The properties, which mypy cannot see."""

    def to_params(self, threads: int = 0) -> CorrectiveParams:
        """As plain values. Raises SettingError for a value outside its range."""
        return CorrectiveParams(**values(self, CorrectiveParams) | {"threads": threads})


class SKINWRIGHT_PG_refine(PropertyGroup):
    """The panel's settings, kept in the scene."""

    __annotations__ = properties(CorrectiveParams, [*_SOLVER, *_SAMPLING])
    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """The properties, which mypy cannot see."""

    def draw_solver(self, layout: UILayout) -> None:
        """The constraints."""
        for name in _SOLVER:
            layout.prop(self, name)

    def draw_sampling(self, layout: UILayout) -> None:
        """What joints are put through."""
        for name in _SAMPLING:
            layout.prop(self, name)


def adopt(operator: Any, settings: SKINWRIGHT_PG_refine, mixin: type) -> None:
    """Give an operator the panel's values where it was not called with others."""
    for name in mixin.__annotations__:
        if not operator.properties.is_property_set(name):
            setattr(operator, name, getattr(settings, name))
