"""Skinwright's numerics: skin-weight transfer, desparsification, sculpt-to-weights.

Arrays: positions (V, 3) float32 in one common space (world units), triangles (T, 3) uint32, weights CSR.
Angles are radians. An absolute length wins over its relative form when both are given. Every call frees the GIL.
"""

from typing import Any, Literal, TypedDict, Unpack, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

IslandPolicy = Literal["bridge", "nearest", "rigid", "skip"]
MatchMethod = Literal["paper", "confidence"]
SmallIslands = Literal["auto", "rigid", "solved"]

def version() -> str: ...
def set_memory_budget(bytes: int | None) -> None:
    """Bytes that one piece of work may take, None for whatever the machine has; what would take more is refused with a
    MemoryError that states the estimate."""

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
    def confidence(self) -> NDArray[np.float32]:
        """How far the row from the source was trusted, 0 to 1; `matched` are those at 0.5 or more."""

    @property
    def distance(self) -> NDArray[np.float32]: ...
    @property
    def angle(self) -> NDArray[np.float32]: ...
    @property
    def raw_minimum(self) -> float: ...
    @property
    def report(self) -> dict[str, Any]: ...

class TransferSettings(TypedDict, total=False):
    """The settings of a transfer; `transfer_weights` shows the defaults (Abdrashitov et al. 2023).

    `method`: "paper" copies the closest point's weights where distance and angle are within their thresholds and
    ignores them elsewhere; "confidence" takes the point nearest in position and direction and trusts it over
    `softness` times its gap: there the thresholds tell only which islands have a match at all, and the smoothness
    length how masked vertices are filled in.
    `max_distance`, or `relative_max_distance` times the target's bounding-box diagonal (or 30 % of the source's if
    that is larger): largest distance of a match; the report has the one in force.
    `max_normal_angle`: largest angle between the normals of a match; `match_flipped_normals`: opposite ones match too.
    `average_ties`: a vertex equally near to several places takes the mean of those whose normals agree best.
    `mask` (V,): 0 inpaint, 1 automatic, 2 force match. `relative_weld_tolerance` times the target's diagonal: vertices
    that close are one, and get one row; 0 for none. `smoothness_length`, or `relative_smoothness_length` times the
    source's diagonal: l of the energy S + l^2 S M^-1 S (paper section 3.2), 0 for the harmonic solution.
    `smoothing_iterations` Jacobi passes with `smoothing_factor`. `max_influences`: 0 for no limit.
    `island_policy`: what islands without any match get; rows that "skip" leaves are empty. `small_islands`: "rigid"
    gives each small, loose, nearly rigid island one row; "auto" does so with "confidence".
    """

    method: MatchMethod
    softness: float
    max_distance: float | None
    relative_max_distance: float
    max_normal_angle: float
    match_flipped_normals: bool
    average_ties: bool
    mask: ArrayLike | None
    relative_weld_tolerance: float
    smoothness_length: float | None
    relative_smoothness_length: float
    smoothing_iterations: int
    smoothing_factor: float
    max_influences: int
    island_policy: IslandPolicy
    small_islands: SmallIslands

@final
class Source:
    """A body prepared once (checks, BVH, normals) for any number of garments. `threads` 0: all of the machine's."""

    def __new__(cls, positions: ArrayLike, triangles: ArrayLike, weights: Weights, *, threads: int = 0) -> Source: ...
    def closest_points(
        self, positions: ArrayLike, *, threads: int = 0
    ) -> tuple[NDArray[np.uint32], NDArray[np.float64], NDArray[np.float64]]: ...
    def transfer(
        self,
        target_positions: ArrayLike,
        target_triangles: ArrayLike,
        *,
        target_edges: ArrayLike | None = None,
        threads: int = 0,
        **settings: Unpack[TransferSettings],
    ) -> Transfer: ...

@final
class Inpainting:
    """A body and a garment prepared for solving again and again: closest points are found once, a block of the
    system is factored again only when its own unknowns or the smoothness length change."""

    def __new__(
        cls,
        source: Source,
        target_positions: ArrayLike,
        target_triangles: ArrayLike,
        *,
        target_edges: ArrayLike | None = None,
        threads: int = 0,
        **settings: Unpack[TransferSettings],
    ) -> Inpainting: ...
    @property
    def distance(self) -> NDArray[np.float32]: ...
    @property
    def angle(self) -> NDArray[np.float32]: ...
    @property
    def islands(self) -> NDArray[np.uint32]: ...
    def set_source_weights(self, weights: Weights) -> None: ...
    def matched(self, **settings: Unpack[TransferSettings]) -> NDArray[np.bool_]: ...
    def confidence(self, **settings: Unpack[TransferSettings]) -> NDArray[np.float32]: ...
    def solve(self, **settings: Unpack[TransferSettings]) -> Transfer: ...
    def start(self, *, near: bool = False, **settings: Unpack[TransferSettings]) -> Job: ...
    def raw_weights(self, **settings: Unpack[TransferSettings]) -> tuple[NDArray[np.uint32], NDArray[np.float64]]: ...

@final
class Job:
    """Work going on on Rust's own threads; poll it from a timer."""

    @property
    def progress(self) -> float: ...
    @property
    def done(self) -> bool: ...
    def cancel(self) -> None: ...
    def wait(self, seconds: float) -> bool:
        """Waits at most so many seconds for the work's end; returns whether it has come."""

    def result(self) -> Any:
        """Waits for what the function that started the job returns, or raises its error. May be called again."""

def transfer_weights(
    source_positions: ArrayLike,
    source_triangles: ArrayLike,
    source_weights: Weights,
    target_positions: ArrayLike,
    target_triangles: ArrayLike,
    *,
    target_edges: ArrayLike | None = None,
    method: MatchMethod = "paper",
    softness: float = 0.7,
    max_distance: float | None = None,
    relative_max_distance: float = 0.05,
    max_normal_angle: float = 0.6108652381980153,
    match_flipped_normals: bool = True,
    average_ties: bool = False,
    mask: ArrayLike | None = None,
    relative_weld_tolerance: float = 1e-06,
    smoothness_length: float | None = None,
    relative_smoothness_length: float = 0.05,
    smoothing_iterations: int = 0,
    smoothing_factor: float = 0.2,
    max_influences: int = 0,
    island_policy: IslandPolicy = "bridge",
    small_islands: SmallIslands = "auto",
    threads: int = 0,
) -> Transfer: ...
def fill(
    positions: ArrayLike,
    triangles: ArrayLike,
    kinds: ArrayLike,
    rows: ArrayLike,
    *,
    confidence: ArrayLike | None = None,
    length: float = 0.0,
    weld: ArrayLike | None = None,
    threads: int = 0,
) -> NDArray[np.float64]:
    """Values at all vertices (V, C) from values at some: minimises, summed over the columns,
    w'(S + length^2 S M^-1 S)w plus b |w - s|^2 of every soft vertex. NaN where nothing known is connected to a vertex.

    `positions` (V, 3), `triangles` (T, 3); `kinds` (V,): 0 free, 1 fixed, 2 soft; `rows` (V, C): the known values;
    `confidence` (V,): b of soft vertices, mass included; `length`: world units, 0 for the harmonic solution;
    `weld` (V,): for each vertex one that it is one with, or itself: the system is solved on the welded mesh.
    """

Quality = Literal["live", "bake"]

@final
class Refiner:
    """A character prepared once (lattice, embedding, joints) for any number of poses, in any order.

    `rest_positions` (V, 3) and `bone_segments` (B, 2, 3), head and tail, are at rest in the mesh's own space;
    `bone_parents` (B,) is negative for a root. `cell` is the edge of a lattice cell in mesh units (None: 1.5 % of the
    bounding box's diagonal). Each constraint is switched off with 0 or False: `stretch` and `energy` are stiffnesses,
    `volume` from 0 to 1 (exact), `bind` the farthest that skin may come from its bone as a multiple of rest.
    """

    def __new__(
        cls,
        rest_positions: ArrayLike,
        triangles: ArrayLike,
        weights: Weights,
        bone_parents: ArrayLike,
        bone_segments: ArrayLike,
        *,
        cell: float | None = None,
        stretch: float = 1.0,
        volume: float = 1.0,
        bind: float = 1.08,
        energy: float = 0.1,
        self_collision: bool = True,
        threads: int = 0,
    ) -> Refiner: ...
    def solve(self, pose_from_rest: ArrayLike, *, quality: Quality = "live") -> NDArray[np.float32]:
        """Refined positions (V, 3) of a pose (B, 4, 4) in the mesh's own space; "live" takes fewer steps than
        "bake"."""

    def measure(self, pose_from_rest: ArrayLike, positions: ArrayLike) -> dict[str, Any]:
        """Figures of positions (V, 3) that anybody made in a pose: "pairs" that intersect, and for each joint that
        turns its "bone", "volume" against rest (-0.02: 2 % lost; None beside a trunk, as at shoulders) and "bulge" as a
        multiple of rest."""

    def report(self) -> dict[str, Any] | None:
        """Figures of the pose solved last, which is solved once more for them; None before the first."""

def intersecting_pairs(positions: ArrayLike, triangles: ArrayLike, *, threads: int = 0) -> NDArray[np.uint32]:
    """Pairs (P, 2) of triangles that pass through each other and share no vertex, ascending."""

def dual_quaternion_blend(
    rest_positions: ArrayLike,
    weights: Weights,
    pose_from_rest: ArrayLike,
    *,
    rest_bones: ArrayLike | None = None,
    threads: int = 0,
) -> NDArray[np.float32]:
    """Dual quaternion skinning exactly as Blender's Armature modifier does it with Preserve Volume: (V, 3).

    `rest_bones` (B, 4, 4), the bones' rest matrices, matter only where bones scale.
    """

def linear_blend(
    rest_positions: ArrayLike, weights: Weights, pose_from_rest: ArrayLike, *, threads: int = 0
) -> NDArray[np.float32]:
    """Linear blend skinning exactly as Blender's Armature modifier does it: posed positions (V, 3).

    `rest_positions` (V, 3) and `pose_from_rest` (B, 4, 4) row-major are in the mesh' own space; for Blender,
    pose_from_rest = object_world^-1 armature_world pose rest^-1 armature_world^-1 object_world. The sum of the matrices
    times the weights is divided by the weights' sum; a vertex whose weights sum to no more than 0.0001 stays.
    """

def penetration(
    body_positions: ArrayLike,
    body_triangles: ArrayLike,
    body_weights: Weights,
    positions: ArrayLike,
    weights: Weights,
    pose_from_rest: ArrayLike,
    *,
    threads: int = 0,
) -> NDArray[np.float32]:
    """Depths (P, n) of a garment's vertices (n) below the closest triangle of a body, 0 outside, in each of P poses.

    `body_positions` (V, 3) and `positions` (n, 3) are at rest, in world units; `body_triangles` (T, 3) wind so that
    their normals face outward. `pose_from_rest` (P * B, 4, 4) has the B bones' matrices, one pose after the other.
    """

def desparsify(
    weights: Weights,
    bone_parents: ArrayLike,
    *,
    n: int = 4,
    method: Literal["hop", "surface"] = "surface",
    positions: ArrayLike | None = None,
    triangles: ArrayLike | None = None,
    bone_segments: ArrayLike | None = None,
    locked: ArrayLike | None = None,
    threads: int = 0,
) -> Weights:
    """Gives every vertex exactly `n` members, so that sculpting has room: its locked ones, the largest of the others
    (scaled to fill what the locked ones leave of 1), and new ones at weight zero. Rows come back sorted by bone.

    `bone_parents` (B,) int, negative for a root; `locked` (B,) bool keep their weights and are given to no vertex (pass
    non-deforming bones as locked too). "surface" needs `positions` (V, 3), `triangles` (T, 3) and `bone_segments`
    (B, 2, 3), head and tail at rest in the mesh' space: the bones whose regions are nearest along mesh edges, ties by
    distance to the bone. "hop" takes the nearest in the hierarchy. A row is shorter only if there are no more bones to
    give, and longer only if more than `n` locked bones are on it.
    """

@final
class Stroke:
    """What a stroke did to the vertices it touched (n)."""

    @property
    def vertices(self) -> NDArray[np.uint32]:
        """(n,), as they were given."""

    @property
    def weights(self) -> Weights:
        """Their new rows, in that order."""

    @property
    def reachability(self) -> float:
        """1 - |residual after| / |residual before|: 1 if the sculpt was reached, 0 if weights could do nothing."""

    @property
    def residuals(self) -> NDArray[np.float32]:
        """(n, 3), from the new position to the target, in pose space."""

@final
class SculptSolver:
    """A character prepared for strokes: candidates, poses, and what each vertex was sculpted to in each of them.

    All positions and matrices are in the mesh' own space. The members of a vertex (zero weights too, 12 at most) are
    its candidates; strokes never add or drop one. `locked` (B,) bool bones keep their weights. `kappa` pulls towards
    the weights before a stroke, relative to the rest diagonal: 0.001 follows the sculpt, 0.05 hardly moves; `passes`
    of that pull, each starting from the last, take its bias away. Unweighted vertices stay unweighted.
    """

    def __new__(
        cls,
        rest_positions: ArrayLike,
        weights: Weights,
        *,
        locked: ArrayLike | None = None,
        kappa: float = 0.01,
        passes: int = 3,
        threads: int = 0,
    ) -> SculptSolver: ...
    def set_options(self, kappa: float, passes: int) -> None:
        """Says how the next strokes are solved."""

    def add_pose(self, pose_from_rest: ArrayLike, *, alpha: float = 1.0) -> int:
        """Registers a pose (B, 4, 4), row-major, whose sculpted positions weigh `alpha`, and makes it the pose that is
        sculpted in. Gives its number; a pose that is there already, up to rounding, keeps the one it has."""

    def guard(self, pose_from_rest: ArrayLike, *, alpha: float = 0.2) -> None:
        """Makes every vertex hold the position it now has in a pose (B, 4, 4). Guards add up; a stroke takes no longer
        for them. Rest needs no guard: no weights can change it."""

    def guard_range_of_motion(
        self, bone_parents: ArrayLike, bone_heads: ArrayLike, joints: ArrayLike, *, alpha: float = 0.2
    ) -> None:
        """Guards turns of the bones `joints` and all below them by +-45 and +-90 degrees about the three axes of the
        mesh' space, where animation is missing. `bone_parents` (B,), `bone_heads` (B, 3); a joint's turns share
        `alpha`."""

    def clear_guards(self) -> None: ...
    def posed(self, vertices: ArrayLike, rest_positions: ArrayLike, *, pose: int | None = None) -> NDArray[np.float32]:
        """Where `rest_positions` (n, 3), one for each of `vertices` (n,), lie in a pose under the present weights. For
        a brush that moves rest positions, these are the targets of its stroke. `pose`: None for the one added last."""

    def stroke(self, vertices: ArrayLike, targets: ArrayLike, *, pose: int | None = None) -> Stroke:
        """Takes `targets` (n, 3), the sculpted positions of `vertices` (n,) in a pose, into memory and solves for these
        vertices. A vertex' targets in other poses stay; an earlier one in this pose is replaced."""

    def undo(self) -> NDArray[np.uint32] | None:
        """Takes the last stroke back, weights and memory; the vertices it had touched, None if there is none. Then
        `weights(vertices)` are the rows to write."""

    def redo(self) -> NDArray[np.uint32] | None:
        """Does the stroke that was last taken back again; likewise."""

    @property
    def stroke_count(self) -> int:
        """Number of strokes that can be taken back."""

    def weights(self, vertices: ArrayLike | None = None) -> Weights:
        """The present weights of all vertices, or one row for each of `vertices`."""

    def reachability(self) -> float | None:
        """Of the last stroke that has not been taken back."""

    def residuals(self, *, pose: int | None = None) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
        """The vertices sculpted in a pose (n,), ascending, and from each to its target (n, 3), in pose space."""

    def rest_residuals(self, *, pose: int | None = None) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
        """The same in rest space, T^-1 r: the offsets of a corrective shape key driven by the pose."""

    def fit_rest_shape(
        self, vertices: ArrayLike, *, stiffness: float = 0.1, rounds: int = 20
    ) -> tuple[NDArray[np.float32], Weights]:
        """Offsets (n, 3) to the rest positions of `vertices` (n,) and weights, one row each, that together meet what
        was sculpted: sum_p alpha_p |T_p(w)(v + delta) - t_p|^2 + stiffness |delta|^2, by alternation. Nothing is
        changed. A vertex sculpted in fewer than two poses gets no offset; to hold a pose, make it a stroke with `posed`
        targets."""

def simplex_qp(h: ArrayLike, g: ArrayLike, start: ArrayLike, *, threads: int = 0) -> NDArray[np.float64]:
    """Minimises 1/2 w'Hw - g'w over w >= 0, sum w = sum of the start, for P problems of N <= 12 unknowns at once: the
    solver inside of a stroke. `h` (P, N, N) symmetric positive definite, `g` and `start` (P, N), starts feasible."""

def biharmonic_embedding(
    positions: ArrayLike, triangles: ArrayLike, *, n_pairs: int = 100, threads: int = 0
) -> NDArray[np.float64]:
    """Coordinates (V, n_pairs) in which the Euclidean distance is the biharmonic distance (Lipman et al. 2010,
    doi:10.1145/1805964.1805971), from the smallest non-zero eigenpairs of the cotangent Laplacian: phi_k / lambda_k.

    Each island has a spectrum of its own, so distances between islands mean nothing. Columns that an island is too
    small for are zero, and so are the rows of vertices without a triangle.
    """

@final
class Retarget:
    """Retargeted weights; every array has one entry per target vertex."""

    @property
    def weights(self) -> Weights:
        """Over the target's bones."""

    @property
    def confidence(self) -> NDArray[np.float32]:
        """(V,) how far the match is to be believed, 0 to 1."""

    @property
    def matched(self) -> NDArray[np.bool_]:
        """(V,) whether the vertex has the weights of its match; the others are filled from around them."""

    @property
    def points(self) -> NDArray[np.float32]:
        """(V, 3) where on the source each vertex belongs."""

    @property
    def report(self) -> dict[str, Any]: ...

def retarget_weights(
    source_positions: ArrayLike,
    source_triangles: ArrayLike,
    source_weights: Weights,
    source_frames: ArrayLike,
    source_lengths: ArrayLike,
    target_positions: ArrayLike,
    target_triangles: ArrayLike,
    target_frames: ArrayLike,
    target_lengths: ArrayLike,
    *,
    bone_map: ArrayLike,
    method: Literal["skeleton", "biharmonic"] = "skeleton",
    landmarks: ArrayLike | None = None,
    max_influences: int = 0,
    threads: int = 0,
    source_parents: ArrayLike | None = None,
    match_points: Literal["surface", "vertices"] = "surface",
    vertex_order: bool = True,
    registration: bool = True,
    normal_length: float = 0.02,
    max_distance: float = 0.08,
    max_normal_angle: float = 1.3962634015954636,
    max_stretch: float = 6.0,
    n_pairs: int = 100,
    smoothing_iterations: int = 0,
    smoothing_factor: float = 0.2,
) -> Retarget:
    """Weights of one character for another with a matching skeleton.

    Frames (B, 4, 4) are rest matrices with the bone along +Y, lengths (B,) in the same units; the two characters may
    stand, face and be scaled as they like. `bone_map` (B_target,) is the source's bone for each of the target's,
    negative for none. A weighted bone of the source without a partner gives its share to its nearest mapped ancestor,
    by `source_parents` (B_source,), or else to the nearest mapped bone; one with several partners divides it by their
    distance.

    "skeleton" brings the target into the source's pose and proportions bone by bone and matches by position and normal;
    "biharmonic" matches by biharmonic distances to `landmarks` (L, 2), a source and a target vertex each, to which the
    bones add theirs (`n_pairs` eigenpairs per island). `match_points`: any point of the source's surface, or vertices
    only. `vertex_order`: vertices of equal number, where both meshes have the same triangles at about the same places.
    `registration` draws the target onto the source by smooth displacements first, as far as its bones are long. Lengths
    are shares of the source's bounding-box diagonal: normals that differ by a unit count as `normal_length` apart;
    matches farther than `max_distance`, with normals more than `max_normal_angle` apart, or that stretch their
    surroundings more than `max_stretch` times are filled from around them.
    """

def start_retarget_weights(
    source_positions: ArrayLike,
    source_triangles: ArrayLike,
    source_weights: Weights,
    source_frames: ArrayLike,
    source_lengths: ArrayLike,
    target_positions: ArrayLike,
    target_triangles: ArrayLike,
    target_frames: ArrayLike,
    target_lengths: ArrayLike,
    *,
    bone_map: ArrayLike,
    method: Literal["skeleton", "biharmonic"] = "skeleton",
    landmarks: ArrayLike | None = None,
    max_influences: int = 0,
    threads: int = 0,
    source_parents: ArrayLike | None = None,
    match_points: Literal["surface", "vertices"] = "surface",
    vertex_order: bool = True,
    registration: bool = True,
    normal_length: float = 0.02,
    max_distance: float = 0.08,
    max_normal_angle: float = 1.3962634015954636,
    max_stretch: float = 6.0,
    n_pairs: int = 100,
    smoothing_iterations: int = 0,
    smoothing_factor: float = 0.2,
) -> Job:
    """Starts `retarget_weights` on threads of its own; `Job.result` returns a `Retarget`."""

@final
class AutoWeights:
    """Automatic weights: one row per vertex, none empty, each summing to 1."""

    @property
    def weights(self) -> Weights: ...
    @property
    def report(self) -> dict[str, Any]:
        """`vertices`, `distinct` (at different positions), `unweighted` (always 0), `bones_used`, `bones_outside`
        (bones no part of which is inside of the mesh), `most_influences`, `cells` and `cell_size` of the lattice,
        `residual`, `seconds` by stage."""

def automatic_weights(
    positions: ArrayLike,
    triangles: ArrayLike,
    bone_segments: ArrayLike,
    bone_parents: ArrayLike,
    *,
    method: Literal["heat", "geodesic", "euclidean"] = "heat",
    max_influences: int = 4,
    resolution: float = 128.0,
    stiffness: float = 5.0,
    threads: int = 0,
) -> AutoWeights:
    """Computes weights for the bones of an armature from scratch. Any mesh gets an answer at every vertex: open,
    overlapping, of many islands, split at seams (coincident vertices get equal rows).

    `positions` (V, 3) and `triangles` (T, 3) at rest, `bone_segments` (B, 2, 3) head and tail in the same space,
    `bone_parents` (B,) int, negative for a root. "heat" is the one to use; "geodesic" and "euclidean" are inverse
    distances to the nearest bones, through the inside of the mesh and straight. `max_influences` 0: no limit.
    `resolution`: cells along the mesh's diameter, through which distances are measured. `stiffness`: how closely heat
    keeps to its bone."""

def start_automatic_weights(
    positions: ArrayLike,
    triangles: ArrayLike,
    bone_segments: ArrayLike,
    bone_parents: ArrayLike,
    *,
    method: Literal["heat", "geodesic", "euclidean"] = "heat",
    max_influences: int = 4,
    resolution: float = 128.0,
    stiffness: float = 5.0,
    threads: int = 0,
) -> Job:
    """The same as a job, whose result is an `AutoWeights`."""

@final
class Embedding:
    """A skeleton embedded into a mesh, bone by bone."""

    @property
    def heads(self) -> NDArray[np.float32]:
        """(B, 3), in the mesh's space."""

    @property
    def tails(self) -> NDArray[np.float32]:
        """(B, 3), in the mesh's space."""

    @property
    def confidence(self) -> NDArray[np.float32]:
        """(B,): how far to trust each bone's head, 0 to 1."""

    @property
    def report(self) -> dict[str, Any]:
        """`places` the joints were chosen from, `main_joints` placed by themselves, `symmetric`, `outside` (bones
        whose heads are outside of the mesh), `penalty`, `seconds`."""

def embed_skeleton(
    positions: ArrayLike,
    triangles: ArrayLike,
    template_heads: ArrayLike,
    template_tails: ArrayLike,
    parents: ArrayLike,
    *,
    method: Literal["medial", "template"] = "medial",
    threads: int = 0,
    donor_positions: ArrayLike | None = None,
    donor_triangles: ArrayLike | None = None,
    donor_weights: Weights | None = None,
    mirror: ArrayLike | None = None,
    landmarks: ArrayLike | None = None,
) -> Embedding:
    """Puts the bones of a template into a mesh that has none.

    `positions` (V, 3) and `triangles` (T, 3); `template_heads` and `template_tails` (B, 3) and `parents` (B,) int,
    negative for a root: any armature whose up and front are those of the mesh, wherever it lies and however large it
    is. "medial" needs the shape of the mesh only. "template" needs the character that the bones were made for:
    `donor_positions` (D, 3), `donor_triangles`, and `donor_weights` over the bones. Its surface is drawn onto the mesh,
    and each joint goes where it lies relative to its own surface. `mirror` (B,): the bone on the other side, its own
    index in the middle, negative for none; without it nothing is made symmetric. `landmarks` (L, 2): a vertex of the
    donor and one of the mesh each.
    """

def start_embed_skeleton(
    positions: ArrayLike,
    triangles: ArrayLike,
    template_heads: ArrayLike,
    template_tails: ArrayLike,
    parents: ArrayLike,
    *,
    method: Literal["medial", "template"] = "medial",
    threads: int = 0,
    donor_positions: ArrayLike | None = None,
    donor_triangles: ArrayLike | None = None,
    donor_weights: Weights | None = None,
    mirror: ArrayLike | None = None,
    landmarks: ArrayLike | None = None,
) -> Job:
    """The same as a job, whose result is an `Embedding`."""
