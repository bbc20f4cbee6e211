"""The settings of a retargeting as plain values."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from .. import declared
from ..declared import Params, max_influences, setting, threads

Method = Literal["skeleton", "biharmonic"]
MatchPoints = Literal["surface", "vertices"]
# Source object and vertex, target object and vertex; an empty stands for the vertex nearest to it.
Landmark = tuple[str, int, str, int]


@dataclass(frozen=True)
class RetargetParams(Params):
    """`bone_map` names the source's bone for bones of the target ("" for none); the others are matched automatically.

    `landmarks` are used by the Biharmonic method, beside those that the bones give.
    """

    method: Method = setting(
        "skeleton",
        "Method",
        "How vertices of the target find their place on the source",
        choices={
            "skeleton": (
                "Skeleton",
                "Bring the target into the source's pose and proportions, then match surfaces",
            ),
            "biharmonic": ("Biharmonic", "Match by distances along the surface to landmarks beside the joints"),
        },
        native=True,
    )
    match_points: MatchPoints = setting(
        "surface",
        "Match",
        "What a vertex may be matched to",
        choices={
            "surface": ("Surface", "Any point of the source's surface"),
            "vertices": ("Vertices", "Vertices only, for characters made from one base mesh"),
        },
        native=True,
    )
    vertex_order: bool = setting(
        True,
        "Same Base Mesh",
        "Match vertices by their order where both characters are shapes of one mesh",
        native=True,
    )
    registration: bool = setting(
        True,
        "Fit Surfaces",
        "Draw the target onto the source by smooth displacements first, so that knees, elbows and waists meet",
        native=True,
    )
    n_pairs: int = setting(
        100,
        "Eigenpairs",
        "Eigenpairs of the Biharmonic method; more tell finer places apart",
        least=1,
        most=2000,
        native=True,
    )
    smoothing_iterations: int = setting(
        0,
        "Smooth",
        "Passes of smoothing around vertices without a reliable match",
        most=1000,
        soft_most=20,
        native=True,
    )
    smoothing_factor: float = setting(
        0.2, "Factor", "How far each pass moves towards the mean of the neighbours", most=1, unit="FACTOR", native=True
    )
    max_influences: int = max_influences(native=True)
    show_correspondence: bool = setting(
        False,
        "Correspondence",
        "Store the place that each vertex was matched to as the color attribute Correspondence on both characters",
    )
    threads: int = threads()
    bone_map: Mapping[str, str] | None = None
    landmarks: tuple[Landmark, ...] = ()


def from_json(values: Any) -> RetargetParams:
    """Settings from a JSON object of their names. Raises ValueError as `declared.from_json` does."""
    if not isinstance(values, dict):
        return declared.from_json(RetargetParams, values)
    plain = {name: value for name, value in values.items() if name not in ("bone_map", "landmarks")}
    bone_map, landmarks = values.get("bone_map", {}), values.get("landmarks", [])
    if not isinstance(bone_map, dict) or not all(isinstance(name, str) for name in bone_map.values()):
        raise ValueError("bone_map must be an object that names a bone of the source for bones of the target")
    kinds = [str, int, str, int]
    if not isinstance(landmarks, list) or not all(
        isinstance(entry, list) and [type(part) for part in entry] == kinds for entry in landmarks
    ):
        raise ValueError("landmarks must be a list of [source object, vertex, target object, vertex]")
    params = declared.from_json(RetargetParams, plain)
    return replace(params, bone_map=bone_map, landmarks=tuple(tuple(entry) for entry in landmarks))


def to_json(params: RetargetParams) -> dict[str, Any]:
    """The inverse of `from_json`."""
    lists = {"bone_map": dict(params.bone_map or {}), "landmarks": [list(entry) for entry in params.landmarks]}
    return declared.to_json(params) | lists
