"""The settings of embedding an armature as Blender properties."""

from typing import TYPE_CHECKING, Any

from bpy.types import PropertyGroup, UILayout

from ..embed.params import EmbedParams
from .properties import properties, values


class EmbedSettings:
    """The settings and their layout; a mix-in, as Blender takes properties from base classes too."""

    __annotations__ = properties(EmbedParams, ["method", "symmetric", "bind"])
    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """The properties, which mypy cannot see."""

    def draw_settings(self, layout: UILayout) -> None:
        """All of them."""
        layout.prop(self, "method")
        layout.prop(self, "symmetric")
        layout.prop(self, "bind")

    def to_params(self, threads: int = 0) -> EmbedParams:
        """As plain values. Raises SettingError for a value outside its range."""
        return EmbedParams(**values(self, EmbedParams), threads=threads)


class SKINWRIGHT_PG_embed(EmbedSettings, PropertyGroup):
    """The panel's settings, kept in the scene."""
