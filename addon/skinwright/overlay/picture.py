"""What the overlay shows: a shape, a colour value on each vertex, and the figures of the legend."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import bpy
import numpy as np
from numpy.typing import NDArray

from ..check import shown as checked
from ..check.weight_check import Fault, WeightCheck
from ..csr import Rows
from ..match import explain
from ..match import session as match_session
from ..match.session import Category, Match, MatchSession
from ..scene import armature, changes, deformation, mesh, vertex_groups
from ..stored import comparing
from ..transfer.params import TransferParams

CATEGORY_NAMES = {
    Category.MATCHED: "Matched",
    Category.INPAINTED: "Inpainted",
    Category.FORCED_MATCH: "Forced to match",
    Category.FORCED_INPAINT: "Forced to inpaint",
    Category.UNMATCHED_ISLAND: "Loose part without match",
}
CONFIDENCE_NAMES = {
    1.0: "Copied from the source",
    0.5: "Smoothed over its own gap",
    0.0: "Filled in from around",
}
FORCED = (Category.FORCED_MATCH, Category.FORCED_INPAINT, Category.UNMATCHED_ISLAND)
INFLUENCE_NAMES = ("No bone", "1 bone", "2 bones", "3 bones", "4 bones", "5 bones or more")
HISTOGRAM_BINS = 48


@dataclass(frozen=True)
class Histogram:
    """Vertices by a value from 0 to `high`; `threshold` and the ends in the value's own unit."""

    label: str
    unit: str
    counts: NDArray[np.int64]
    high: float
    threshold: float


@dataclass(frozen=True)
class Picture:
    """`values` (V,) mean what `kind` says: a category, a confidence, a number of influences, a stretch, a fault."""

    kind: str
    object_name: str
    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    triangles: NDArray[np.integer]
    values: NDArray[np.number]
    rows: Sequence[tuple[float, str]]
    histograms: list[Histogram] = field(default_factory=list)
    note: str = ""


_kept: tuple[tuple, Picture] | None = None
_triangles: tuple[tuple, NDArray[np.uint32]] | None = None


def forget() -> None:
    """Drop what is kept between drawings."""
    global _kept, _triangles
    _kept = _triangles = None
    match_session.current = comparing.current = explain.current = None


def picture(context: bpy.types.Context, kind: str, params: TransferParams) -> Picture | None:
    """What to draw now, made anew only when something has changed; None where there is nothing to show."""
    global _kept
    session = match_session.current if kind == "MATCH" else None
    obj = shown_object(context, kind, session)
    if obj is None:
        return None
    match = _match(obj, session, params) if session else None
    key = (kind, obj.name, changes.version, id(match), id(comparing.current), id(checked.of(obj)))
    if _kept is None or _kept[0] != key:
        _kept = (key, _make(context, kind, obj, session, match))
    return _kept[1]


def shown_object(context: bpy.types.Context, kind: str, session: MatchSession | None) -> bpy.types.Object | None:
    """The target of the match on show, or the active mesh; not in Edit mode, where the mesh is another."""
    if kind == "MATCH":
        obj = session.target() if session else None
    else:
        obj = context.object if context.object and context.object.type == "MESH" else None
    return obj if obj and obj.mode != "EDIT" and obj.visible_get() and obj.data.polygons else None


_seen_version = -1


def _match(obj: bpy.types.Object, session: MatchSession, params: TransferParams) -> Match:
    """While a job solves, the match before it."""
    global _seen_version
    if _seen_version != changes.version:
        session.read_mask(obj)
        _seen_version = changes.version
    if session.solving and session.last_match:
        return session.last_match
    return session.match(params)


def _make(
    context: bpy.types.Context, kind: str, obj: bpy.types.Object, session: MatchSession | None, match: Match | None
) -> Picture:
    positions, normals, fits = deformation.shown(obj, context.view_layer.depsgraph)
    shape = {
        "kind": kind,
        "object_name": obj.name,
        "positions": positions,
        "normals": normals,
        "triangles": _triangles_of(obj),
        "note": "" if fits else "At rest: a modifier adds vertices",
    }
    if session and match:
        return _picture_of_match(match, session, shape)
    if kind == "DIFFERENCE":
        return _picture_of_difference(obj, shape)
    if kind == "INFLUENCES":
        return _picture_of_influences(obj, shape)
    if kind == "FAULTS":
        return _picture_of_faults(checked.of(obj), shape)
    values = deformation.stretch(mesh.edges(obj), mesh.rest_positions(obj.data), positions)
    rows = [(-1, "Half as long"), (0, "As at rest"), (1, "Twice as long")]
    return Picture(**shape, values=values, rows=rows)


def _triangles_of(obj: bpy.types.Object) -> NDArray[np.uint32]:
    """Kept while painting and posing, which leave the numbers of everything alone."""
    global _triangles
    key = (obj.name, len(obj.data.vertices), len(obj.data.polygons), len(obj.data.loops))
    if _triangles is None or _triangles[0] != key:
        _triangles = (key, mesh.triangles(obj))
    return _triangles[1]


def _picture_of_match(match: Match, session: MatchSession, shape: dict) -> Picture:
    counts = match.counts()
    if match.confidence is not None:
        return _picture_of_confidence(match.confidence, match.category, counts, shape)
    rows = [(category, f"{name}: {counts[category]:,}") for category, name in CATEGORY_NAMES.items()]
    inpainting = session.inpainting
    histograms = [
        histogram("Distance", "LENGTH", inpainting.distance, match.max_distance, match.max_distance * 2.5),
        histogram("Angle", "ROTATION", inpainting.angle, match.max_normal_angle, np.pi),
    ]
    return Picture(**shape, values=match.category, rows=rows, histograms=histograms)


def _picture_of_confidence(confidence: NDArray, category: NDArray, counts: NDArray, shape: dict) -> Picture:
    """A scale, and the categories that the mask or the policy decides."""
    values = np.where(np.isin(category, FORCED), category, confidence).astype(np.float32)
    rows: list[tuple[float, str]] = list(CONFIDENCE_NAMES.items())
    rows += [(float(forced), f"{CATEGORY_NAMES[forced]}: {counts[forced]:,}") for forced in FORCED]
    return Picture(**shape | {"kind": "CONFIDENCE"}, values=values, rows=rows)


def histogram(label: str, unit: str, values: NDArray, threshold: float, high: float) -> Histogram:
    """Values beyond `high` count in the last bin, those that are not numbers nowhere."""
    high = high if high > 0 else max(float(np.nanmax(values, initial=0)), 1e-9)
    kept = np.minimum(values[np.isfinite(values)], high)
    counts, _ = np.histogram(kept, HISTOGRAM_BINS, (0, high))
    return Histogram(label, unit, counts, high, threshold)


def _picture_of_faults(result: WeightCheck | None, shape: dict) -> Picture:
    """0 for a sound vertex, else the number of its worst fault, from 1."""
    values = np.zeros(len(shape["positions"]), np.int64)
    if result is None:
        return Picture(**shape | {"note": "Check the weights first"}, values=values, rows=[])
    rows = [(0, f"Sound: {int((~result.any_fault()).sum()):,}")]
    for number, fault in enumerate(Fault, 1):
        values[result.faulty[fault]] = number
        if result.faulty[fault].any():
            rows.append((number, f"{fault.name.replace('_', ' ').title()}: {int(result.faulty[fault].sum()):,}"))
    worst = f"Worst: {result.worst.name}" if result.worst else "No fault in any pose"
    return Picture(**shape | {"note": worst}, values=values, rows=rows)


def _picture_of_influences(obj: bpy.types.Object, shape: dict) -> Picture:
    weights = vertex_groups.read(obj, _bone_names(obj))
    count = influences(weights)
    spare = len(weights.bones) - int(count.sum())
    notes = [shape["note"], f"and {spare:,} members of weight 0" if spare else ""]
    numbers = np.bincount(np.minimum(count, 5), minlength=6)
    rows = [(n, f"{name}: {numbers[n]:,}") for n, name in enumerate(INFLUENCE_NAMES)]
    return Picture(**shape | {"note": ". ".join(filter(None, notes))}, values=count, rows=rows)


def _picture_of_difference(obj: bpy.types.Object, shape: dict) -> Picture:
    """As it was when the weights were compared: comparing takes too long for every drawing."""
    shown = comparing.current
    if shown is None or shown.object_name != obj.name or len(shown.difference) != len(shape["positions"]):
        return Picture(**shape, values=np.zeros(len(shape["positions"])), rows=[(0, "Press Compare Weights")])
    changed = int((shown.difference > 1e-6).sum())
    rows: list[tuple[float, str]] = [(0, f"Equal, but for {changed:,} vertices"), (0.5, "Half on other bones")]
    rows.append((1, "All on other bones"))
    return Picture(**shape, values=shown.difference, rows=rows)


def influences(rows: Rows) -> NDArray[np.int64]:
    """(V,) the bones with a weight above 0."""
    vertex = np.repeat(np.arange(len(rows.indptr) - 1, dtype=np.int64), np.diff(rows.indptr))
    return np.bincount(vertex[rows.values > 0], minlength=len(rows.indptr) - 1)


def _bone_names(obj: bpy.types.Object) -> list[str]:
    rig = armature.find(obj)
    names = [group.name for group in obj.vertex_groups]
    return [name for name in names if name in armature.deform_bones(rig)] if rig else names
