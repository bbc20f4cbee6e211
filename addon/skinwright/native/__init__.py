"""The only import of the native module, and the sentence the artist reads where it cannot be had."""

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import memory
from ..csr import Rows
from ..errors import Refused

_module: Any = None
_import_error = ""
try:
    import skinwright_native

    _module = skinwright_native
except ImportError as error:
    _import_error = str(error)


class NativeError(Refused):
    """What the native module answers to inputs it has no answer for: one sentence."""


@cache
def problem() -> str:
    """Why the native module cannot be used, or nothing."""
    if _module is None:
        return (
            f"The native module of Skinwright cannot be loaded ({_import_error}): "
            "install the extension for this platform, then restart Blender"
        )
    # Blender keeps a loaded module until it restarts, also when the extension around it has been updated.
    if _module.version() != addon_version():
        return f"Skinwright {addon_version()} has met version {_module.version()} of its native module: restart Blender"
    return ""


@cache
def addon_version() -> str:
    """The version in the manifest."""
    return tomllib.loads((Path(__file__).parent.parent / "blender_manifest.toml").read_text(encoding="utf-8"))[
        "version"
    ]


def _set_budget() -> None:
    """Before each piece of work, as what is free changes."""
    _module.set_memory_budget(memory.budget())


class Source:
    """A body prepared once for any number of garments; `name` is what errors call it."""

    def __init__(self, name: str, positions: NDArray, triangles: NDArray, rows: Rows, n_bones: int) -> None:
        with _naming(name):
            self._source = _module.Source(positions, triangles, _module.Weights(*rows, n_bones))


class Inpainting:
    """A body and a target prepared for solving again and again; keyword arguments as in the stub."""

    def __init__(
        self,
        source: Source,
        name: str,
        positions: NDArray,
        triangles: NDArray,
        threads: int = 0,
        *,
        edges: NDArray | None = None,
        **settings: Any,
    ) -> None:
        self.name = name
        with _naming(name):
            self._inpainting = _module.Inpainting(
                source._source, positions, triangles, target_edges=edges, threads=threads, **settings
            )
        self.distance: NDArray[np.float32] = self._inpainting.distance
        self.angle: NDArray[np.float32] = self._inpainting.angle
        self.islands: NDArray[np.uint32] = self._inpainting.islands

    def set_source_weights(self, rows: Rows, n_columns: int) -> None:
        """Gives the source other weights; a solve with them factors nothing that is factored already."""
        with _naming(self.name):
            self._inpainting.set_source_weights(_module.Weights(*rows, n_columns))

    def matched(self, **thresholds: Any) -> NDArray[np.bool_]:
        """(V,) which vertices match; waits for a job that is going on."""
        with _naming(self.name):
            return self._inpainting.matched(**thresholds)

    def confidence(self, **thresholds: Any) -> NDArray[np.float32]:
        """(V,) how far each vertex's row from the source is trusted, 0 to 1; waits for a job that is going on."""
        with _naming(self.name):
            return self._inpainting.confidence(**thresholds)

    def start(self, **params: Any) -> "Job":
        """Solve on threads of Rust's own."""
        with _naming(self.name):
            return Job(self.name, self._inpainting.start(**params))


class Job:
    """A solve going on; `progress` runs from 0 to 1."""

    def __init__(self, name: str, job: Any) -> None:
        self._name, self._job = name, job

    @property
    def progress(self) -> float:
        """The share of the work that is done."""
        return self._job.progress

    @property
    def done(self) -> bool:
        """Whether `result` returns at once."""
        return self._job.done

    def cancel(self) -> None:
        """Ask the work to stop; `result` then raises NativeError."""
        self._job.cancel()

    def wait(self, seconds: float) -> None:
        """Return at the work's end, or after so many seconds."""
        self._job.wait(seconds)

    def result(self) -> tuple[Any, Rows]:
        """skinwright_native.Transfer and its rows; waits for them."""
        with _naming(self._name):
            transfer = self._job.result()
        return transfer, _rows(transfer.weights)


class EmbeddingJob(Job):
    """An embedding going on."""

    def result(self) -> Any:
        """skinwright_native.Embedding; waits for it."""
        with _naming(self._name):
            return self._job.result()


def start_embedding(
    name: str, mesh: tuple[NDArray, NDArray], bones: tuple[NDArray, NDArray, NDArray], donor: tuple, **options: Any
) -> EmbeddingJob:
    """A skeleton into a mesh, on threads of Rust's own; keyword arguments as in the stub.

    `mesh` is positions and triangles; `bones` are heads, tails, parents; `donor` is empty or positions, triangles and
    rows of the character that the bones were made for.
    """
    keywords = dict(options)
    with _naming(name):
        if donor:
            positions, triangles, rows = donor
            keywords |= {"donor_positions": positions, "donor_triangles": triangles}
            keywords["donor_weights"] = _module.Weights(*rows, len(bones[0]))
        return EmbeddingJob(name, _module.start_embed_skeleton(*mesh, *bones, **keywords))


def start_retarget(name: str, source: tuple, rows: Rows, target: tuple, **options: Any) -> Job:
    """Weights of one character for another, on threads of Rust's own; keyword arguments as in the stub.

    Characters are positions, triangles, frames and lengths; `rows` are the source's over its bones.
    """
    positions, triangles, frames, lengths = source
    with _naming(name):
        weights = _module.Weights(*rows, len(lengths))
        arrays = (positions, triangles, weights, frames, lengths, *target)
        return Job(name, _module.start_retarget_weights(*arrays, **options))


class Refiner:
    """A character prepared for refinement; keyword arguments as in the stub."""

    def __init__(
        self,
        name: str,
        positions: NDArray,
        triangles: NDArray,
        rows: Rows,
        n_bones: int,
        parents: NDArray,
        segments: NDArray,
        **options: Any,
    ) -> None:
        self.name = name
        with _naming(name):
            weights = _module.Weights(*rows, n_bones)
            self._refiner = _module.Refiner(positions, triangles, weights, parents, segments, **options)

    def solve(self, pose_from_rest: NDArray, quality: str = "live") -> NDArray[np.float32]:
        """(V, 3) of a pose (B, 4, 4)."""
        with _naming(self.name):
            return self._refiner.solve(pose_from_rest, quality=quality)

    def measure(self, pose_from_rest: NDArray, positions: NDArray) -> dict[str, Any]:
        """Pairs, and volume and bulge of each joint, for positions (V, 3) in a pose."""
        with _naming(self.name):
            return self._refiner.measure(pose_from_rest, positions)


def skin(positions: NDArray, rows: Rows, pose_from_rest: NDArray, rest_bones: NDArray | None) -> NDArray[np.float32]:
    """(V, 3) as the Armature modifier poses them: linearly, or with Preserve Volume if rest matrices are given."""
    with _naming("Posing"):
        weights = _module.Weights(*rows, len(pose_from_rest))
        if rest_bones is None:
            return _module.linear_blend(positions, weights, pose_from_rest)
        return _module.dual_quaternion_blend(positions, weights, pose_from_rest, rest_bones=rest_bones)


def closest(
    name: str, positions: NDArray, triangles: NDArray, rows: Rows, n_bones: int, queries: NDArray
) -> tuple[NDArray[np.uint32], NDArray[np.float64], NDArray[np.float64]]:
    """Triangle (n,), barycentric shares (n, 3) and distance (n,) of the surface point nearest to each query."""
    with _naming(name):
        source = _module.Source(positions, triangles, _module.Weights(*rows, n_bones))
        return source.closest_points(queries)


def desparsify(name: str, rows: Rows, n_bones: int, parents: NDArray, **options: Any) -> Rows:
    """Rows with exactly n members each, where there are bones to give; keyword arguments as in the stub."""
    with _naming(name):
        return _rows(_module.desparsify(_module.Weights(*rows, n_bones), parents, **options))


def start_automatic_weights(
    name: str, positions: NDArray, triangles: NDArray, segments: NDArray, parents: NDArray, **options: Any
) -> Job:
    """Compute automatic weights on threads of Rust's own; keyword arguments as in the stub."""
    with _naming(name):
        return Job(name, _module.start_automatic_weights(positions, triangles, segments, parents, **options))


def linear_blend(name: str, rest: NDArray, rows: Rows, pose_from_rest: NDArray) -> NDArray[np.float32]:
    """(V, 3) where linear blend skinning takes rest positions (V, 3) by matrices (B, 4, 4), all in one space."""
    with _naming(name):
        return _module.linear_blend(rest, _module.Weights(*rows, len(pose_from_rest)), pose_from_rest)


def penetration(
    name: str,
    body: tuple[NDArray, NDArray, Rows],
    garment: tuple[NDArray, Rows],
    poses: NDArray,
) -> NDArray[np.float32]:
    """(P, n) depths of a garment's vertices inside a body in poses (P, B, 4, 4); arguments as in the stub."""
    n_bones = poses.shape[1]
    (positions, triangles, rows), (points, point_rows) = body, garment
    with _naming(name):
        return _module.penetration(
            positions,
            triangles,
            _module.Weights(*rows, n_bones),
            points,
            _module.Weights(*point_rows, n_bones),
            poses.reshape(-1, 4, 4),
        )


class SculptSolver:
    """A character prepared for strokes, with its poses, targets and undo; keyword arguments as in the stub."""

    def __init__(self, name: str, rest_positions: NDArray, rows: Rows, n_bones: int, **options: Any) -> None:
        self.name = name
        with _naming(name):
            self._solver = _module.SculptSolver(rest_positions, _module.Weights(*rows, n_bones), **options)

    def set_options(self, kappa: float, passes: int) -> None:
        """Says how the next strokes are solved."""
        with _naming(self.name):
            self._solver.set_options(kappa, passes)

    def add_pose(self, pose_from_rest: NDArray) -> int:
        """Makes (B, 4, 4) the pose that is sculpted in; gives its number, the old one if it is known."""
        with _naming(self.name):
            return self._solver.add_pose(pose_from_rest)

    def guard(self, pose_from_rest: NDArray, alpha: float) -> None:
        """Makes every vertex hold the position it now has in a pose (B, 4, 4)."""
        with _naming(self.name):
            self._solver.guard(pose_from_rest, alpha=alpha)

    def guard_range_of_motion(self, parents: NDArray, heads: NDArray, joints: NDArray, alpha: float) -> None:
        """Guards turns of the bones `joints` (n,)."""
        with _naming(self.name):
            self._solver.guard_range_of_motion(parents, heads, joints, alpha=alpha)

    def posed(self, vertices: NDArray, rest_positions: NDArray) -> NDArray[np.float32]:
        """(n, 3) where the rest positions (n, 3) of vertices (n,) lie in the pose added last."""
        with _naming(self.name):
            return self._solver.posed(vertices, rest_positions)

    def stroke(self, vertices: NDArray, targets: NDArray) -> tuple[Rows, float, NDArray[np.float32]]:
        """New rows of the vertices (n,), reachability, and what is left to their targets (n, 3)."""
        with _naming(self.name):
            stroke = self._solver.stroke(vertices, targets)
        return _rows(stroke.weights), stroke.reachability, stroke.residuals

    def undo(self) -> NDArray[np.uint32] | None:
        """Takes the last stroke back; the vertices it had touched."""
        with _naming(self.name):
            return self._solver.undo()

    def redo(self) -> NDArray[np.uint32] | None:
        """Does it again; likewise."""
        with _naming(self.name):
            return self._solver.redo()

    def rows(self, vertices: NDArray | None = None) -> Rows:
        """The present rows of these vertices, or of all."""
        with _naming(self.name):
            return _rows(self._solver.weights(vertices))

    @property
    def stroke_count(self) -> int:
        """Number of strokes that can be taken back."""
        return self._solver.stroke_count

    @property
    def reachability(self) -> float | None:
        """Of the last stroke that has not been taken back."""
        return self._solver.reachability()

    def rest_residuals(self, pose: int) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
        """The vertices (n,) sculpted in a pose, and the offsets (n, 3) at rest that weights cannot stand in for."""
        with _naming(self.name):
            return self._solver.rest_residuals(pose=pose)


def _rows(weights: Any) -> Rows:
    return Rows(weights.indptr, weights.bones, weights.values)


@contextmanager
def _naming(name: str) -> Iterator[None]:
    """What the module raises, a panic of Rust included, as one class whose sentence names the object."""
    _set_budget()
    try:
        yield
    except (_module.SkinwrightError, MemoryError, OverflowError, RuntimeError) as error:
        raise NativeError(f"{name}: {error}") from error
    except BaseException as error:
        if type(error).__name__ != "PanicException":
            raise
        raise NativeError(f"{name}: internal error in Skinwright, please report it: {error}") from error
