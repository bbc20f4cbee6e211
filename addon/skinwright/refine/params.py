"""The settings of refinement as plain values."""

import math
from dataclasses import dataclass
from typing import Literal

from ..declared import Choices, Params, setting, threads

Quality = Literal["live", "bake"]
QUALITIES: Choices = {
    "bake": ("Bake", "Steps of 15 degrees, and limbs are kept apart: for what is kept"),
    "live": ("Live", "Steps of 30 degrees: for the viewport"),
}
CacheFormat = Literal["pc2", "mdd"]
FORMATS: Choices = {
    "pc2": ("PC2", "Point Cache 2: small header, little-endian"),
    "mdd": ("MDD", "Motion Designer data: times of the frames, big-endian; read by most packages"),
}


@dataclass(frozen=True)
class RefineParams(Params):
    """How skin is solved; names and defaults are those of the native Refiner."""

    stretch: float = setting(
        1.0, "Stiffness", "Resistance of skin and flesh to being stretched; 0 off", most=1e6, soft_most=10
    )
    volume: float = setting(
        1.0, "Volume", "How exactly flesh keeps its volume; 0 off, 1 exactly", most=1, unit="FACTOR"
    )
    bind: float = setting(
        1.08,
        "Bulge Limit",
        "Farthest skin may come from its bone, as a multiple of rest; 0 off",
        most=1000,
        soft_most=1.5,
    )
    energy: float = setting(0.1, "Regularity", "Resistance of flesh to being sheared; 0 off", most=1e6, soft_most=10)
    self_collision: bool = setting(True, "Self-Collision", "Keep skin of neighbouring bones and of limbs apart")
    cell: float = setting(
        0.0, "Cell Size", "Edge of a lattice cell in the mesh's own units; 0 takes 1.5 % of the diagonal", most=1e9
    )
    threads: int = threads()

    def __post_init__(self) -> None:
        """A limit below what the rest shape has cannot hold."""
        super().__post_init__()
        if 0 < self.bind < 1:
            from ..declared import SettingError

            raise SettingError(f"bind is {self.bind:g}, but must be 0 (off), or 1 or more")


@dataclass(frozen=True)
class CorrectiveParams(RefineParams):
    """How joints are sampled for corrective shape keys."""

    angle: float = setting(
        math.radians(120),
        "Bend",
        "How far joints are bent",
        least=math.radians(10),
        most=math.radians(150),
        unit="ANGLE",
    )
    twist: float = setting(
        math.radians(90),
        "Twist",
        "How far joints are twisted; 0 leaves twist out",
        most=math.radians(170),
        unit="ANGLE",
    )
    samples: int = setting(4, "Samples", "Poses along each direction of a joint", least=1, most=12, soft_most=6)
    accuracy: float = setting(
        0.005,
        "Accuracy",
        "Poses get no key where the other keys come this near, as a share of the bone's length; 0 keeps all",
        most=0.1,
        precision=4,
    )
    tolerance: float = setting(
        0.002, "Smallest Offset", "Offsets below this share of the bone's length are left out", most=0.1, precision=4
    )
