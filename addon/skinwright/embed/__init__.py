"""An armature for meshes that have none: from a template character, or a bare armature."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import jobs, native
from ..csr import Rows
from ..declared import native_keywords
from ..jobs import Jobs
from ..retarget import bone_names, whole
from ..retarget.inputs import joined_rows
from ..scene import armature, attaching, embedded, evaluation, followers, object_state, rest_bones
from ..scene.error import SceneError
from ..scene.rest_bones import RestBones
from ..scene.watched import Watched
from .params import EmbedParams

__all__ = ["EmbedParams", "EmbedReport", "embed_armature", "steps"]

# Bones less sure than this are selected, for the artist to look at.
UNSURE = 0.5


@dataclass(frozen=True)
class EmbedReport:
    """What an embedding did; `confidence` is of each bone's head, 0 to 1."""

    armature: str
    meshes: list[str]
    confidence: dict[str, float]
    outside: list[str]
    seconds: float
    warnings: list[str] = field(default_factory=list)

    def sentence(self) -> str:
        """The line the artist reads when it is done."""
        unsure = sum(value < UNSURE for value in self.confidence.values())
        look = f"{unsure} of them selected, as they need a look" if unsure else "all of them sure"
        return f"{self.armature}: {len(self.confidence)} bones placed, {look}; {self.seconds:.2f} s"

    def all_warnings(self) -> list[str]:
        """Sentences worth a look."""
        return self.warnings

    def to_json(self) -> dict[str, Any]:
        """Plain values only."""
        return asdict(self) | {"sentence": self.sentence()}


def embed_armature(
    context: bpy.types.Context, source: bpy.types.Object, targets: Sequence[bpy.types.Object], params: EmbedParams
) -> EmbedReport:
    """Put a copy of armature `source` into the meshes `targets`. Nothing that is there is changed, but for `bind`."""
    return jobs.wait(steps(context, source, targets, params))


def steps(
    context: bpy.types.Context, source: bpy.types.Object, targets: Sequence[bpy.types.Object], params: EmbedParams
) -> Jobs[EmbedReport]:
    """The same, job by job. Nothing is made before all is computed."""
    source = _rig_of(source)
    targets = list(dict.fromkeys(targets))  # one named twice is one
    donors, left_out = rest_bones.visible(rest_bones.meshes(source, context.scene), source)
    evaluation.bring_up_to_date([source, *donors, *targets])
    bones = rest_bones.read(source, [bone.name for bone in source.data.bones])
    if not bones.names:
        raise SceneError(f"{source.name} has no bones: pick the armature of another character")
    for obj in targets:
        if params.bind and not obj.is_editable:
            raise SceneError(f"{obj.name} is linked from another file: make it local, or turn Bind off")
    for obj in targets:
        if not obj.data.polygons:
            raise SceneError(f"{obj.name} has no faces: bones are laid into a surface, so give it some")
    seen = whole.read(targets)
    for obj, start, end in zip(targets, seen.starts, seen.starts[1:], strict=False):
        _check_extent(obj, seen.positions[start:end])
    options: dict[str, Any] = native_keywords(params)
    donor: tuple = ()
    if params.method == "template":
        donor = _donor(source, donors, bones)
        options |= {"mirror": mirror(bones.names)} if params.symmetric else {}
    arrays = (bones.heads.astype(np.float32), bones.tails.astype(np.float32), bones.parents)
    watched = Watched([source, *targets])
    embedding = yield native.start_embedding(
        targets[0].name, (seen.positions, seen.triangles), arrays, donor, **options
    )
    watched.check()
    misfit = _misfit(source, donor[0]) if donor else ""
    report = _write(context, source, list(targets), bones, embedding, params)
    if misfit:
        report.warnings.append(misfit)
    if donor and left_out:
        report.warnings.append(rest_bones.left_out_of(source, left_out))
    return report


def _rig_of(source: bpy.types.Object) -> bpy.types.Object:
    """The armature that is meant: the object itself, or the one that deforms it."""
    rig = source if source.type == "ARMATURE" else armature.find(source)
    if rig is None:
        raise SceneError(f"{source.name} is no armature and has none: pick the armature of another character")
    return rig


def _donor(
    source: bpy.types.Object, donors: list[bpy.types.Object], bones: RestBones
) -> tuple[NDArray[np.float32], NDArray[np.uint32], Rows]:
    meshes = [obj for obj in donors if obj.vertex_groups and obj.data.edges]
    if not meshes:
        raise SceneError(
            f"{source.name} deforms no mesh that has weights: pick the armature of a skinned character, "
            "or set Method to Shape Alone"
        )
    seen = whole.read(meshes, source)
    _check_extent(meshes[0], seen.positions)
    return seen.positions, seen.triangles, seen.rows(joined_rows(meshes, bones.names), source, bones.names)


def _misfit(source: bpy.types.Object, positions: NDArray[np.float32]) -> str:
    """Controls may lie anywhere, so that deforming bones count."""
    deforming = sorted(armature.deform_bones(source)) or source.data.bones.keys()
    return rest_bones.misfit(source, rest_bones.read(source, deforming), positions)


def _check_extent(obj: bpy.types.Object, positions: NDArray[np.float32]) -> None:
    if not np.ptp(positions, axis=0).any():
        raise SceneError(f"All vertices of {obj.name} lie at one place: bones need room, so give it a shape")


def mirror(names: list[str]) -> NDArray[np.int32]:
    """(B,) the bone of the same name on the other side, the bone itself in the middle, -1 if there is none."""
    place = {(bone_names.without_side(name), bone_names.side(name)): j for j, name in enumerate(names)}
    other = {"L": "R", "R": "L", "": ""}
    keys = [(bone_names.without_side(name), other[bone_names.side(name)]) for name in names]
    return np.array(
        [j if not key[1] else place.get(key, -1) for j, key in enumerate(keys)],
        np.int32,
    )


def _write(
    context: bpy.types.Context,
    source: bpy.types.Object,
    targets: list[bpy.types.Object],
    bones: RestBones,
    embedding: Any,
    params: EmbedParams,
) -> EmbedReport:
    name = f"{targets[0].name} Rig"
    if not all(np.isfinite(found).all() for found in (embedding.heads, embedding.tails, embedding.confidence)):
        raise SceneError(f"{source.name} does not fit {targets[0].name}, so nothing was made: look at both shapes")
    confidence = dict(zip(bones.names, embedding.confidence.tolist(), strict=True))
    places = {b: (h, t) for b, h, t in zip(bones.names, embedding.heads, embedding.tails, strict=True)}
    outside = [bones.names[j] for j in embedding.report["outside"]]
    warnings = [f"Bones that could not be moved inside of the mesh: {', '.join(outside[:8])}"] if outside else []
    meshes = [obj.name for obj in targets]
    rig = embedded.create(context, name, source, bones, places)
    try:
        with object_state.all_or_nothing(targets):
            embedded.mark(rig, confidence, {bone for bone, value in confidence.items() if value < UNSURE})
            for obj in targets if params.bind else ():
                if armature.find(obj) is None:
                    attaching.bind(obj, rig)
                warnings += [
                    f"{obj.name} {phrase}: end that if {rig.name} alone is to move it"
                    for phrase in followers.phrases(obj, rig, ())
                ]
            return EmbedReport(rig.name, meshes, confidence, outside, embedding.report["seconds"], warnings)
    except BaseException:
        embedded.remove(rig)
        raise
