"""What is wrong with a mesh's weights: in the numbers, and in test poses."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..scene import armature, depth, mesh, poses, vertex_groups
from ..scene.error import SceneError
from .params import CheckParams

SUM_TOLERANCE = 1e-4
# An edge longer by less than this part of the mesh's diagonal is no offender, however short it was.
_LEAST_LENGTHENING = 0.005
_MOST_POINTS = 4000


class Fault(Enum):
    """What a vertex can have wrong; the value is what the report calls it."""

    UNWEIGHTED = "without weights"
    UNNORMALISED = "weights not summing to 1"
    OVER_LIMIT = "over the limit of bones"
    STRETCHED = "on stretched edges"
    TORN = "on torn edges"
    PENETRATING = "deeper in the body than at rest"


@dataclass
class WeightCheck:
    """`faulty` (V,) by fault; `poses` holds the counts in every pose."""

    target: str
    vertices: int
    faulty: dict[Fault, NDArray[np.bool_]]
    poses: list[dict[str, Any]] = field(default_factory=list)

    def counts(self) -> dict[Fault, int]:
        """Vertices by fault."""
        return {fault: int(marked.sum()) for fault, marked in self.faulty.items()}

    def sentence(self) -> str:
        """The line the artist reads."""
        found = [f"{count} {fault.value}" for fault, count in self.counts().items() if count]
        tested = f"{len(self.poses)} poses tested"
        return f"{self.target}: {', '.join(found) or 'nothing wrong'} of {self.vertices} vertices; {tested}"

    def to_json(self) -> dict[str, Any]:
        """Plain values only; with the first vertices of each fault."""
        faults = {
            fault.name.lower(): {"vertices": int(marked.sum()), "first": np.flatnonzero(marked)[:100].tolist()}
            for fault, marked in self.faulty.items()
        }
        return {"target": self.target, "vertices": self.vertices, "faults": faults, "poses": self.poses}


def check(target: bpy.types.Object, body: bpy.types.Object | None, limits: CheckParams) -> WeightCheck:
    """Look at the weights, then at each pose. Raises SceneError; the pose and the frame are restored."""
    rig = armature.find(target)
    if rig is None:
        raise SceneError(f"{target.name} has no armature to pose it: give it an Armature modifier")
    deforming = armature.deform_bones(rig)
    names = [group.name for group in target.vertex_groups if group.name in deforming]
    rows = vertex_groups.read(target, names)
    result = WeightCheck(target.name, len(rows.indptr) - 1, faults_of_rows(rows, limits.max_influences))
    used = [names[bone] for bone in np.unique(rows.bones[rows.values > 0]).tolist()]
    _check_poses(result, _Garment(target, body, rig, limits), used)
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


class _Garment:
    """The shapes at rest, and the sampled points whose depth in the body is compared."""

    def __init__(
        self, target: bpy.types.Object, body: bpy.types.Object | None, rig: bpy.types.Object, limits: CheckParams
    ) -> None:
        self.target, self.body, self.rig, self.limits = target, body, rig, limits
        self.edges = mesh.edges(target)
        with poses.at_rest(rig):
            self.rest = mesh.read(target, evaluated=True)
            self.lengths = _lengths(self.rest.positions, self.edges)
            n = len(self.rest.positions)
            self.sampled = np.unique(np.linspace(0, n - 1, min(n, _MOST_POINTS)).astype(int))
            self.depth = self.depth_now(self.rest)

    def depth_now(self, shape: mesh.Geometry) -> NDArray[np.float32]:
        """(P,) of the sampled points, 0 without a body."""
        if self.body is None:
            return np.zeros(len(self.sampled), np.float32)
        return depth.inside(shape.positions[self.sampled], mesh.read(self.body, evaluated=True))

    def pose_names(self, bones: list[str]) -> Iterator[str]:
        """Puts the armature into pose after pose."""
        if self.limits.poses == "ACTION":
            return poses.keyframes(self.rig, self.limits.most_frames)
        return poses.range_of_motion(self.rig, bones, self.limits.angle)

    def faults_now(self) -> dict[Fault, NDArray[np.bool_]]:
        """(V,) what the pose that is shown now does."""
        shape = mesh.read(self.target, evaluated=True)
        lengths, diagonal = _lengths(shape.positions, self.edges), float(np.linalg.norm(self.rest.size))
        ratio = np.where(
            lengths - self.lengths > _LEAST_LENGTHENING * diagonal, lengths / np.maximum(self.lengths, 1e-30), 1.0
        )
        deeper = self.depth_now(shape) - self.depth > self.limits.deeper * diagonal
        penetrating = np.zeros(len(shape.positions), bool)
        penetrating[self.sampled[deeper]] = True
        torn = ratio > self.limits.torn
        return {
            Fault.STRETCHED: self._ends((ratio > self.limits.stretched) & ~torn),
            Fault.TORN: self._ends(torn),
            Fault.PENETRATING: penetrating,
        }

    def _ends(self, edge: NDArray[np.bool_]) -> NDArray[np.bool_]:
        marked = np.zeros(len(self.rest.positions), bool)
        marked[self.edges[edge].ravel()] = True
        return marked


def _check_poses(result: WeightCheck, garment: _Garment, bones: list[str]) -> None:
    for fault in (Fault.STRETCHED, Fault.TORN, Fault.PENETRATING):
        result.faulty[fault] = np.zeros(result.vertices, bool)
    for name in garment.pose_names(bones):
        now = garment.faults_now()
        result.poses.append({"pose": name} | {fault.name.lower(): int(marked.sum()) for fault, marked in now.items()})
        for fault, marked in now.items():
            result.faulty[fault] |= marked


def _lengths(positions: NDArray[np.float32], edges: NDArray[np.int32]) -> NDArray[np.float32]:
    return np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)
