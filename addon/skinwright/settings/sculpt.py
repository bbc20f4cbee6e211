"""The settings of desparsification and of sculpting as Blender properties."""

from typing import TYPE_CHECKING, Any

from bpy.props import BoolProperty, EnumProperty
from bpy.types import PropertyGroup, UILayout

from ..desparsify.params import DesparsifyParams
from ..sculpt.params import SculptParams
from .properties import properties, values

CANDIDATES = properties(DesparsifyParams, ["n", "method"])


class SKINWRIGHT_PG_sculpt(PropertyGroup):
    """The panel's settings, kept in the scene."""

    __annotations__ = (
        CANDIDATES
        | {
            "add_candidates": BoolProperty(
                name="Desparsify First",
                description="Give every vertex its bones to choose from when sculpting begins",
                default=True,
            )
        }
        | properties(SculptParams, ["kappa", "guard", "guard_alpha", "residual"])
    )
    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """The properties, which mypy cannot see."""

    def draw_settings(self, layout: UILayout) -> None:
        """What is asked when sculpting begins; the stiffness may change with every stroke."""
        layout.prop(self, "add_candidates")
        column = layout.column()
        column.active = self.add_candidates
        column.prop(self, "n")
        column.prop(self, "method")
        layout.prop(self, "guard")
        if self.guard != "NONE":
            layout.prop(self, "guard_alpha", slider=True)
        layout.prop(self, "residual")

    def to_options(self, threads: int = 0) -> SculptParams:
        """As plain values. Raises SettingError for a value outside its range."""
        candidates = self.n if self.add_candidates else 0
        return SculptParams(**values(self, SculptParams), candidates=candidates, threads=threads)


class DesparsifySettings:
    """What the desparsify operator asks; a mix-in."""

    __annotations__ = CANDIDATES | {
        "subset": EnumProperty(
            name="Vertices",
            description="Which vertices are given bones",
            items=[
                ("ALL", "All", "Every vertex of the mesh"),
                ("SELECTED", "Selected", "Those selected in Edit mode or by the paint mask"),
            ],
        )
    }
    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """The properties, which mypy cannot see."""

    def to_params(self, threads: int = 0) -> DesparsifyParams:
        """As plain values. Raises SettingError for a value outside its range."""
        chosen = values(self, DesparsifyParams) | {"selected_only": self.subset == "SELECTED"}
        return DesparsifyParams(**chosen, threads=threads)
