"""States kept on a mesh: an index as JSON, and the bytes each entry names. Equal bytes are kept once."""

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import get_type_hints

import bpy
import numpy as np

from ..errors import Refused
from ..scene import kept_bytes, mesh, weight_state
from . import record
from .record import Record

# Of the states that are kept by themselves.
MOST_AUTOMATIC = 5
_INDEX, _BLOB = "weights_index", "weights_blob_"


class StoredError(Refused):
    """A state that is not there, or cannot be read."""


@dataclass(frozen=True)
class Entry:
    """A kept state; `weights` and `shape` name its bytes, `time` is in seconds since 1970."""

    name: str
    automatic: bool
    time: float
    vertices: int
    members: int
    weights: str
    shape: str


def entries(obj: bpy.types.Object) -> list[Entry]:
    """Those of an object, oldest first. An index that cannot be read counts as none; what a later version has added
    to an entry does not hinder."""
    kinds = get_type_hints(Entry)
    try:
        found = [{name: entry[name] for name in kinds} for entry in json.loads(kept_bytes.read(obj.data, _INDEX))]
    except (ValueError, TypeError, KeyError, RecursionError):
        return []
    return [Entry(**entry) for entry in found if all(isinstance(entry[name], kinds[name]) for name in kinds)]


def take(obj: bpy.types.Object) -> Record:
    """The present weights and rest shape of an object; not in Edit mode."""
    state = weight_state.capture(obj)
    return Record(
        object=obj.name,
        names=state.names,
        locked=state.locked,
        active=state.active,
        indptr=state.indptr,
        groups=state.groups,
        values=state.values,
        positions=mesh.rest_positions(obj.data),
        triangles=mesh.triangles(obj) if obj.data.polygons else np.zeros((0, 3), np.uint32),
    )


def keep(obj: bpy.types.Object, name: str, *, automatic: bool = False, state: Record | None = None) -> Entry:
    """Keep the present weights, or `state`, under a name; one of that name is replaced unless both are automatic."""
    kept = state or take(obj)
    weights = record.pack(kept.header(), {key: getattr(kept, key) for key in ("indptr", "groups", "values")})
    shape = _shape_bytes(obj, kept)
    entry = Entry(name, automatic, time.time(), len(kept.positions), len(kept.values), _put(obj, weights), shape)
    others = [old for old in entries(obj) if automatic or old.automatic or old.name != name]
    _set_entries(obj, _with_few_automatic([*others, entry]))
    return entry


def keep_before(objects: Sequence[bpy.types.Object], operation: str) -> None:
    """The state made by itself before an operation writes; the last few are kept. No weights are nothing to keep."""
    for obj in {obj.data: obj for obj in objects}.values():
        if obj.vertex_groups:
            keep(obj, f"Before {operation}", automatic=True)


def load(obj: bpy.types.Object, number: int = -1, name: str = "") -> Record:
    """The kept state of this number or of this name, the newest of it. Raises StoredError."""
    found = entries(obj)
    if name:
        found = [entry for entry in found if entry.name == name]
    if not found or not -len(found) <= number < len(found):
        which = f"named {name}" if name else "of this number"
        raise StoredError(f"{obj.name} has no stored weights {which}: store some first")
    entry = found[number]
    try:
        header, arrays = record.unpack(kept_bytes.read(obj.data, _BLOB + entry.weights))
        arrays |= record.unpack(kept_bytes.read(obj.data, _BLOB + entry.shape))[1]
        return record.build(header, arrays)
    except record.RecordError as error:
        raise StoredError(f"The weights {entry.name} of {obj.name} are damaged: {error}") from error


def remove(obj: bpy.types.Object, number: int) -> None:
    """Forget one state."""
    found = entries(obj)
    if not -len(found) <= number < len(found):
        raise StoredError(f"{obj.name} has no stored weights of this number")
    del found[number]
    _set_entries(obj, found)


def purge(obj: bpy.types.Object, *, automatic_only: bool = False) -> int:
    """Forget all states, or those kept by themselves; returns how many bytes that frees."""
    before = size(obj)
    _set_entries(obj, [entry for entry in entries(obj) if automatic_only and not entry.automatic])
    return before - size(obj)


def size(obj: bpy.types.Object) -> int:
    """Bytes that all states of an object take in the file."""
    names = [*kept_bytes.names(obj.data, _BLOB), _INDEX]
    return sum(len(kept_bytes.read(obj.data, name)) for name in names)


def _shape_bytes(obj: bpy.types.Object, kept: Record) -> str:
    """The shape seldom changes: it is compressed only if it is new."""
    arrays = {"positions": kept.positions, "triangles": kept.triangles}
    found = hashlib.sha256()
    for array in arrays.values():
        found.update(np.ascontiguousarray(array).tobytes())
    key = found.hexdigest()[:24]
    if not kept_bytes.read(obj.data, _BLOB + key):
        kept_bytes.write(obj.data, _BLOB + key, record.pack({}, arrays))
    return key


def _put(obj: bpy.types.Object, content: bytes) -> str:
    key = hashlib.sha256(content).hexdigest()[:24]
    kept_bytes.write(obj.data, _BLOB + key, content)
    return key


def _with_few_automatic(found: list[Entry]) -> list[Entry]:
    automatic = [entry for entry in found if entry.automatic]
    gone = automatic[:-MOST_AUTOMATIC]
    return [entry for entry in found if entry not in gone]


def _set_entries(obj: bpy.types.Object, found: list[Entry]) -> None:
    """Write the index and drop the bytes that nobody names."""
    text = json.dumps([asdict(entry) for entry in found]).encode() if found else b""
    kept_bytes.write(obj.data, _INDEX, text)
    used = {key for entry in found for key in (entry.weights, entry.shape)}
    for name in kept_bytes.names(obj.data, _BLOB):
        if name.removeprefix(_BLOB) not in used:
            kept_bytes.write(obj.data, name, b"")
