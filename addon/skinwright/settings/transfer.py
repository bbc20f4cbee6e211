"""The settings of a transfer as Blender properties, for the panel and for the operator."""

from typing import TYPE_CHECKING, Any

from bpy.props import EnumProperty, PointerProperty
from bpy.types import Object, PropertyGroup, UILayout

from ..declared import declared
from ..transfer.params import TransferParams
from .properties import decimal, properties, values

LENGTH_MODES = [
    ("RELATIVE", "Relative", "As a part of the size, so that it holds for any unit"),
    ("ABSOLUTE", "Absolute", "As a length in the scene's unit"),
]
# Threads are a preference.
_SHOWN = [name for name in declared(TransferParams) if name not in ("mask", "threads")]


class TransferSettings:
    """The settings of a transfer and their layout; a mix-in, as Blender takes properties from base classes too."""

    __annotations__ = properties(TransferParams, _SHOWN) | {
        "distance_mode": EnumProperty(name="Distance", description="How the distance is given", items=LENGTH_MODES),
        "smoothness_mode": EnumProperty(name="Smoothness", description="How the length is given", items=LENGTH_MODES),
    }
    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """The properties, which mypy cannot see."""

    def draw_matching(self, layout: UILayout) -> None:
        """Shapes and thresholds."""
        layout.prop(self, "source_scope")
        layout.prop(self, "geometry")
        layout.prop(self, "join_borders")
        layout.prop(self, "relative_weld_tolerance")
        layout.prop(self, "method")
        if self.method == "CONFIDENCE":
            layout.prop(self, "softness")
            return
        self._draw_length(layout, "distance_mode", "relative_max_distance", "max_distance")
        layout.prop(self, "max_normal_angle")
        layout.prop(self, "match_flipped_normals")

    def draw_inpainting(self, layout: UILayout) -> None:
        """The solve, loose parts, smoothing."""
        self._draw_length(layout, "smoothness_mode", "relative_smoothness_length", "smoothness_length")
        layout.prop(self, "island_policy")
        layout.prop(self, "small_islands")
        layout.prop(self, "smoothing_iterations")
        column = layout.column()
        column.active = self.smoothing_iterations > 0
        column.prop(self, "smoothing_factor", text="Factor")

    def draw_writing(self, layout: UILayout) -> None:
        """Limit, mix, and what else may change."""
        layout.prop(self, "symmetrize")
        layout.prop(self, "max_influences")
        layout.prop(self, "mix_factor")
        layout.prop(self, "selected_only")
        layout.prop(self, "add_armature")
        layout.prop(self, "add_corrective_smooth")
        layout.prop(self, "replace_others")
        layout.prop(self, "make_single_user")
        layout.prop(self, "skip_failing")

    def _draw_length(self, layout: UILayout, mode: str, relative: str, absolute: str) -> None:
        row = layout.row(align=True)
        row.prop(self, relative if getattr(self, mode) == "RELATIVE" else absolute)
        row.prop(self, mode, text="")

    def to_params(self, threads: int = 0) -> TransferParams:
        """As plain values. Raises SettingError for a value outside its range."""
        lengths = {"max_distance": self.distance_mode, "smoothness_length": self.smoothness_mode}
        absolute = {
            name: decimal(getattr(self, name), declared(TransferParams)[name][1])
            for name, mode in lengths.items()
            if mode == "ABSOLUTE"
        }
        return TransferParams(**values(self, TransferParams) | absolute, threads=threads)


class SKINWRIGHT_PG_transfer(TransferSettings, PropertyGroup):
    """The panel's settings, kept in the scene."""

    source: PointerProperty(
        name="Source",
        description="The body whose weights are transferred to the selected meshes",
        type=Object,
        # Shapes of bones are meshes too, and have no weights.
        poll=lambda _settings, obj: obj.type == "MESH" and bool(obj.vertex_groups),
    )
