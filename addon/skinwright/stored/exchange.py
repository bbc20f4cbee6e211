"""Kept states in files of their own, .npz or .json by the ending."""

from collections.abc import Iterable
from pathlib import Path

from .. import files
from . import record
from .record import Record

ENDINGS = (".npz", ".json")


def write(path: Path, kept: Record, *, overwrite: bool = False, others: Iterable[Path] = ()) -> None:
    """Write a record whole. Raises FileError or OSError."""
    ending = _ending(path)
    files.check_output(path, others=others, overwrite=overwrite)
    try:
        record.check(kept)
    except record.RecordError as error:
        raise record.RecordError(f"{kept.object}: {error}") from error
    content = record.to_npz(kept) if ending == ".npz" else record.to_json(kept).encode()
    files.write_whole(path, content)


def read(path: Path) -> Record:
    """Read a record. Raises RecordError, FileError or OSError."""
    ending = _ending(path)
    try:
        kept = record.from_npz(path.read_bytes()) if ending == ".npz" else record.from_json(_text(path))
        record.check(kept)
        return kept
    except record.RecordError as error:
        raise record.RecordError(f"{path}: {error}") from error


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise record.RecordError(f"it is not a text ({error})") from error


def _ending(path: Path) -> str:
    if path.suffix.lower() not in ENDINGS:
        raise files.FileError(f"{path} ends in neither {' nor '.join(ENDINGS)}: choose one of these endings")
    return path.suffix.lower()
