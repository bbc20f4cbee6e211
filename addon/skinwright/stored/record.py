"""One state of an object's weights with the shape it belongs to, as .npz or as JSON; numpy only, readable anywhere.

docs/pages/stored.md describes both files. Neither holds pickled objects.
"""

import io
import json
import zipfile
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import Refused
from ..soundness import SUM_TOLERANCE

FORMAT, VERSION = "skinwright weights", 1
# Of each array: type and number of dimensions.
ARRAYS = {
    "indptr": (np.uint32, 1),
    "groups": (np.uint32, 1),
    "values": (np.float32, 1),
    "positions": (np.float32, 2),
    "triangles": (np.uint32, 2),
}
# Floats hardly shrink, however long one tries.
_COMPRESSION = 1


class RecordError(Refused):
    """A file that holds no weights, and why."""


@dataclass(frozen=True)
class Record:
    """Vertex i has entries indptr[i] to indptr[i + 1]: `groups` index `names`, in the order Blender stores them.

    `positions` (V, 3) at rest in the object's own space, `triangles` (T, 3).
    """

    object: str
    names: list[str]
    locked: list[bool]
    active: str
    indptr: NDArray[np.uint32]
    groups: NDArray[np.uint32]
    values: NDArray[np.float32]
    positions: NDArray[np.float32]
    triangles: NDArray[np.uint32]

    def header(self) -> dict[str, Any]:
        """What is no array."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "object": self.object,
            "names": self.names,
            "locked": self.locked,
            "active": self.active,
        }


def to_npz(record: Record) -> bytes:
    """The .npz file."""
    return pack(record.header(), {name: getattr(record, name) for name in ARRAYS})


def from_npz(content: bytes) -> Record:
    """The inverse. Raises RecordError."""
    header, arrays = unpack(content)
    return build(header, arrays)


def pack(header: dict[str, Any], arrays: dict[str, NDArray]) -> bytes:
    """Header and arrays as one .npz."""
    text = np.frombuffer(json.dumps(header).encode(), np.uint8)
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=_COMPRESSION) as archive:
        for name, array in {"header": text, **arrays}.items():
            entry = io.BytesIO()
            np.lib.format.write_array(entry, np.ascontiguousarray(array), allow_pickle=False)
            # A time of its own would make equal states differ.
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), entry.getvalue(), zipfile.ZIP_DEFLATED, _COMPRESSION)
    return file.getvalue()


def unpack(content: bytes) -> tuple[dict[str, Any], dict[str, NDArray]]:
    """The inverse of pack. Raises RecordError for what is no such file."""
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        header = json.loads(arrays.pop("header").tobytes())
    except Exception as error:  # numpy, zipfile, zlib and json each have their own
        raise RecordError(f"it cannot be read as weights of Skinwright ({error})") from error
    return header, arrays


def to_json(record: Record) -> str:
    """The JSON file: each vertex' members as [group, weight] pairs, weights as decimals that give the same bits."""
    decimals = [float(str(value)) for value in record.values]
    pairs = list(zip(record.groups.tolist(), decimals, strict=True))
    ends = record.indptr.tolist()
    content = record.header() | {
        "vertices": [pairs[start:end] for start, end in zip(ends[:-1], ends[1:], strict=True)],
        "positions": [[float(str(x)) for x in row] for row in record.positions],
        "triangles": record.triangles.tolist(),
    }
    return json.dumps(content)


def from_json(text: str) -> Record:
    """The inverse. Raises RecordError."""
    try:
        content = json.loads(text)
        vertices = content["vertices"]
        counts = [len(members) for members in vertices]
        arrays = {
            "indptr": np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]),
            "groups": _numbers([group for members in vertices for group, _ in members], np.uint32),
            "values": _numbers([weight for members in vertices for _, weight in members], np.float32),
            "positions": _numbers(content["positions"], np.float32, columns=3),
            "triangles": _numbers(content["triangles"], np.uint32, columns=3),
        }
    except Exception as error:
        raise RecordError(f"it cannot be read as weights of Skinwright ({error})") from error
    return build(content, arrays)


def _numbers(values: list, kind: type, columns: int = 0) -> NDArray:
    """An array of the type that the values have, which is looked at later: none is rounded or read from a text."""
    if values:
        found = np.array(values)
        return found.astype(kind) if kind is np.float32 and found.dtype.kind in "iu" else found
    return np.zeros((0, columns) if columns else 0, kind)


def check(record: Record) -> None:
    """Raise RecordError for what no file may hold: weights or coordinates that are none."""
    with np.errstate(invalid="ignore"):
        good = (record.values >= 0) & (record.values <= 1 + SUM_TOLERANCE)  # not a number is neither
    if not good.all():
        entry = int(np.flatnonzero(~good)[0])
        vertex = int(np.searchsorted(record.indptr, entry, side="right")) - 1
        name = record.names[record.groups[entry]]
        raise RecordError(
            f"the weight of vertex {vertex} in group {name} is {record.values[entry]}, but must be a number from 0 to "
            "1: assign it again"
        )
    bad = np.flatnonzero(~np.isfinite(record.positions).all(axis=1))
    if bad.size:
        raise RecordError(f"vertex {bad[0]} has a coordinate that is not a number: move or delete it")


def build(header: Any, arrays: dict[str, NDArray]) -> Record:
    """A record that fits together. Raises RecordError."""
    problem = _problem_of_header(header) or _problem_of_arrays(header, arrays)
    if problem:
        raise RecordError(problem)
    with np.errstate(over="ignore"):  # what is too large is looked for in files
        typed: dict[str, Any] = {name: np.ascontiguousarray(arrays[name], kind) for name, (kind, _) in ARRAYS.items()}
    return Record(header["object"], header["names"], header["locked"], header["active"], **typed)


def _problem_of_header(header: Any) -> str:
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        return "it holds no weights of Skinwright"
    version = header.get("version")
    if not isinstance(version, int) or not 1 <= version <= VERSION:
        return f"its version is {version!r}, and this Skinwright reads up to {VERSION}: update the extension"
    names, locked = header.get("names"), header.get("locked")
    if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names):
        return "its names are no list of texts"
    if len(set(names)) != len(names):
        return "it names a group twice"
    if not isinstance(locked, list) or len(locked) != len(names) or not all(isinstance(x, bool) for x in locked):
        return "its locks do not fit its names"
    texts = isinstance(header.get("object"), str) and isinstance(header.get("active"), str)
    return "" if texts else "it does not say of which object it is"


def _problem_of_arrays(header: dict[str, Any], arrays: dict[str, NDArray]) -> str:
    for name, (kind, dimensions) in ARRAYS.items():
        array = arrays.get(name)
        if array is None or array.ndim != dimensions or array.dtype.kind not in ("f" if kind is np.float32 else "iu"):
            return f"its array `{name}` is missing or of another type"
    indptr, groups = (arrays[name].astype(np.int64) for name in ("indptr", "groups"))
    positions, triangles = arrays["positions"], arrays["triangles"]
    n = len(positions)
    if positions.shape[1] != 3 or triangles.shape[1] != 3 or len(indptr) != n + 1:
        return "the lengths of its arrays do not fit"
    if (
        indptr[0] != 0
        or (np.diff(indptr) < 0).any()
        or indptr[-1] != len(groups)
        or len(groups) != len(arrays["values"])
    ):
        return "its rows do not fit its entries"
    if groups.size and not (groups.min() >= 0 and groups.max() < len(header["names"])):
        return "a member is in a group that it does not name"
    if len(np.unique(np.repeat(np.arange(n, dtype=np.int64), np.diff(indptr)) << 32 | groups)) != len(groups):
        return "a vertex is in a group twice"
    if triangles.size and not (triangles.min() >= 0 and triangles.max() < n):
        return "a triangle names a vertex that is not there"
    return ""
