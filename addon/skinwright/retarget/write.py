"""The one place where a retargeting changes the scene."""

from collections.abc import Callable, Sequence
from dataclasses import asdict

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..scene import attributes, editable, followers, mirror, object_state, rest_bones, sides, vertex_groups
from ..transfer import strangers
from .compute import Result
from .inputs import Character, Pair
from .params import RetargetParams
from .report import RetargetReport, together

ATTRIBUTE = "Correspondence"
_FEW = 8


def write(
    done: list[tuple[Pair, Result]],
    params: RetargetParams,
    before_write: Callable[[Sequence[bpy.types.Object]], None] | None = None,
) -> RetargetReport:
    """Write every mesh of every target, or none. Locked groups and groups that are not bones stay as they are."""
    targets = [obj for pair, _ in done for obj in pair.target.meshes]
    if before_write:
        before_write(targets)
    shown = [*done[0][0].source.meshes, *targets] if params.show_correspondence else []
    with object_state.all_or_nothing(targets), attributes.all_or_nothing(shown, ATTRIBUTE):
        reports = [_write_character(pair, result) for pair, result in done]
        for pair, result in done if params.show_correspondence else ():
            _show(pair, result)
        return together(reports)


def _write_character(pair: Pair, result: Result) -> RetargetReport:
    warnings = _warnings(pair, result)
    for (obj, start, end), held in zip(_parts(pair.target), pair.held, strict=True):
        warnings += _write_mesh(pair, result, obj, held, np.arange(start, end, dtype=np.int64))
    return _report(pair, result, warnings)


def _parts(character: Character) -> list[tuple[bpy.types.Object, int, int]]:
    return list(zip(character.meshes, character.starts[:-1], character.starts[1:], strict=True))


def _write_mesh(
    pair: Pair, result: Result, obj: bpy.types.Object, held: NDArray[np.bool_], mine: NDArray[np.int64]
) -> list[str]:
    names, vertices = pair.target.bones.names, np.flatnonzero(result.written[mine])
    rows = csr.take_rows(result.rows, mine[vertices])
    present = {group.name for group in obj.vertex_groups}
    used = np.bincount(rows.bones, minlength=len(names)) > 0
    written = ~held & (used | np.array([name in present for name in names], bool))
    kept = [name for name, is_written in zip(names, written, strict=True) if is_written]
    vertex_groups.write(obj, kept, csr.take_columns(rows, written), vertices)
    rig, shape = pair.target.armature, pair.target.positions[mine]
    known = sides.opposites(rig, names)
    warnings = [editable.changes_others(obj), mirror.warning(obj, np.array(obj.matrix_world), shape, rig, known)]
    warnings += [
        f"{obj.name} {phrase}: end that if the weights alone are to move it"
        for phrase in followers.phrases(obj, rig, kept)
    ]
    short = csr.row_sums(vertex_groups.read(obj, names))[vertices] < 1 - 1e-3 if held.any() else np.zeros(0, bool)
    if short.any():
        locked = _listed([name for name, is_held in zip(names, held, strict=True) if is_held])
        warnings.append(
            f"The weights of {int(short.sum())} vertices of {obj.name} sum to less than 1, as they would follow "
            f"locked groups: unlock {locked}"
        )
    return [warning for warning in warnings if warning]


def _warnings(pair: Pair, result: Result) -> list[str]:
    warnings = [rest_bones.left_out_of(pair.source.armature, pair.source.left_out)] if pair.source.left_out else []
    for one in (pair.source, pair.target):
        warnings += [text for text in [rest_bones.misfit(one.armature, one.bones, one.positions)] if text]
    warnings += strangers.warnings(pair.source.meshes, [pair.source.armature], pair.source.bones.names)
    alone = [entry.target for entry in pair.matches if not entry.source]
    if alone:
        warnings.append(f"Bones of {pair.target.armature.name} without a partner get no weight: {_listed(alone)}")
    heirs = [f"{bone} to {heir}" for bone, heir in _inherited(pair, result)]
    if heirs:
        warnings.append(f"Bones of {pair.source.armature.name} without a partner gave their share: {_listed(heirs)}")
    unsure = [entry.target for entry in pair.matches if entry.source and entry.confidence < 0.5]
    if unsure:
        warnings.append(f"Bones paired by their place only, look at the bone map: {_listed(unsure)}")
    unweighted = result.retarget.report["unweighted"]
    if unweighted:
        warnings.append(
            f"{unweighted} vertices have no weight, as the source has none there; they were left as they were"
        )
    return warnings


def _inherited(pair: Pair, result: Result) -> list[tuple[str, str]]:
    names = pair.source.bones.names
    return [(names[bone], names[heir]) for bone, heir in result.retarget.report["inherited"]]


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _FEW} more" if len(names) > _FEW else ""
    return ", ".join(names[:_FEW]) + more


def _show(pair: Pair, result: Result) -> None:
    """Colors that say where a vertex lies in the source's bounding box, on both characters."""
    low = pair.source.positions.min(axis=0)
    size = np.maximum(np.ptp(pair.source.positions, axis=0), 1e-12)
    for character, points in ((pair.source, pair.source.positions), (pair.target, result.retarget.points)):
        colors = _colors((points - low) / size)
        for obj, start, end in _parts(character):
            attributes.write_colors(obj, ATTRIBUTE, colors[start:end])


def _colors(places: NDArray[np.float32]) -> NDArray[np.float32]:
    opaque = np.ones((len(places), 4), np.float32)
    opaque[:, :3] = np.clip(places, 0, 1)
    return opaque


def _report(pair: Pair, result: Result, warnings: list[str]) -> RetargetReport:
    native = result.retarget.report
    return RetargetReport(
        source=pair.source.armature.name,
        target=pair.target.armature.name,
        meshes=[obj.name for obj in pair.target.meshes],
        vertices=native["vertices"],
        matched=native["matched"],
        filled=native["filled"],
        unweighted=native["unweighted"],
        confidence=round(float(result.retarget.confidence.mean()), 4),
        bone_map=[asdict(entry) for entry in pair.matches],
        inherited=_inherited(pair, result),
        landmarks=native["landmarks"],
        seconds=dict(native["seconds"]),
        warnings=warnings,
    )
