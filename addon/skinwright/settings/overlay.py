"""What is drawn over a mesh."""

from bpy.props import BoolProperty, EnumProperty, FloatProperty
from bpy.types import PropertyGroup


class SKINWRIGHT_PG_overlay(PropertyGroup):
    """What is drawn over a mesh."""

    kind: EnumProperty(
        name="Overlay",
        description="What the colours over the mesh show",
        items=[
            ("NONE", "None", "Draw nothing"),
            ("MATCH", "Match", "Which vertices match, which are inpainted, which the mask decides"),
            ("INFLUENCES", "Influences", "How many bones each vertex of the active mesh follows"),
            ("DIFFERENCE", "Difference", "How far the weights are from the state that Compare Weights has shown"),
            ("STRETCH", "Stretch", "Where the pose stretches or presses the edges of the active mesh"),
            ("FAULTS", "Faults", "What Check Weights last found on the active mesh"),
        ],
    )
    opacity: FloatProperty(
        name="Opacity",
        description="How far the colours hide what is below",
        default=0.9,
        min=0.1,
        max=1,
        subtype="FACTOR",
    )
    live: BoolProperty(
        name="Live Weights",
        description="While the mask is painted, solve and write the weights after every stroke",
        default=True,
    )
