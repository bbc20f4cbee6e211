"""The settings of a check as plain values."""

import math
from dataclasses import dataclass
from typing import Literal

from ..declared import Params, max_influences, setting

Poses = Literal["ALL", "RANGE", "BODY", "ACTION", "MARKERS", "LIBRARY"]


@dataclass(frozen=True)
class CheckParams(Params):
    """`stretched` and `torn` are lengths over lengths at rest; `deeper` a part of the source's diagonal; radians."""

    max_influences: int = max_influences()
    stretched: float = setting(
        2.0, "Stretched", "Times its length at rest from which an edge is stretched", least=1, most=1e6, soft_most=10
    )
    torn: float = setting(
        4.0, "Torn", "Times its length at rest from which an edge is torn", least=1, most=1e6, soft_most=10
    )
    deeper: float = setting(
        0.005, "Depth", "Part of the source's diagonal from which a vertex counts as deeper", most=1, precision=4
    )
    poses: Poses = setting(
        "ALL",
        "Poses",
        "Which poses are tested",
        choices={
            "ALL": ("All Built-In Poses", "Range of motion, and whole-body poses if the bones' names tell the limbs"),
            "RANGE": ("Range of Motion", "Bend and twist the bones, those equally deep in the hierarchy together"),
            "BODY": ("Whole Body", "Arms up, sit, squat, stride, cross, twist and others, by the names of the bones"),
            "ACTION": ("Keyframes", "The frames that have keys in the armature's action"),
            "MARKERS": ("Marked Frames", "The frames that have a marker in the timeline"),
            "LIBRARY": ("Pose Library", "The pose assets in this file"),
        },
    )
    angle: float = setting(math.pi / 4, "Angle", "How far bones are bent", most=math.pi, unit="ANGLE")
    most_frames: int = setting(
        40, "Frames", "Most keyframes, markers or poses that are tested", least=1, most=10_000, soft_most=100
    )
