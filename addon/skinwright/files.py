"""Files that are written: whole or not at all, and never over what is not ours to replace."""

import json
import os
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .errors import Refused

REPORT = "skinwright report"
# What reports held before they were marked, by the keys that all of them have.
_UNMARKED = ({"version", "settings", "sentence"}, {"target", "faults", "poses"})


class FileError(Refused):
    """A file that is not written, and why."""


def check_output(path: Path, *, others: Iterable[Path] = (), overwrite: bool = False, replaces: str = "") -> None:
    """Raise FileError where writing `path` would lose something.

    `others` are inputs and other outputs of the same work. A file that is there already is replaced only if it is a
    report of ours and `replaces` is REPORT, if it is empty, or if `overwrite` says so.
    """
    for other in others:
        if _same(path, other):
            raise FileError(f"{path} is used twice in this command: give every output a name of its own")
    if path.is_dir():
        raise FileError(f"{path} is a folder: give the name of a file in it")
    if not path.parent.is_dir():
        raise FileError(f"{path} cannot be saved: there is no folder {path.parent}")
    if overwrite or not path.is_file() or path.stat().st_size == 0:
        return
    if not (replaces == REPORT and is_report(path)):
        kind = "and is not a report of Skinwright" if replaces == REPORT else "already"
        raise FileError(
            f"{path} exists {kind}: choose another name, or say --overwrite (in Blender, turn on Overwrite)"
        )


def is_report(path: Path) -> bool:
    """Whether a file is a report that this add-on has written."""
    try:
        with path.open("rb") as file:
            if file.read(1) not in (b"{", b"["):
                return False
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    first = content[0] if isinstance(content, list) and content else content
    if not isinstance(first, dict):
        return False
    return first.get("format") == REPORT or any(keys <= set(first) for keys in _UNMARKED)


def write_report(
    path: Path,
    content: dict[str, Any] | list[dict[str, Any]],
    *,
    others: Iterable[Path] = (),
    overwrite: bool = False,
) -> None:
    """Write `content`, or a list of such, as JSON. Raises FileError or OSError with the old file whole."""
    check_output(path, others=others, overwrite=overwrite, replaces=REPORT)
    entries = [{"format": REPORT} | entry for entry in (content if isinstance(content, list) else [content])]
    text = json.dumps(entries if isinstance(content, list) else entries[0], indent=2, allow_nan=False)
    write_whole(path, (text + "\n").encode())


def write_whole(path: Path, content: bytes) -> None:
    """Replace a file in one step: beside it first, then by its name. A pipe or a device is written directly."""
    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    path = path.resolve()  # a link stays one
    handle, name = tempfile.mkstemp(prefix=f".{path.name[:100]}.", suffix=".part", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask())
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _same(path: Path, other: Path) -> bool:
    """Whether both names lead to one file, also by links or letters of another size."""
    if path.exists() and other.exists():
        return path.samefile(other)
    return os.path.normcase(path.resolve()) == os.path.normcase(other.resolve())
