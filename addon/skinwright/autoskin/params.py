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
Geometry = Literal["AS_SHOWN", "REST"]
GEOMETRIES: Choices = {
    "AS_SHOWN": ("As Shown, at Rest", "The shape with shape keys and modifiers, but not as it is posed"),
    "REST": ("Rest", "The shape without modifiers, shape keys or pose"),
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
    geometry: Geometry = setting("AS_SHOWN", "Geometry", "Which shape the bones are laid into", choices=GEOMETRIES)
    join_borders: bool = setting(
        True, "Join Borders", "Solve meshes whose borders lie on each other as one, so that no gap opens there"
    )
    selected_bones: bool = setting(
        False, "Selected Bones", "Write only the selected bones; the others keep their proportions and make room"
    )
    selected_only: bool = setting(
        False, "Selected Vertices", "Write only the vertices selected in Edit mode or by the paint mask"
    )
    mask_group: str = setting(
        "", "Mask", "Vertex group whose weights say how much of the new weights a vertex takes; empty takes all"
    )
    mix_factor: float = setting(
        1.0, "Mix", "How much of the new weights is taken; the rest are those already there", most=1, unit="FACTOR"
    )
    symmetrize: bool = setting(
        False,
        "Symmetrize",
        "Give vertices that mirror each other across the armature's X the same weights, left and right exchanged",
    )
    make_parent: bool = setting(
        True, "Make Parent", "Make the armature the parent of meshes that had neither an armature nor a parent"
    )
    threads: int = threads()
