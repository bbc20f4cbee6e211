"""What is wrong with a mesh's weights: in the numbers, and in test poses."""

from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr, jobs, native
from ..jobs import Jobs
from ..scene import armature, evaluation, followers, mesh, mirror, places, poses, shapes, skeleton, vertex_groups
from ..scene.error import SceneError
from . import body_plan
from .params import CheckParams
from .poses import TestPose, range_of_motion, whole_body

SUM_TOLERANCE = 1e-4
# An edge longer by less than this part of the mesh's diagonal is no offender, however short it was.
_LEAST_LENGTHENING = 0.005
# Of the diagonal: vertices at one place, and what a gap between them is.
_ONE_PLACE = 1e-6
_GAP = 5e-4
_MOST_POINTS = 4000
# Poses between two looks at the window: a few hundredths of a second.
_AT_ONCE = 4


class Fault(Enum):
    """What a vertex can have wrong; the value is what the report calls it."""

    UNWEIGHTED = "without weights"
    UNNORMALISED = "weights not summing to 1"
    OVER_LIMIT = "over the limit of bones"
    STRETCHED = "on stretched edges"
    TORN = "on torn edges"
    OPEN = "at one place at rest and apart in a pose"
    PENETRATING = "deeper in the body than at rest"


# From bad to worse, to find the worst pose.
_IN_POSES = {Fault.STRETCHED: 1, Fault.PENETRATING: 2, Fault.TORN: 10, Fault.OPEN: 10}


@dataclass
class WeightCheck:
    """`faulty` (V,) by fault; `poses` holds the counts in every pose; `tested` says what was done."""

    target: str
    vertices: int
    faulty: dict[Fault, NDArray[np.bool_]]
    poses: list[dict[str, Any]] = field(default_factory=list)
    tested: str = ""
    worst: TestPose | None = None
    bones: list[str] = field(default_factory=list)

    def counts(self) -> dict[Fault, int]:
        """Vertices by fault."""
        return {fault: int(marked.sum()) for fault, marked in self.faulty.items()}

    def any_fault(self) -> NDArray[np.bool_]:
        """(V,) the vertices with any fault."""
        return np.logical_or.reduce(list(self.faulty.values()))

    def sentence(self) -> str:
        """The line the artist reads."""
        found = [f"{count} {fault.value}" for fault, count in self.counts().items() if count]
        worst = f"; the worst is {self.worst.name}" if self.worst else ""
        wrong = f"{', '.join(found) or 'nothing wrong'} of {self.vertices} vertices"
        return f"{self.target}: {wrong}; {len(self.poses)} poses tested ({self.tested}){worst}"

    def to_json(self) -> dict[str, Any]:
        """Plain values only; with the first vertices of each fault."""
        faults = {
            fault.name.lower(): {"vertices": int(marked.sum()), "first": np.flatnonzero(marked)[:100].tolist()}
            for fault, marked in self.faulty.items()
        }
        said = {"tested": self.tested, "worst": self.worst.name if self.worst else ""}
        return {"target": self.target, "vertices": self.vertices, "faults": faults, "poses": self.poses} | said


def check(target: bpy.types.Object, source: bpy.types.Object | None, params: CheckParams) -> WeightCheck:
    """Look at the weights, then at each pose. Raises SceneError; nothing in the scene changes."""
    return jobs.wait(steps(target, source, params))


def steps(target: bpy.types.Object, source: bpy.types.Object | None, params: CheckParams) -> Jobs[WeightCheck]:
    """The same as a generator of jobs, for a window that must live on meanwhile."""
    evaluation.bring_up_to_date([target, *([source] if source else [])])
    rigs = armature.rigs(target) or [rig for rig in [armature.find(target)] if rig]
    if not rigs:
        raise SceneError(f"{target.name} has no armature to pose it: give it an Armature modifier")
    bones = skeleton.read(rigs)
    garment = _Posable(target, source, bones, params)
    faulty = faults_of_rows(garment.rows, params.max_influences)
    result = WeightCheck(target.name, len(garment.rest), faulty, bones=bones.names)
    used = np.unique(garment.rows.bones[garment.rows.values > 0]).tolist()
    result.tested, tests = _tests(rigs, bones, used, params)
    result.tested += _left_out(target, rigs, [bones.names[bone] for bone in used])
    yield from _check_poses(result, garment, tests)
    return result


def faults_of_rows(rows: csr.Rows, max_influences: int) -> dict[Fault, NDArray[np.bool_]]:
    """What the numbers alone show; a limit of 0 is none."""
    sums = csr.row_sums(rows)
    n_influences = np.bincount(csr.entry_vertices(rows)[rows.values > 0], minlength=len(sums))
    return {
        Fault.UNWEIGHTED: n_influences == 0,
        Fault.UNNORMALISED: (n_influences > 0) & (np.abs(sums - 1) > SUM_TOLERANCE),
        Fault.OVER_LIMIT: (n_influences > max_influences) if max_influences else np.zeros(len(sums), bool),
    }


def _tests(
    rigs: list[bpy.types.Object], bones: skeleton.Skeleton, used: list[int], params: CheckParams
) -> tuple[str, list[TestPose]]:
    """What is tested, in words, and the poses."""
    if params.poses in ("ACTION", "MARKERS", "LIBRARY"):
        of_the_artist = {"ACTION": poses.keyframes, "MARKERS": poses.marked_frames, "LIBRARY": poses.library}
        shown = of_the_artist[params.poses](rigs[0], params.most_frames)
        name = {"ACTION": "keyframes", "MARKERS": "marked frames", "LIBRARY": "pose library"}[params.poses]
        return name, [TestPose(name, armature.world_pose(rigs, bones.names)) for name in shown]
    bends = list(range_of_motion(bones, used, params.angle)) if params.poses != "BODY" else []
    body = list(whole_body(bones, body_plan.find(bones))) if params.poses != "RANGE" else []
    if not body and params.poses == "BODY":
        raise SceneError(
            f"The names of the bones of {rigs[0].name} do not tell which are limbs: choose Range of Motion or Keyframes"
        )
    words = [word for word, tests in (("range of motion", bends), ("whole body", body)) if tests]
    return f"{' and '.join(words) or 'no bone has weight'}; deform bones alone, blended linearly", bends + body


def _left_out(target: bpy.types.Object, rigs: list[bpy.types.Object], used: list[str]) -> str:
    """What the target's own deformation does beyond linear blending, in words."""
    bendy = any(rig.data.bones[n].bbone_segments > 1 for rig in rigs for n in used if n in rig.data.bones)
    models = [model for model in armature.modifiers(target) if model.show_viewport]
    overruling = followers.overruling(target, set(used))
    words = [
        *(["bendy bones as straight ones"] if bendy else []),
        *(["without Preserve Volume"] if any(model.use_deform_preserve_volume for model in models) else []),
        *(["without bone envelopes"] if armature.envelopes(target) else []),
        *(f"without the modifier {modifier.name}, which overrules the weights" for modifier in overruling),
        *(f"without what the modifier {modifier.name} adds" for modifier in mirror.before_the_pose(target)),
    ]
    return "".join(f", {word}" for word in words)


class _Posable:
    """The target's shape at rest with its weights, and the sampled points whose depth in the source is compared."""

    def __init__(
        self,
        target: bpy.types.Object,
        source: bpy.types.Object | None,
        bones: skeleton.Skeleton,
        params: CheckParams,
    ) -> None:
        self.name, self.params = target.name, params
        self.edges = mesh.edges(target)
        objects = [target] if source is None else [target, source]
        with shapes.looked_at(objects, "AS_SHOWN"):
            geometry = shapes.read_target(target, "AS_SHOWN").geometry
            self.body = None if source is None or source == target else _body(source, bones)
        self.rest = geometry.positions
        self.rows = vertex_groups.read(target, bones.names)
        self.diagonal = float(np.linalg.norm(geometry.size))
        self.lengths = _lengths(self.rest, self.edges)
        self.first = places.first_at_each(self.rest, _ONE_PLACE * self.diagonal)
        self.doubled = np.flatnonzero(self.first != np.arange(len(self.rest), dtype=np.int64))
        n = len(self.rest)
        self.sampled = np.unique(np.linspace(0, n - 1, min(n, _MOST_POINTS)).astype(np.int64))
        rest = np.tile(np.eye(4), (1, len(bones.names), 1, 1))
        self.depth = self.depths(rest)[0]

    def depths(self, matrices: NDArray[np.float64]) -> NDArray[np.float32]:
        """(P, n) of the sampled points in poses (P, B, 4, 4); without a source 0."""
        if self.body is None or not matrices.shape[1]:
            return np.zeros((len(matrices), len(self.sampled)), np.float32)
        geometry, rows = self.body
        points = (self.rest[self.sampled], csr.take_rows(self.rows, self.sampled))
        return native.penetration(self.name, (geometry.positions, geometry.triangles, rows), points, matrices)

    def faults_in(self, pose: TestPose, depths: NDArray[np.float32]) -> dict[Fault, NDArray[np.bool_]]:
        """(V,) what a pose does; `depths` (n,) are those of the sampled points in it."""
        now = native.linear_blend(self.name, self.rest, self.rows, pose.pose_from_rest)
        lengths = _lengths(now, self.edges)
        longer = lengths - self.lengths > _LEAST_LENGTHENING * self.diagonal
        ratio = np.where(longer, lengths / np.maximum(self.lengths, 1e-30), 1.0)
        torn = ratio > self.params.torn
        return {
            Fault.STRETCHED: self._ends((ratio > self.params.stretched) & ~torn),
            Fault.TORN: self._ends(torn),
            Fault.OPEN: self._open(now),
            Fault.PENETRATING: self._penetrating(depths),
        }

    def _open(self, now: NDArray[np.float32]) -> NDArray[np.bool_]:
        marked = np.zeros(len(now), bool)
        gap = np.linalg.norm(now[self.doubled] - now[self.first[self.doubled]], axis=1)
        apart = self.doubled[gap > _GAP * self.diagonal]
        marked[apart] = marked[self.first[apart]] = True
        return marked

    def _penetrating(self, depths: NDArray[np.float32]) -> NDArray[np.bool_]:
        marked = np.zeros(len(self.rest), bool)
        marked[self.sampled[depths - self.depth > self.params.deeper * self.diagonal]] = True
        return marked

    def _ends(self, edge: NDArray[np.bool_]) -> NDArray[np.bool_]:
        marked = np.zeros(len(self.rest), bool)
        marked[self.edges[edge].ravel()] = True
        return marked


def _body(source: bpy.types.Object, bones: skeleton.Skeleton) -> tuple[mesh.Geometry, csr.Rows]:
    shape, rows = shapes.read_source(source, "AS_SHOWN", bones.names)
    return shape.geometry, rows


def _check_poses(result: WeightCheck, garment: _Posable, tests: list[TestPose]) -> Jobs[None]:
    for fault in _IN_POSES:
        result.faulty[fault] = np.zeros(result.vertices, bool)
    most = 0
    for start in range(0, len(tests), _AT_ONCE):
        some = tests[start : start + _AT_ONCE]
        depths = garment.depths(np.stack([pose.pose_from_rest for pose in some]))
        for pose, depth in zip(some, depths, strict=True):
            now = garment.faults_in(pose, depth)
            counts = {fault: int(marked.sum()) for fault, marked in now.items()}
            result.poses.append({"pose": pose.name} | {f.name.lower(): count for f, count in counts.items()})
            badness = sum(_IN_POSES[fault] * count for fault, count in counts.items())
            if badness > most:
                most, result.worst = badness, pose
            for fault, marked in now.items():
                result.faulty[fault] |= marked
        yield jobs.Step(min(1.0, (start + _AT_ONCE) / len(tests)))


def _lengths(positions: NDArray[np.float32], edges: NDArray[np.int32]) -> NDArray[np.float32]:
    return np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)
