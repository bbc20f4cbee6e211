"""Corrective shape keys: joints sampled, solved, pulled back to rest, written sparsely and driven by the joints."""

import itertools
import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import jobs, native
from ..scene import armature, driven_keys
from ..scene.error import SceneError
from ..scene.watched import Watched
from . import character as characters
from .character import Character
from .drivers import CHANNELS, expression
from .params import CorrectiveParams
from .pull_back import rest_offsets
from .sampling import Sample, joints, samples
from .selection import needed
from .solving import Solving

PREFIX = "Refine"
RECORD = "skinwright_refine"


@dataclass
class Certificate:
    """What a key does in the pose it was made for, against the Armature modifier alone. Angles in degrees, volumes in
    shares of rest (-0.02: 2 % lost), None for shoulders and the like, bulge as a multiple of rest, error as a share of
    the bone's length."""

    joint: str
    direction: str
    angle: float
    pairs_before: int
    pairs_after: int
    volume_before: float | None
    volume_after: float | None
    bulge_before: float
    bulge_after: float
    error: float


@dataclass
class CorrectiveReport:
    """What was baked; `to_json` is what stays with the mesh."""

    target: str
    rig: str
    sampled: int = 0
    keys: list[str] = field(default_factory=list)
    made_basis: bool = False
    certificates: list[Certificate] = field(default_factory=list)

    def sentence(self) -> str:
        """One line for the status bar."""
        before, after = (sum(getattr(c, name) for c in self.certificates) for name in ("pairs_before", "pairs_after"))
        joints = len({c.joint for c in self.certificates})
        return (
            f"{self.target}: {len(self.keys)} corrective keys for {joints} joints, from {self.sampled} poses; "
            f"intersecting pairs in the sampled poses {before} before, {after} after"
        )

    def all_warnings(self) -> list[str]:
        """Joints that still intersect."""
        left = sorted({c.joint for c in self.certificates if c.pairs_after > 0})
        return [f"{self.target}: skin still intersects at {', '.join(left)} in some sampled pose"] if left else []

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


@dataclass(frozen=True)
class _Solved:
    """A sample's offsets at rest (n, 3) of the vertices (n,) that move."""

    sample: Sample
    vertices: NDArray[np.int64]
    offsets: NDArray[np.float64]


def steps(
    obj: bpy.types.Object,
    params: CorrectiveParams,
    chosen: set[str] | None = None,
    certify: Callable[[CorrectiveReport], None] | None = None,
) -> "jobs.Jobs[CorrectiveReport]":
    """Bake correctives of the chosen joints, or of all that skin follows; nothing is written before all is solved.

    If `certify`, which gets the report once the keys are there, raises, the keys go again.
    """
    driven_keys.check(obj)
    character = characters.read(obj)
    rig = characters.rig_of(obj)
    seen = Watched([obj, rig])
    bones = joints(character, chosen or set())
    if not bones:
        raise SceneError(f"{obj.name} follows none of the chosen joints: choose bones with a parent and with weights")
    poses = samples(bones, params, [armature.rotation_limits(rig, character.bones[bone]) for bone in bones])
    refiner = (yield Solving([lambda: character.refiner(params)]))[0]
    solved = yield Solving([partial(_solve, character, refiner, sample, params) for sample in poses])
    seen.check()
    for one in solved:
        if not np.isfinite(one.offsets).all():
            raise SceneError(
                f"{obj.name}: no finite offsets at {character.bones[one.sample.bone]}; nothing was written"
            )
    keys = _chosen(character, solved, params)
    report = CorrectiveReport(obj.name, character.rig, sampled=len(poses))
    report.certificates = yield Solving([partial(_certify, character, refiner, key) for key in keys])
    seen.check()
    with driven_keys.all_or_nothing(obj, RECORD):
        _write(obj, character, keys, report)
        if certify:
            certify(report)
    return report


def _solve(character: Character, refiner: native.Refiner, sample: Sample, params: CorrectiveParams) -> _Solved:
    pose = sample.pose(character)
    target, before = refiner.solve(pose, quality="bake"), character.skinned(pose)
    offsets = rest_offsets(character, sample, target - before)
    smallest = params.tolerance * float(character.lengths()[sample.bone])
    moved = np.flatnonzero(~(np.linalg.norm(offsets, axis=1) <= smallest))
    return _Solved(sample, moved, offsets[moved])


def _chosen(character: Character, solved: list[_Solved], params: CorrectiveParams) -> list[_Solved]:
    """The samples that get a key, which then know their neighbours among the keys."""
    keys = []
    for _, group in itertools.groupby(solved, lambda one: (one.sample.bone, one.sample.axis, one.sample.sign)):
        ones = list(group)
        vertices = np.unique(np.concatenate([one.vertices for one in ones]))
        fields = [np.zeros((len(vertices), 3)) for _ in ones]
        for field_, one in zip(fields, ones, strict=True):
            field_[np.searchsorted(vertices, one.vertices)] = one.offsets
        sample = ones[0].sample
        most = params.accuracy * float(character.lengths()[sample.bone])
        kept = needed(sample.angles, fields, most)
        angles = tuple(sample.angles[k] for k in kept)
        keys += [replace(ones[k], sample=replace(sample, angles=angles, k=n)) for n, k in enumerate(kept)]
    return keys


def _certify(
    character: Character,
    refiner: native.Refiner,
    key: _Solved,
) -> Certificate:
    """Figures of the pose as the key will show it, the left-out offsets and the damped inverse included."""
    sample, shown = key.sample, character.positions.copy()
    pose = sample.pose(character)
    target, before = refiner.solve(pose, quality="bake"), character.skinned(pose)
    shown[key.vertices] += key.offsets.astype(np.float32)
    after = character.posed(shown, pose)
    first, second = refiner.measure(pose, before), refiner.measure(pose, after)
    one, other = (_of_joint(figures, sample.bone) for figures in (first, second))
    return Certificate(
        joint=character.bones[sample.bone],
        direction=f"{'+' if sample.sign > 0 else '-'}{sample.axis}",
        angle=math.degrees(sample.angle),
        pairs_before=first["pairs"],
        pairs_after=second["pairs"],
        volume_before=one["volume"],
        volume_after=other["volume"],
        bulge_before=one["bulge"],
        bulge_after=other["bulge"],
        error=float(np.linalg.norm(after - target, axis=1).max() / character.lengths()[sample.bone]),
    )


def _of_joint(figures: dict[str, Any], bone: int) -> dict[str, Any]:
    return next((j for j in figures["joints"] if j["bone"] == bone), {"volume": 0.0, "bulge": 1.0})


def _write(obj: bpy.types.Object, character: Character, keys: list[_Solved], report: CorrectiveReport) -> None:
    remove(obj)
    report.made_basis = obj.data.shape_keys is None
    rig = characters.rig_of(obj)
    for key in keys:
        sample = key.sample
        name = f"{PREFIX} {character.bones[sample.bone]} {'+' if sample.sign > 0 else '-'}{sample.axis}"
        block = driven_keys.add(obj, f"{name} {math.degrees(sample.angle):.0f}", key.vertices, key.offsets)
        text, letters = expression(sample)
        driven_keys.drive(block, rig, character.bones[sample.bone], text, {c: CHANNELS[c] for c in letters})
        report.keys.append(block.name)
    obj[RECORD] = json.dumps(report.to_json())


def baked(obj: bpy.types.Object) -> dict[str, Any] | None:
    """What was baked on a mesh, as `CorrectiveReport.to_json` has it; nothing where no correctives are."""
    try:
        record = json.loads(obj.get(RECORD, ""))
    except (TypeError, ValueError):
        return None
    return record if isinstance(record, dict) and "keys" in record else None


def remove(obj: bpy.types.Object) -> int:
    """Take baked correctives away with their drivers, and the Basis if it was made for them; how many there were."""
    record = baked(obj)
    if record is None:
        return 0
    with driven_keys.all_or_nothing(obj, RECORD):
        count = driven_keys.remove(obj, record["keys"], basis_too=record.get("made_basis", False))
        del obj[RECORD]
    return count
