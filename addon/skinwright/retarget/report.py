"""What a retargeting did, as a sentence, as warnings, and as JSON."""

from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class RetargetReport:
    """Counts are of vertices; `bone_map` has target, source, how and confidence per bone of the target."""

    source: str
    target: str
    meshes: list[str]
    vertices: int
    matched: int
    filled: int
    unweighted: int
    confidence: float
    bone_map: list[dict[str, Any]]
    inherited: list[tuple[str, str]]
    landmarks: int
    seconds: dict[str, float]
    warnings: list[str] = field(default_factory=list)

    def sentence(self) -> str:
        """The line the artist reads when it is done."""
        paired = sum(bool(entry["source"]) for entry in self.bone_map)
        return (
            f"{self.source} to {self.target}: {self.matched} of {self.vertices} vertices matched, "
            f"{self.filled} filled; "
            f"{paired} of {len(self.bone_map)} bones have a partner; {sum(self.seconds.values()):.2f} s"
        )

    def all_warnings(self) -> list[str]:
        """Sentences worth a look."""
        return self.warnings

    def to_json(self) -> dict[str, Any]:
        """Plain values only."""
        return asdict(self) | {"sentence": self.sentence()}
