"""The only import of the native module, and the sentence the artist reads where it cannot be had."""

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .csr import Rows

_module: Any = None
_import_error = ""
try:
    import skinwright_native

    _module = skinwright_native
except ImportError as error:
    _import_error = str(error)


class NativeError(ValueError):
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
    return tomllib.loads((Path(__file__).parent / "blender_manifest.toml").read_text())["version"]


class Source:
    """A body prepared once for any number of garments; `name` is what errors call it."""

    def __init__(self, name: str, positions: NDArray, triangles: NDArray, rows: Rows, n_bones: int) -> None:
        with _naming(name):
            self._source = _module.Source(positions, triangles, _module.Weights(*rows, n_bones))


class Inpainting:
    """A body and a target prepared for solving again and again; keyword arguments as in the stub."""

    def __init__(self, source: Source, name: str, positions: NDArray, triangles: NDArray, threads: int = 0) -> None:
        self.name = name
        with _naming(name):
            self._inpainting = _module.Inpainting(source._source, positions, triangles, threads=threads)
        self.distance: NDArray[np.float32] = self._inpainting.distance
        self.angle: NDArray[np.float32] = self._inpainting.angle
        self.islands: NDArray[np.uint32] = self._inpainting.islands

    def matched(self, **thresholds: Any) -> NDArray[np.bool_]:
        """(V,) which vertices match; waits for a job that is going on."""
        with _naming(self.name):
            return self._inpainting.matched(**thresholds)

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

    def result(self) -> tuple[Any, Rows]:
        """skinwright_native.Transfer and its rows; waits for them."""
        with _naming(self._name):
            transfer = self._job.result()
        weights = transfer.weights
        return transfer, Rows(weights.indptr, weights.bones, weights.values)


@contextmanager
def _naming(name: str) -> Iterator[None]:
    try:
        yield
    except _module.SkinwrightError as error:
        raise NativeError(f"{name}: {error}") from error
