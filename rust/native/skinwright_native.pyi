"""Skinwright's numerics: skin-weight transfer, desparsification, sculpt-to-weights.

Arrays: positions (V, 3) float32 in one common space (world units), triangles (T, 3) uint32, weights CSR.
Angles are radians. An absolute length wins over its relative form when both are given. Every call frees the GIL.
"""

from typing import Any, Literal, TypedDict, Unpack, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

IslandPolicy = Literal["bridge", "nearest", "rigid", "skip"]

def version() -> str: ...

class SkinwrightError(ValueError): ...
class NothingMatched(SkinwrightError): ...
class InvalidMesh(SkinwrightError): ...
class InvalidWeights(SkinwrightError): ...
class InvalidParameter(SkinwrightError): ...
class NotSolvable(SkinwrightError): ...
class Cancelled(SkinwrightError): ...

@final
class Weights:
    """Skin weights as CSR: row i of `indptr` (V+1) spans the influences of vertex i in `bones` and `values` (nnz)."""

    def __new__(cls, indptr: ArrayLike, bones: ArrayLike, values: ArrayLike, n_bones: int) -> Weights: ...
    @property
    def indptr(self) -> NDArray[np.uint32]: ...
    @property
    def bones(self) -> NDArray[np.uint32]: ...
    @property
    def values(self) -> NDArray[np.float32]: ...
    @property
    def n_bones(self) -> int: ...
    def to_dense(self) -> NDArray[np.float32]: ...
    @staticmethod
    def from_dense(array: ArrayLike) -> Weights: ...
    def __len__(self) -> int: ...

@final
class Transfer:
    """What a transfer gives back; every array has one entry a target vertex."""

    @property
    def weights(self) -> Weights: ...
    @property
    def matched(self) -> NDArray[np.bool_]: ...
    @property
    def distance(self) -> NDArray[np.float32]: ...
    @property
    def angle(self) -> NDArray[np.float32]: ...
    @property
    def raw_minimum(self) -> float: ...
    @property
    def report(self) -> dict[str, Any]: ...

class TransferSettings(TypedDict, total=False):
    """The settings of a transfer; `transfer_weights` shows the defaults (spec-transfer, sections 1 to 3).

    `max_distance`, or `relative_max_distance` times the target's bounding-box diagonal: largest distance of a match.
    `max_normal_angle`: largest angle between the normals of a match; `match_flipped_normals`: opposite ones match too.
    `mask` (V,): 0 inpaint, 1 automatic, 2 force match. `smoothness_length`, or `relative_smoothness_length` times the
    source's diagonal: l of the energy S + l^2 S M^-1 S (paper section 3.2), 0 for the harmonic solution.
    `smoothing_iterations` Jacobi passes with `smoothing_factor`. `max_influences`: 0 for no limit.
    `island_policy`: what islands without any match get; rows that "skip" leaves are empty.
    """

    max_distance: float | None
    relative_max_distance: float
    max_normal_angle: float
    match_flipped_normals: bool
    mask: ArrayLike | None
    smoothness_length: float | None
    relative_smoothness_length: float
    smoothing_iterations: int
    smoothing_factor: float
    max_influences: int
    island_policy: IslandPolicy

@final
class Source:
    """A body prepared once (checks, BVH, normals) for any number of garments. `threads` 0: all of the machine's."""

    def __new__(cls, positions: ArrayLike, triangles: ArrayLike, weights: Weights, *, threads: int = 0) -> Source: ...
    def transfer(
        self,
        target_positions: ArrayLike,
        target_triangles: ArrayLike,
        *,
        threads: int = 0,
        **settings: Unpack[TransferSettings],
    ) -> Transfer: ...

@final
class Inpainting:
    """A body and a garment prepared for solving again and again: closest points are found once, a block of the
    system is factored again only when its own unknowns or the smoothness length change."""

    def __new__(
        cls, source: Source, target_positions: ArrayLike, target_triangles: ArrayLike, *, threads: int = 0
    ) -> Inpainting: ...
    @property
    def distance(self) -> NDArray[np.float32]: ...
    @property
    def angle(self) -> NDArray[np.float32]: ...
    @property
    def islands(self) -> NDArray[np.uint32]: ...
    def set_source_weights(self, weights: Weights) -> None: ...
    def matched(self, **settings: Unpack[TransferSettings]) -> NDArray[np.bool_]: ...
    def solve(self, **settings: Unpack[TransferSettings]) -> Transfer: ...
    def start(self, **settings: Unpack[TransferSettings]) -> Job: ...
    def raw_weights(self, **settings: Unpack[TransferSettings]) -> tuple[NDArray[np.uint32], NDArray[np.float64]]: ...

@final
class Job:
    """Work going on on Rust's own threads; poll it from a timer."""

    @property
    def progress(self) -> float: ...
    @property
    def done(self) -> bool: ...
    def cancel(self) -> None: ...
    def result(self) -> Transfer: ...

def transfer_weights(
    source_positions: ArrayLike,
    source_triangles: ArrayLike,
    source_weights: Weights,
    target_positions: ArrayLike,
    target_triangles: ArrayLike,
    *,
    max_distance: float | None = None,
    relative_max_distance: float = 0.05,
    max_normal_angle: float = 0.6108652381980153,
    match_flipped_normals: bool = True,
    mask: ArrayLike | None = None,
    smoothness_length: float | None = None,
    relative_smoothness_length: float = 0.05,
    smoothing_iterations: int = 0,
    smoothing_factor: float = 0.2,
    max_influences: int = 0,
    island_policy: IslandPolicy = "bridge",
    threads: int = 0,
) -> Transfer: ...
