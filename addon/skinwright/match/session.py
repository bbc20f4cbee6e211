"""The match of one target, prepared once and thresholded or solved again and again: no event, no window.

`current` is the one on show. It names its objects instead of holding them, as undo replaces them.
"""

from dataclasses import dataclass, replace
from enum import IntEnum

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..jobs import Jobs
from ..scene import identity, mask, vertex_groups
from ..transfer.checks import check_objects
from ..transfer.compute import Result, bone_rows, prepare, to_result
from ..transfer.inputs import read_body, read_garment, read_mask
from ..transfer.params import TransferParams

_THRESHOLDS = (
    "method",
    "softness",
    "max_distance",
    "relative_max_distance",
    "max_normal_angle",
    "match_flipped_normals",
)
_NO_ISLAND = np.uint32(0xFFFFFFFF)


class Category(IntEnum):
    """What becomes of a vertex."""

    MATCHED = 0
    INPAINTED = 1
    FORCED_MATCH = 2
    FORCED_INPAINT = 3
    UNMATCHED_ISLAND = 4  # a loose part of which no vertex matches


@dataclass(frozen=True)
class Match:
    """`category` (V,) of every vertex under these thresholds; lengths in world units, angles in radians. `confidence`
    (V,) in the row from the source, 0 to 1, or None with the paper's method, which knows only all or nothing."""

    category: NDArray[np.uint8]
    confidence: NDArray[np.float32] | None
    max_distance: float
    max_normal_angle: float

    def counts(self) -> NDArray[np.int64]:
        """Vertices by category."""
        return np.bincount(self.category, minlength=len(Category))


class MatchSession:
    """A body and a target: closest points are found, and each block's factorisation is kept."""

    def __init__(self, source: bpy.types.Object, target: bpy.types.Object, params: TransferParams) -> None:
        """Raises SceneError or native.NativeError with a sentence."""
        check_objects(source, [target], params)
        self.source_name = source.name
        self.object = identity.of(target)
        self.body = read_body(source, params)
        self.garment = read_garment(target, self.body, params)
        self.inpainting = prepare(self.body, self.garment, params)
        self.n_vertices = self.garment.completion.n_own
        self.mask = np.full(self.n_vertices, mask.AUTOMATIC, np.uint8)
        self.mask_version = 0
        self.read_mask(target)
        self._key: tuple = ()
        self.last_match: Match | None = None
        self.written: csr.Rows | None = None
        # While a job solves, asking for the match would wait for it.
        self.solving = False

    @property
    def target_name(self) -> str:
        """The target's present name."""
        self.object.find()
        return self.object.name

    def target(self) -> bpy.types.Object | None:
        """The target, while it is there with as many vertices as it had."""
        obj = self.object.find()
        fits = obj is not None and obj.type == "MESH" and len(obj.data.vertices) == self.n_vertices
        return obj if fits else None

    def read_mask(self, target: bpy.types.Object) -> bool:
        """Read the mask anew; gives whether it has changed."""
        group = target.skinwright.mask_group
        now = read_mask(target) if group in target.vertex_groups else None
        if now is None:
            now = np.full(self.n_vertices, mask.AUTOMATIC, np.uint8)
        if np.array_equal(now, self.mask):
            return False
        self.mask, self.mask_version = now, self.mask_version + 1
        return True

    def match(self, params: TransferParams) -> Match:
        """The categories under the thresholds in `params`; nothing is searched or solved."""
        thresholds = {name: getattr(params, name) for name in _THRESHOLDS}
        key = (*thresholds.values(), self.mask_version)
        if key != self._key or self.last_match is None:
            self._key, self.last_match = key, self._threshold(thresholds, params)
        return self.last_match

    def _threshold(self, thresholds: dict, params: TransferParams) -> Match:
        confidence = self.inpainting.confidence(**thresholds, mask=self.mask)
        matched = confidence >= 0.5
        category = np.where(matched, Category.MATCHED, Category.INPAINTED).astype(np.uint8)
        category[matched & (self.mask == mask.FORCE_MATCH)] = Category.FORCED_MATCH
        category[self.mask == mask.INPAINT] = Category.FORCED_INPAINT
        category[~matched & ~has_any(self.inpainting.islands, confidence > 0)] = Category.UNMATCHED_ISLAND
        max_distance = self.inpainting.max_distance(params)
        graded = confidence if params.method == "confidence" else None
        return Match(category, graded, max_distance, params.max_normal_angle)

    def matched(self, match: Match) -> NDArray[np.bool_]:
        """(V,) whether a vertex takes the weights of its closest point."""
        return np.isin(match.category, (Category.MATCHED, Category.FORCED_MATCH))

    def chosen(self, what: str, match: Match, selected: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(V,) the vertices that `what` stands for: MATCHED, UNMATCHED, LOOSE parts, or the ISLAND of the selected."""
        if what == "ISLAND":
            return has_any(self.inpainting.islands, selected)
        if what == "LOOSE":
            return match.category == Category.UNMATCHED_ISLAND
        return self.matched(match) == (what == "MATCHED")

    def solve(self, params: TransferParams, near: bool = False) -> Jobs[Result]:
        """The new rows under the mask as it was read last; with `near` sooner, and not quite the same, if the mask has
        changed in few places since the last solve: `report["solved_near"]` is a number then."""
        garment = replace(self.garment, mask=self.mask)
        transfer, rows = yield from bone_rows(self.inpainting, garment, params, near)
        return to_result(self.body, garment, transfer, garment.names, rows, 0.0)

    def write(self, target: bpy.types.Object, result: Result) -> int:
        """Write the rows that differ from those written last; gives their number."""
        changed = result.written & differs(result.rows, self.written)
        vertices = np.flatnonzero(changed)
        if vertices.size:
            vertex_groups.write(target, result.names, csr.take_rows(result.rows, vertices), vertices)
        self.written = result.rows
        return len(vertices)


# The match on show, if any.
current: MatchSession | None = None


def current_of(obj: bpy.types.Object | None) -> MatchSession | None:
    """The match on show, if it is this object's."""
    return current if obj and current and current.target() == obj else None


def has_any(islands: NDArray[np.uint32], marked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(V,) whether any vertex of a vertex' island is marked; a vertex that no face uses is an island by itself."""
    inside = islands != _NO_ISLAND
    found = np.zeros(int(islands[inside].max(initial=0)) + 1, bool)
    found[islands[inside & marked]] = True
    return np.where(inside, found[np.where(inside, islands, 0)], marked)


def differs(rows: csr.Rows, before: csr.Rows | None) -> NDArray[np.bool_]:
    """(V,) the rows that are not bit for bit as before."""
    n = len(rows.indptr) - 1
    if before is None or not before.bones.size:
        return np.ones(n, bool)
    counts = np.diff(rows.indptr)
    changed = counts != np.diff(before.indptr)
    # Where each entry was before, if its row had as many.
    moved = np.where(changed, 0, before.indptr[:-1].astype(np.int64) - rows.indptr[:-1])
    at = np.arange(len(rows.bones), dtype=np.int64) + np.repeat(moved, counts)
    at = np.minimum(at, len(before.bones) - 1)
    entry = np.flatnonzero((rows.bones != before.bones[at]) | (rows.values != before.values[at]))
    changed[np.searchsorted(rows.indptr, entry, side="right") - 1] = True
    return changed
