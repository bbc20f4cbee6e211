"""Targets laid over a body and ready to be solved, once or again and again."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import csr, native
from ..csr import Rows
from ..scene.mesh import Geometry, transformed
from . import parts
from .inputs import Body, Garment
from .params import TransferParams

# Without thresholds, what is farther away than this share of the body's diagonal is in the wrong place or unit.
_OUT_OF_REACH = 0.5
# Of the target's diagonal: as far as the setting goes.
_WIDEST_WELD = 0.01


class Prepared:
    """Targets laid over a body as one mesh; the mask and the thresholds may still change.

    Arrays are those of the targets' own vertices, one target after the other: no mirrored halves.
    """

    def __init__(self, body: Body, source: native.Source, garments: Sequence[Garment], params: TransferParams) -> None:
        self.garments = garments
        self.name = " + ".join(garment.object.name for garment in garments)
        united = parts.united([garment.geometry for garment in garments])
        self._shapes = (united, body.geometry)
        self._frame = body.unturned
        self._settings = self._keywords(params)
        self._inpainting = native.Inpainting(
            source,
            self.name,
            in_frame(united.positions, self._frame),
            united.triangles,
            params.threads,
            edges=united.wires,
            **self._settings,
        )

    def max_distance(self, params: TransferParams) -> float:
        """The distance in force, world units."""
        absolute = self._keywords(params)["max_distance"]
        return params.relative_max_distance * self._reference if absolute is None else float(absolute)

    @cached_property
    def _reference(self) -> float:
        """What a relative distance refers to, world units."""
        target, source = (_diagonal(shape, self._frame) for shape in self._shapes)
        return max(target, 0.3 * source)

    def check_reach(self, params: TransferParams) -> None:
        """Raise NativeError if all is so far away that it must be a mistake; thresholds refuse that by themselves."""
        if params.method != "confidence":
            return
        reach = _OUT_OF_REACH * _diagonal(self._shapes[1], self._frame)
        nearest = float(np.min(self.distance, initial=np.inf))
        if nearest > reach:
            raise native.NativeError(
                f"{self.name}: nothing matched: its smallest distance from the source is {nearest:.4g}, more than half "
                "of the source's size: check that both have the same scale and place"
            )

    def set_source_weights(self, rows: Rows, n_columns: int) -> None:
        """Gives the body other weights; a solve with them factors nothing again."""
        self._inpainting.set_source_weights(rows, n_columns)

    @cached_property
    def distance(self) -> NDArray[np.float32]:
        """(V,) world units."""
        return self._own(self._inpainting.distance)

    @cached_property
    def angle(self) -> NDArray[np.float32]:
        """(V,) radians."""
        return self._own(self._inpainting.angle)

    @cached_property
    def islands(self) -> NDArray[np.uint32]:
        """(V,) the loose part of each vertex."""
        return self._own(self._inpainting.islands)

    def matched(self, **thresholds: Any) -> NDArray[np.bool_]:
        """(V,) which vertices match; waits for a job that is going on. `mask` (V,) may be among the keywords."""
        mask = thresholds.pop("mask", None)
        return self._own(self._inpainting.matched(mask=self._spread([mask]), **self._settings | thresholds))

    def confidence(self, **thresholds: Any) -> NDArray[np.float32]:
        """(V,) how far each vertex's row from the source is trusted, 0 to 1; otherwise as `matched`."""
        mask = thresholds.pop("mask", None)
        return self._own(self._inpainting.confidence(mask=self._spread([mask]), **self._settings | thresholds))

    def start(
        self,
        masks: Sequence[NDArray[np.uint8] | None],
        params: TransferParams,
        max_influences: int,
        near: bool = False,
    ) -> native.Job:
        """Solve on threads of Rust's own; a mask (V,) or None for each target. With `near` only around what the masks
        have changed since the last solve, if that can be: `report["solved_near"]` tells."""
        settings = self._keywords(params) | {"max_influences": max_influences}
        return self._inpainting.start(mask=self._spread(masks), near=near, **settings)

    def _keywords(self, params: TransferParams) -> dict[str, Any]:
        """The settings of a solve."""
        settings = params.native() | {"average_ties": True}  # mirrored places are to get mirrored rows
        del settings["threads"]
        welded = max(garment.welded for garment in self.garments)
        if welded:
            share = welded / max(_diagonal(self._shapes[0], self._frame), 1e-30)
            settings["relative_weld_tolerance"] = min(max(params.relative_weld_tolerance, share), _WIDEST_WELD)
        distances = [garment.distance for garment in self.garments]
        return settings if None in distances else settings | {"max_distance": max(distances)}  # type: ignore[type-var]

    def lost_halves(self) -> list[bool]:
        """Whether what Mirror modifiers add to a target matches less than half as well as the target itself."""
        if all(len(g.geometry.positions) == g.completion.n_own for g in self.garments):
            return [False] * len(self.garments)
        masks = self._spread([garment.mask for garment in self.garments])
        matched, starts = self._inpainting.matched(mask=masks, **self._settings), self._starts()
        lost = []
        for garment, start in zip(self.garments, starts, strict=False):
            own, end = start + garment.completion.n_own, start + len(garment.geometry.positions)
            lost.append(end > own and bool(matched[own:end].mean() < 0.5 * matched[start:own].mean()))
        return lost

    def _starts(self) -> NDArray[np.int64]:
        """Where each target's vertices begin, mirrored ones too, and the end."""
        return np.cumsum([0, *(len(g.geometry.positions) for g in self.garments)], dtype=np.int64)

    def split(self, values: NDArray) -> list[NDArray]:
        """Values of all vertices, mirrored ones too, as those of each target's own."""
        own = [garment.completion.n_own for garment in self.garments]
        return [values[start : start + n] for start, n in zip(self._starts(), own, strict=False)]

    def rows_of(self, rows: Rows, number: int) -> Rows:
        """The rows of one target's vertices, mirrored ones too."""
        start, end = self._starts()[number : number + 2].tolist()
        return csr.take_rows(rows, np.arange(start, end, dtype=np.int64))

    def _own(self, values: NDArray) -> NDArray:
        found = self.split(values)
        return found[0] if len(found) == 1 else np.concatenate(found)

    def _spread(self, masks: Sequence[NDArray[np.uint8] | None]) -> NDArray[np.uint8] | None:
        if all(mask is None for mask in masks):
            return None
        full = [
            np.ones(garment.completion.n_own, np.uint8) if mask is None else mask
            for garment, mask in zip(self.garments, masks, strict=True)
        ]
        return np.concatenate([g.completion.spread(mask) for g, mask in zip(self.garments, full, strict=True)])


def in_frame(positions: NDArray[np.float32], matrix: NDArray[np.float64]) -> NDArray[np.float32]:
    """Positions (V, 3) moved by a matrix (4, 4), to the bit as they are where that does nothing."""
    return positions if np.allclose(matrix, np.eye(4), atol=1e-7) else transformed(positions, matrix)


def _diagonal(shape: Geometry, frame: NDArray[np.float64]) -> float:
    """Of the box around all vertices that a triangle uses, or around all if there is none."""
    used = np.zeros(len(shape.positions), bool)
    used[shape.triangles.reshape(-1)] = True
    positions = in_frame(shape.positions, frame)
    positions = positions if used.all() or not used.any() else positions[used]
    coordinates = np.ascontiguousarray(positions.T)  # NumPy is slow along the longer axis
    return float(np.linalg.norm(np.ptp(coordinates, axis=1)))
