"""Skinwright's numerics: skin-weight transfer, desparsification, sculpt-to-weights.

Arrays: positions (V, 3) float32 in one common space (world units), triangles (T, 3) uint32, weights CSR.
Angles are radians. An absolute length wins over its relative form when both are given. Every call frees the GIL.
"""

from typing import Any, Literal, final

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

@final
class Source:
    """A body prepared once (checks, BVH, normals) for any number of garments."""

    def __new__(cls, positions: ArrayLike, triangles: ArrayLike, weights: Weights) -> Source: ...
    def transfer(
        self,
        target_positions: ArrayLike,
        target_triangles: ArrayLike,
        *,
        max_distance: float | None = None,
        relative_max_distance: float = 0.05,
        max_normal_angle: float = ...,
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
    def matched(
        self,
        *,
        max_distance: float | None = None,
        relative_max_distance: float = 0.05,
        max_normal_angle: float = ...,
        match_flipped_normals: bool = True,
        mask: ArrayLike | None = None,
    ) -> NDArray[np.bool_]: ...
    def solve(
        self,
        *,
        max_distance: float | None = None,
        relative_max_distance: float = 0.05,
        max_normal_angle: float = ...,
        match_flipped_normals: bool = True,
        mask: ArrayLike | None = None,
        smoothness_length: float | None = None,
        relative_smoothness_length: float = 0.05,
        smoothing_iterations: int = 0,
        smoothing_factor: float = 0.2,
        max_influences: int = 0,
        island_policy: IslandPolicy = "bridge",
    ) -> Transfer: ...
    def start(
        self,
        *,
        max_distance: float | None = None,
        relative_max_distance: float = 0.05,
        max_normal_angle: float = ...,
        match_flipped_normals: bool = True,
        mask: ArrayLike | None = None,
        smoothness_length: float | None = None,
        relative_smoothness_length: float = 0.05,
        smoothing_iterations: int = 0,
        smoothing_factor: float = 0.2,
        max_influences: int = 0,
        island_policy: IslandPolicy = "bridge",
    ) -> Job: ...

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
    max_normal_angle: float = ...,
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
