"""The settings of automatic weights as plain values."""

from dataclasses import dataclass
from typing import Literal

from ..declared import Choices, Params, setting, threads

Method = Literal["heat", "geodesic", "euclidean"]
METHODS: Choices = {
    "heat": ("Heat", "Heat that flows along the surface from the nearest bones: the one to use"),
    "geodesic": ("Inside Distance", "Inverse distances to the nearest bones through the inside of the mesh"),
    "euclidean": ("Straight Distance", "Inverse straight distances to the nearest bones; they bleed across gaps"),
}


@dataclass(frozen=True)
class AutoskinParams(Params):
    """How weights are computed (see the native stub), for which bones and vertices; `threads` 0 takes all."""

    method: Method = setting("heat", "Method", "How weights are computed", choices=METHODS, native=True)
    max_influences: int = setting(
        4, "Limit", "Most bones a vertex follows; 0 sets no limit", most=255, soft_most=8, native=True
    )
    stiffness: float = setting(
        5.0,
        "Stiffness",
        "How closely heat keeps to its bone; less blends more widely",
        least=0.01,
        most=1000,
        soft_least=1,
        soft_most=20,
        native=True,
    )
    resolution: float = setting(
        128.0,
        "Resolution",
        "Cells along the mesh through which distances are measured; more tells narrower gaps apart",
        least=16,
        most=512,
        native=True,
    )
    selected_bones: bool = setting(False, "Selected Bones", "Only the selected bones; others keep their weights")
    selected_only: bool = setting(
        False, "Selected Vertices", "Only the vertices selected in Edit mode or by the paint mask"
    )
    threads: int = threads()
