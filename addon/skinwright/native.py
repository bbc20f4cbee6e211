"""The only import of the native module, and the sentence the artist reads where it cannot be had."""

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

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

    def transfer(self, name: str, positions: NDArray, triangles: NDArray, **params: Any) -> tuple[Any, Rows]:
        """skinwright_native.Transfer and its rows, for the target `name`; keyword arguments as in the stub."""
        with _naming(name):
            transfer = self._source.transfer(positions, triangles, **params)
        weights = transfer.weights
        return transfer, Rows(weights.indptr, weights.bones, weights.values)


@contextmanager
def _naming(name: str) -> Iterator[None]:
    try:
        yield
    except _module.SkinwrightError as error:
        raise NativeError(f"{name}: {error}") from error
