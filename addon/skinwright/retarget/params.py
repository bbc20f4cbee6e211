"""Settings of a retargeting as plain values."""

from dataclasses import asdict, dataclass, field, fields
from typing import Any

METHODS = {
    "SKELETON": ("skeleton", "Skeleton", "Bring the target into the source's pose and proportions, then match surfaces"),
    "BIHARMONIC": ("biharmonic", "Biharmonic", "Match by distances along the surface to landmarks at the joints"),
}
MATCH_POINTS = {
    "SURFACE": ("surface", "Surface", "Any point of the source's surface"),
    "VERTICES": ("vertices", "Vertices", "Vertices only, for characters made from one base mesh"),
}


@dataclass(frozen=True)
class RetargetParams:
    """`bone_map` names the source's bone for bones of the target ("" for none); all others are matched automatically.

    `landmarks` are pairs of (source object, vertex), (target object, vertex) for the Biharmonic method.
    """

    method: str = "SKELETON"
    match_points: str = "SURFACE"
    registration: bool = False
    max_influences: int = 4
    smoothing_iterations: int = 0
    smoothing_factor: float = 0.2
    n_pairs: int = 100
    show_correspondence: bool = False
    threads: int = 0
    bone_map: dict[str, str] = field(default_factory=dict)
    landmarks: tuple[tuple[str, int, str, int], ...] = ()

    def native(self) -> dict[str, Any]:
        """The keywords of the native call that are settings."""
        return {
            "method": METHODS[self.method][0],
            "match_points": MATCH_POINTS[self.match_points][0],
            "registration": self.registration,
            "smoothing_iterations": self.smoothing_iterations,
            "smoothing_factor": self.smoothing_factor,
            "n_pairs": self.n_pairs,
            "threads": self.threads,
        }


def to_json(params: RetargetParams) -> dict[str, Any]:
    """Plain values; what `from_json` reads."""
    return asdict(params)


def from_json(content: dict[str, Any]) -> RetargetParams:
    """The settings of a JSON object. Raises ValueError for a name or a choice that there is not."""
    known = {entry.name for entry in fields(RetargetParams)}
    if unknown := sorted(content.keys() - known):
        raise ValueError(f"there is no setting {', '.join(unknown)}; there are {', '.join(sorted(known))}")
    for name, choices in (("method", METHODS), ("match_points", MATCH_POINTS)):
        if content.get(name, next(iter(choices))) not in choices:
            raise ValueError(f"{name} is {content[name]!r}, but must be one of {', '.join(choices)}")
    landmarks = tuple(tuple(entry) for entry in content.get("landmarks", ()))
    return RetargetParams(**{**content, "landmarks": landmarks})
