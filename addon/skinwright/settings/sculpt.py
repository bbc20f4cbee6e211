"""The settings of desparsification and of sculpting as Blender properties."""

from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty
from bpy.types import PropertyGroup, UILayout

from ..desparsify import DesparsifyParams
from ..sculpt.session import SculptOptions


class CandidateOptions:
    """How many bones a vertex has to choose from, and which; a mix-in for the operator and the panel."""

    n: IntProperty(
        name="Bones",
        description="Members every vertex has afterwards; the smallest beyond that are dropped",
        default=4,
        min=1,
        soft_max=8,
        max=12,
    )
    method: EnumProperty(
        name="Method",
        description="Which bones a vertex gets",
        items=[
            ("SURFACE", "Surface", "The bones whose regions are nearest along the surface"),
            ("HOP", "Hierarchy", "The bones that are fewest steps away in the armature"),
        ],
    )


class SKINWRIGHT_PG_sculpt(CandidateOptions, PropertyGroup):
    """The panel's settings, kept in the scene."""

    add_candidates: BoolProperty(
        name="Desparsify First",
        description="Give every vertex its bones to choose from when sculpting begins",
        default=True,
    )
    kappa: FloatProperty(
        name="Stiffness",
        description="How much weights hold on to what they were: low follows the sculpt, high hardly moves",
        default=0.01,
        min=0.001,
        max=0.05,
        precision=3,
        step=0.1,
    )
    guard: EnumProperty(
        name="Guard Poses",
        description="Poses whose shape a stroke should not spoil; the rest pose is always safe",
        items=[
            ("NONE", "None", "Only the poses sculpted in so far"),
            ("ACTION", "Keyframes", "The frames that have keys in the armature's action"),
            ("RANGE", "Range of Motion", "Turns of the touched bones by 45 and 90 degrees"),
        ],
    )
    guard_alpha: FloatProperty(
        name="Guard Strength",
        description="How much a guard pose counts against the sculpted one",
        default=0.2,
        min=0.01,
        max=1,
        subtype="FACTOR",
    )
    residual: EnumProperty(
        name="Leftover",
        description="What becomes of the part of a sculpt that no weights can reach",
        items=[
            ("DISCARD", "Discard", "It is lost"),
            ("SHAPE_KEY", "Shape Key", "It goes to a corrective shape key that the joint's turn drives"),
        ],
    )

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

    def to_options(self, threads: int = 0) -> SculptOptions:
        """As plain values."""
        return SculptOptions(
            kappa=self.kappa,
            candidates=self.n if self.add_candidates else 0,
            method=self.method.lower(),
            guard=self.guard,
            guard_alpha=self.guard_alpha,
            residual=self.residual,
            threads=threads,
        )


class DesparsifyOptions(CandidateOptions):
    """What the desparsify operator asks beside that."""

    subset: EnumProperty(
        name="Vertices",
        description="Which vertices are given bones",
        items=[
            ("ALL", "All", "Every vertex of the mesh"),
            ("SELECTED", "Selected", "Those selected in Edit mode or by the paint mask"),
        ],
    )

    def to_params(self, threads: int = 0) -> DesparsifyParams:
        """As plain values."""
        return DesparsifyParams(self.n, self.method.lower(), self.subset == "SELECTED", threads)
