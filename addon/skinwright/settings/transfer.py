"""The settings of a transfer: declared once, for the panel and for the operator."""

from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty
from bpy.types import Object, PropertyGroup, UILayout

from ..transfer.params import TransferParams

LENGTH_MODES = [
    ("RELATIVE", "Relative", "As a part of the size, so that it holds for any unit"),
    ("ABSOLUTE", "Absolute", "As a length in the scene's unit"),
]


class TransferOptions:
    """The settings of a transfer and their layout; a mix-in, as Blender takes properties from base classes too."""

    groups: EnumProperty(
        name="Groups",
        description="Which of the source's vertex groups are written",
        items=[
            ("BONE_DEFORM", "Deform Bones", "Groups of all bones that deform"),
            ("BONE_SELECT", "Selected Bones", "Groups of the selected bones that deform"),
            ("ALL", "All Groups", "Every group; those that are no bones are carried over each by itself"),
            ("ACTIVE", "Active Group", "The active group of the source"),
        ],
    )
    geometry: EnumProperty(
        name="Geometry",
        description="Which shapes are laid over each other",
        items=[
            ("REST", "Rest", "The shapes without modifiers, shape keys or pose"),
            ("CURRENT", "Current", "The shapes as they are posed and deformed now"),
        ],
    )
    method: EnumProperty(
        name="Method",
        description="How vertices take weights from the source",
        items=[
            (
                "PAPER",
                "Match or Inpaint",
                "Copy where distance and angle are within their thresholds, fill in the rest",
            ),
            (
                "CONFIDENCE",
                "Confidence",
                "Trust every vertex's point on the source the less the larger gap and tilt are",
            ),
        ],
    )
    softness: FloatProperty(
        name="Softness",
        description="How far weights are smoothed, as a multiple of the gap between garment and source",
        default=TransferParams.softness,
        min=0.05,
        soft_min=0.35,
        soft_max=1.4,
        max=10,
        precision=2,
        step=5,
    )
    distance_mode: EnumProperty(name="Distance", description="How the distance is given", items=LENGTH_MODES)
    relative_max_distance: FloatProperty(
        name="Distance",
        description="Farthest from the source a vertex may match, as a part of the target's bounding-box diagonal",
        default=0.05,
        min=0,
        soft_max=0.5,
        max=10,
        precision=3,
        step=1,
    )
    max_distance: FloatProperty(
        name="Distance",
        description="Farthest from the source a vertex may match",
        default=0.05,
        min=0,
        soft_max=1,
        subtype="DISTANCE",
    )
    max_normal_angle: FloatProperty(
        name="Angle",
        description="Largest angle between the normals of a vertex and its match",
        default=TransferParams.max_normal_angle,
        min=0,
        max=3.14159265,
        subtype="ANGLE",
    )
    match_flipped_normals: BoolProperty(
        name="Flipped Normals",
        description="Match surfaces that face the other way too, as linings do",
        default=True,
    )
    smoothness_mode: EnumProperty(name="Smoothness", description="How the length is given", items=LENGTH_MODES)
    relative_smoothness_length: FloatProperty(
        name="Smoothness",
        description="How far inpainted weights flow smoothly, as a part of the source's bounding-box diagonal",
        default=0.05,
        min=0,
        soft_max=0.5,
        max=100,
        precision=3,
        step=1,
    )
    smoothness_length: FloatProperty(
        name="Smoothness",
        description="How far inpainted weights flow smoothly",
        default=0.1,
        min=0,
        soft_max=1,
        subtype="DISTANCE",
    )
    island_policy: EnumProperty(
        name="Loose Parts",
        description="What to do with parts of which no vertex matches, as buttons and belts",
        items=[
            ("BRIDGE", "Bridge", "Hang the part on the nearest part that has weights"),
            ("NEAREST", "Nearest", "Give each vertex the weights of its closest point on the source"),
            ("RIGID", "Rigid", "Give the whole part one set of weights, for buckles and plates"),
            ("SKIP", "Skip", "Leave the part as it is"),
        ],
    )
    small_islands: EnumProperty(
        name="Small Parts",
        description="What to do with small loose parts that hang off the source, as buttons and pouches",
        items=[
            ("AUTO", "Automatic", "Rigid with Confidence, as computed otherwise"),
            ("RIGID", "Rigid", "Give each part one set of weights if it nearly has one"),
            ("SOLVED", "As Computed", "Leave them as they are computed"),
        ],
    )
    smoothing_iterations: IntProperty(
        name="Smoothing",
        description="Passes of smoothing over the inpainted vertices and their surroundings",
        default=0,
        min=0,
        soft_max=20,
        max=1000,
    )
    smoothing_factor: FloatProperty(
        name="Smoothing Factor",
        description="How much of its neighbours a vertex takes in each pass",
        default=0.2,
        min=0,
        max=1,
        subtype="FACTOR",
    )
    max_influences: IntProperty(
        name="Limit",
        description="Most bones a vertex may follow, 4 or 8 for most game engines; 0 sets no limit",
        default=0,
        min=0,
        soft_max=8,
        max=255,
    )
    mix_factor: FloatProperty(
        name="Mix",
        description="How much of the new weights is taken; the rest are the weights already there",
        default=1,
        min=0,
        max=1,
        subtype="FACTOR",
    )
    selected_only: BoolProperty(
        name="Selected Vertices",
        description="Write only the vertices selected in Edit mode or by the paint mask",
        default=False,
    )
    add_armature: BoolProperty(
        name="Add Armature",
        description="Let the source's armature deform targets that have none",
        default=True,
    )
    make_single_user: BoolProperty(
        name="Make Single User",
        description="Give a target a mesh of its own where others share it, so that theirs keeps its weights",
        default=False,
    )

    def draw_matching(self, layout: UILayout) -> None:
        """Shapes and thresholds."""
        layout.prop(self, "geometry")
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
        layout.prop(self, "max_influences")
        layout.prop(self, "mix_factor")
        layout.prop(self, "selected_only")
        layout.prop(self, "add_armature")
        layout.prop(self, "make_single_user")

    def _draw_length(self, layout: UILayout, mode: str, relative: str, absolute: str) -> None:
        row = layout.row(align=True)
        row.prop(self, relative if getattr(self, mode) == "RELATIVE" else absolute)
        row.prop(self, mode, text="")

    def to_params(self, threads: int = 0) -> TransferParams:
        """As plain values; Blender's angles are radians already."""
        same = (
            "groups softness relative_max_distance max_normal_angle match_flipped_normals relative_smoothness_length "
            "smoothing_iterations smoothing_factor max_influences mix_factor selected_only add_armature "
            "make_single_user"
        )
        return TransferParams(
            evaluated=self.geometry == "CURRENT",
            max_distance=self.max_distance if self.distance_mode == "ABSOLUTE" else None,
            smoothness_length=self.smoothness_length if self.smoothness_mode == "ABSOLUTE" else None,
            method=self.method.lower(),
            island_policy=self.island_policy.lower(),
            small_islands=self.small_islands.lower(),
            threads=threads,
            **{name: getattr(self, name) for name in same.split()},
        )


class SKINWRIGHT_PG_transfer(TransferOptions, PropertyGroup):
    """The panel's settings, kept in the scene."""

    source: PointerProperty(
        name="Source",
        description="The body whose weights are transferred to the selected meshes",
        type=Object,
        poll=lambda _settings, obj: obj.type == "MESH",
    )
