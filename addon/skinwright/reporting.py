"""What has been done, as a sentence with counts, as warnings, and as JSON."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass
class GarmentReport:
    """One target. `matched`, `inpainted` and `untouched` count vertices; `native` is what the library says."""

    target: str
    vertices: int
    matched: int
    inpainted: int
    untouched: int
    groups: int
    created_groups: list[str]
    locked_groups: list[str]
    kept_groups: list[str]
    armature_added: bool
    bound_in_pose: bool
    seconds: dict[str, float]
    native: dict[str, Any]
    warnings: list[str] = field(default_factory=list)


@dataclass
class Report:
    """All targets of one transfer.

    `failures` are the sentences of those that were left out; `comparison` has the faults in test poses, by target,
    before and after.
    """

    source: str
    method: str
    garments: list[GarmentReport]
    warnings: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    comparison: dict[str, dict[str, Any]] = field(default_factory=dict)

    def sentence(self) -> str:
        """The line the artist reads when it is done."""
        names = ", ".join(garment.target for garment in self.garments)
        done = ("matched closely", "smoothed") if self.method == "confidence" else ("matched", "inpainted")
        counts = [f"{self._sum('matched')} of {self._sum('vertices')} vertices {done[0]}"]
        counts.append(f"{self._sum('inpainted')} {done[1]}")
        if self.method != "confidence":
            counts += self._distance()
        if self._sum("untouched"):
            counts.append(f"{self._sum('untouched')} left as they were")
        loose = sum(len(garment.native["unmatched_islands"]) for garment in self.garments)
        if loose:
            counts.append(f"{loose} loose parts")
        bound = [garment.target for garment in self.garments if garment.bound_in_pose]
        if bound:
            counts.append(f"{', '.join(bound)} bound in the pose")
        created = sum(len(garment.created_groups) for garment in self.garments)
        seconds = sum(sum(garment.seconds.values()) for garment in self.garments)
        groups = f"{self._sum('groups')} groups written, {created} of them new"
        compared = "".join(f"; {name} {_before_and_after(figures)}" for name, figures in self.comparison.items())
        return f"{self.source} to {names}: {', '.join(counts)}; {groups}; {seconds:.2f} s{compared}"

    def _distance(self) -> list[str]:
        """The distance in force, if it is one for all."""
        distances = {f"{g.native['max_distance']:.3g}" for g in self.garments if "max_distance" in g.native}
        return [f"distance {distances.pop()}"] if len(distances) == 1 else []

    def _sum(self, name: str) -> int:
        return sum(getattr(garment, name) for garment in self.garments)

    def all_warnings(self) -> list[str]:
        """Sentences worth a look, the body's first."""
        left_out = [f"Left out: {sentence}" for sentence in self.failures]
        return left_out + self.warnings + [warning for garment in self.garments for warning in garment.warnings]

    def to_json(self) -> dict[str, Any]:
        """Plain values only."""
        garments = [_plain(vars(garment)) for garment in self.garments]
        said = {
            "warnings": self.warnings,
            "failures": self.failures,
            "comparison": self.comparison,
            "sentence": self.sentence(),
        }
        return {"source": self.source, "garments": garments} | said


def _before_and_after(figures: dict[str, Any]) -> str:
    """The faults in test poses, as "torn 38 before, 2 after"."""
    before, after = figures["before"], figures["after"]
    if before is None:
        return "in test poses: " + ", ".join(f"{count} {fault}" for fault, count in after.items())
    return "in test poses: " + ", ".join(f"{fault} {before[fault]} before, {after[fault]} after" for fault in after)


def _plain(value: Any) -> Any:
    """The same with numpy's scalars and arrays as Python's; JSON has no numbers that are not finite, so None."""
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


@dataclass(frozen=True)
class SkinnedMesh:
    """What automatic weights did to a mesh; `outside` lists bones no part of which lies inside of it, `notes` are
    sentences on what else concerns the object."""

    target: str
    armature: str
    vertices: int
    bones: int
    outside: list[str]
    notes: list[str] = field(default_factory=list)

    def sentence(self) -> str:
        """The line the artist reads."""
        return f"{self.target}: {self.vertices} vertices have weights for {self.bones} bones of {self.armature}"

    def warnings(self) -> list[str]:
        """What is worth a look."""
        found = list(self.notes)
        if self.outside:
            named = ", ".join(self.outside[:5]) + (", ..." if len(self.outside) > 5 else "")
            found.append(f"{self.target}: {len(self.outside)} bones lie outside of the mesh: {named}")
        return found


@dataclass(frozen=True)
class AutoskinReport:
    """Automatic weights of one or more meshes."""

    meshes: list[SkinnedMesh]

    def sentence(self) -> str:
        """The line the artist reads."""
        return "; ".join(mesh.sentence() for mesh in self.meshes)

    def all_warnings(self) -> list[str]:
        """What is worth a look, over all meshes."""
        return [warning for mesh in self.meshes for warning in mesh.warnings()]

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        return {"meshes": [asdict(mesh) for mesh in self.meshes]}


@dataclass(frozen=True)
class DesparsifyReport:
    """What desparsification gave and took; `dropped` counts influences that had weight, `groups` lists new ones."""

    target: str
    vertices: int
    n: int
    added: int
    dropped: int
    groups: list[str]

    def sentence(self) -> str:
        """The line the artist reads."""
        kept = f"{self.dropped} small influences dropped" if self.dropped else "no influence dropped"
        return (
            f"{self.target}: {self.vertices} vertices have {self.n} bones to choose from; {self.added} members of "
            f"weight 0 added, {kept}, {len(self.groups)} groups new"
        )


@dataclass(frozen=True)
class SculptReport:
    """A session that is over; `reachability` is of each stroke, how much weights did of what was still to be done."""

    target: str
    strokes: int
    poses: int
    vertices: int
    reachability: list[float]
    shape_keys: list[str]
    warnings: list[str] = field(default_factory=list)

    def sentence(self) -> str:
        """The line the artist reads."""
        strokes = f"{self.strokes} stroke{'s' * (self.strokes != 1)} in {self.poses} pose{'s' * (self.poses != 1)}"
        keys = f", the rest in {', '.join(self.shape_keys)}" if self.shape_keys else ""
        return f"{self.target}: {strokes} changed the weights of {self.vertices} vertices{keys}"

    def all_warnings(self) -> list[str]:
        """Sentences worth a look."""
        return self.warnings

    def to_json(self) -> dict[str, Any]:
        """Plain values only."""
        return _plain(vars(self)) | {"sentence": self.sentence()}


@dataclass(frozen=True)
class LastResult:
    """What the operator `title` has done or refused, for the panel: a report in the status bar is gone in seconds."""

    title: str
    sentence: str
    warnings: tuple[str, ...] = ()
    facts: tuple[str, ...] = ()
    failed: bool = False


last: LastResult | None = None


def remember(
    title: str, sentence: str, warnings: Sequence[str] = (), *, facts: Sequence[str] = (), failed: bool = False
) -> None:
    """Show this in the panel until the next result."""
    global last
    last = LastResult(title, sentence, tuple(warnings), tuple(facts), failed)


def forget() -> None:
    """Show nothing."""
    global last
    last = None
