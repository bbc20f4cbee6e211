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


def together(reports: list[RetargetReport]) -> RetargetReport:
    """One report of several characters, at least one."""
    if len(reports) == 1:
        return reports[0]
    vertices = sum(report.vertices for report in reports)
    confidence = sum(report.confidence * report.vertices for report in reports) / vertices
    names = dict.fromkeys(stage for report in reports for stage in report.seconds)
    return RetargetReport(
        source=reports[0].source,
        target=", ".join(report.target for report in reports),
        meshes=[name for report in reports for name in report.meshes],
        vertices=vertices,
        matched=sum(report.matched for report in reports),
        filled=sum(report.filled for report in reports),
        unweighted=sum(report.unweighted for report in reports),
        confidence=round(confidence, 4),
        bone_map=[entry for report in reports for entry in report.bone_map],
        inherited=list(dict.fromkeys(pair for report in reports for pair in report.inherited)),
        landmarks=sum(report.landmarks for report in reports),
        seconds={name: sum(report.seconds.get(name, 0.0) for report in reports) for name in names},
        warnings=list(dict.fromkeys(warning for report in reports for warning in report.warnings)),
    )
