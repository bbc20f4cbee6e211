"""The settings of retargeting as Blender properties: those of the operator, and the bone map of a scene."""

from typing import TYPE_CHECKING, Any

from bpy.props import CollectionProperty, FloatProperty, IntProperty, PointerProperty, StringProperty
from bpy.types import Object, PropertyGroup, UILayout

from ..declared import declared
from ..retarget.params import Landmark, RetargetParams
from .properties import properties, values

# Threads are a preference.
_SHOWN = [name for name in declared(RetargetParams) if name != "threads"]


class RetargetSettings:
    """The settings of a retargeting and their layout; a mix-in, as Blender takes properties from base classes too."""

    __annotations__ = properties(RetargetParams, _SHOWN)
    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """The properties, which mypy cannot see."""

    def draw_settings(self, layout: UILayout) -> None:
        """Matching, then what happens to the rows."""
        layout.prop(self, "method")
        if self.method == "BIHARMONIC":
            layout.prop(self, "n_pairs")
        layout.prop(self, "match_points")
        layout.prop(self, "vertex_order")
        layout.prop(self, "registration")
        layout.prop(self, "smoothing_iterations")
        column = layout.column()
        column.active = self.smoothing_iterations > 0
        column.prop(self, "smoothing_factor", text="Factor")
        layout.prop(self, "max_influences")
        layout.prop(self, "show_correspondence")

    def to_params(self, threads: int, landmarks: tuple[Landmark, ...] = ()) -> RetargetParams:
        """As plain values. Raises SettingError for a value outside its range."""
        return RetargetParams(**values(self, RetargetParams), threads=threads, landmarks=landmarks)


class SKINWRIGHT_PG_bone_pair(PropertyGroup):
    """A row of the bone map; `name` is the target's bone."""

    source: StringProperty(
        name="Source Bone", description="Bone of the source that this bone stands for; none if empty"
    )
    found: StringProperty(name="Partner Found", description="The partner that was found automatically")
    how: StringProperty(name="Found By", description="What the partner was found by")
    confidence: FloatProperty(name="Confidence", description="How sure the partner is", min=0, max=1)


def _on_surface(_self: Any, obj: Object) -> bool:
    return obj.type in ("EMPTY", "MESH")


class SKINWRIGHT_PG_landmark(PropertyGroup):
    """One place on both characters: a vertex of a mesh, or the vertex nearest to an empty."""

    source: PointerProperty(
        name="On Source", description="Empty on the source, or the mesh of the vertex", type=Object, poll=_on_surface
    )
    source_vertex: IntProperty(name="Vertex", description="Vertex of the source's mesh", default=0, min=0)
    target: PointerProperty(
        name="On Target", description="Empty on the target, or the mesh of the vertex", type=Object, poll=_on_surface
    )
    target_vertex: IntProperty(name="Vertex", description="Vertex of the target's mesh", default=0, min=0)

    def put(self, side: str, obj: Object, vertex: int) -> None:
        """Set the place on the `side` source or target."""
        setattr(self, side, obj)
        setattr(self, f"{side}_vertex", vertex)


class SKINWRIGHT_PG_retarget(RetargetSettings, PropertyGroup):
    """The panel's settings, kept in the scene."""

    source: PointerProperty(
        name="Source",
        description="Armature of the character whose weights are taken",
        type=Object,
        poll=lambda _self, obj: obj.type == "ARMATURE",
    )
    bone_map: CollectionProperty(type=SKINWRIGHT_PG_bone_pair)
    bone_map_index: IntProperty(name="Bone", description="The bone that is shown as active", default=0, min=0)
    bone_map_of: StringProperty(
        name="Bone Map Of", description="The armatures that the bone map was made for", options={"HIDDEN"}
    )

    landmarks: CollectionProperty(type=SKINWRIGHT_PG_landmark)
    landmarks_index: IntProperty(name="Landmark", description="The landmark that is shown as active", default=0, min=0)

    def given_landmarks(self) -> tuple[Landmark, ...]:
        """Those that have a place on both characters."""
        complete = [entry for entry in self.landmarks if entry.source and entry.target]
        return tuple((e.source.name, e.source_vertex, e.target.name, e.target_vertex) for e in complete)

    def given_map(self, source: Object, target: Object) -> dict[str, str]:
        """The map that was made for these armatures, as the artist left it; nothing for others."""
        if self.bone_map_of != pair_key(source, target):
            return {}
        return {entry.name: entry.source for entry in self.bone_map}


def pair_key(source: Object, target: Object) -> str:
    """What a bone map remembers of its armatures."""
    return f"{source.name} to {target.name}"
