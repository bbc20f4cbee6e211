"""Which garments go on which bodies: jobs from a manifest or a folder, shards of them, and what each depends on.

No Blender here: a scheduler reads a manifest with plain Python and leaves the work to others.
"""

import hashlib
import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

VERSION = 1
SUFFIXES = (".blend", ".glb", ".gltf", ".fbx")
_KEYS = {
    "manifest": {"version", "settings", "bodies", "garments"},
    "body": {"name", "file", "object"},
    "garment": {"name", "file", "objects", "bodies", "settings"},
}
_TEXT, _TEXTS = "a text", "a list of texts"
_KINDS = {"name": _TEXT, "file": _TEXT, "object": _TEXT, "objects": _TEXTS, "settings": "an object"}
# What no name of a file may have, on any system.
_UNFIT = re.compile(r"[\x00-\x1f/\\:\ud800-\udfff]")


class ManifestError(ValueError):
    """A manifest that cannot be read, as one sentence."""


@dataclass(frozen=True)
class Job:
    """One garment file on one body; `body_object` "" stands for the body file's only weighted mesh, no `objects` for
    all meshes of the garment file."""

    name: str
    body: Path
    garment: Path
    body_object: str = ""
    objects: tuple[str, ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)

    def inputs(self, version: str) -> str:
        """SHA-256 of all that the result depends on: both files' bytes, names, settings, the program's version."""
        named = [
            version,
            self.body_object,
            list(self.objects),
            self.settings,
            sha256(self.body),
            sha256(self.garment),
        ]
        return hashlib.sha256(json.dumps(named, sort_keys=True).encode()).hexdigest()


def read(path: Path) -> list[Job]:
    """The jobs of a manifest file, or of a folder with `bodies/` and `garments/`: every garment on every body.

    The order is that of the manifest, or of the names; it does not depend on the file system.
    """
    if path.is_dir():
        bodies = [{"file": str(file)} for file in _files(path / "bodies")]
        garments = [{"file": str(file)} for file in _files(path / "garments")]
        return _jobs({"bodies": bodies, "garments": garments}, path)
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        problem = "it is nested too deeply" if isinstance(error, RecursionError) else error
        raise ManifestError(f"{path} cannot be read as a manifest: {problem}") from error
    return _jobs(content, path.parent)


def shard(jobs: list[Job], index: int, count: int) -> list[Job]:
    """Part `index` (0 to count - 1) of `count` parts: disjoint, together all, the same everywhere.

    By the hash of a job's name, so that adding a garment moves no other job to another part.
    """
    if not 0 <= index < count:
        raise ManifestError(f"shard {index}/{count} does not exist: for 4 parts they are 0/4 to 3/4")
    return [job for job in jobs if int(hashlib.sha256(job.name.encode()).hexdigest(), 16) % count == index]


def _files(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise ManifestError(f"there is no folder {folder}: a wardrobe has bodies/ and garments/")
    found = sorted((file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES), key=lambda file: file.name)
    if not found:
        raise ManifestError(f"{folder} holds no file that ends in {', '.join(SUFFIXES)}")
    return found


def _jobs(content: Any, folder: Path) -> list[Job]:
    _check(content, "manifest", ("bodies", "garments"))
    if content.get("version", VERSION) != VERSION:
        raise ManifestError(f"the manifest has version {content['version']!r}; this Skinwright reads {VERSION}")
    for what in ("bodies", "garments"):
        if not isinstance(content[what], list):
            raise ManifestError(f"{what} of the manifest must be a list of objects")
    bodies = [(_name(body, "body"), body) for body in content["bodies"]]
    _check_different("bodies", [name for name, _ in bodies])
    jobs = []
    for garment in content["garments"]:
        jobs += _of_garment(garment, dict(bodies), content.get("settings", {}), folder)
    _check_different("jobs", [job.name for job in jobs])
    return jobs


def _of_garment(
    garment: dict[str, Any], bodies: dict[str, dict[str, Any]], settings: dict[str, Any], folder: Path
) -> list[Job]:
    own = _name(garment, "garment")
    chosen = garment.get("bodies", list(bodies))
    if not _is(_TEXTS, chosen) or not chosen:
        raise ManifestError(f"bodies of garment {own} must be a list of names: leave it out for all")
    jobs = []
    for name in dict.fromkeys(chosen):
        if name not in bodies:
            raise ManifestError(f"garment {own} names the body {name}, which is not among {', '.join(bodies)}")
        body = bodies[name]
        jobs.append(
            Job(
                f"{name}--{own}",
                (folder / body["file"]).resolve(),
                (folder / garment["file"]).resolve(),
                body.get("object", ""),
                tuple(dict.fromkeys(garment.get("objects", ()))),
                settings | garment.get("settings", {}),
            )
        )
    return jobs


def _name(part: Any, what: str) -> str:
    """What a body or a garment is called, which names files too."""
    _check(part, what, ("file",))
    name = part.get("name") or Path(part["file"]).stem
    if _UNFIT.search(name):
        raise ManifestError(f"{name!r} cannot be the name of a {what}, as files are called so: give it another name")
    return name


def _check_different(what: str, names: list[str]) -> None:
    """Also by more than the size of letters, which many file systems do not tell apart."""
    seen: set[str] = set()
    for name in names:
        if name.casefold() in seen:
            raise ManifestError(f"two {what} are called {name}: give the garments or bodies different names")
        seen.add(name.casefold())


def _check(content: Any, what: str, needed: tuple[str, ...]) -> None:
    if not isinstance(content, dict):
        raise ManifestError(f"a {what} must be a JSON object, not {json.dumps(content)[:60]}")
    for name in content.keys() - _KEYS[what]:
        raise ManifestError(f"a {what} has no {name}; it has {', '.join(sorted(_KEYS[what]))}")
    for name in needed:
        if not content.get(name):
            raise ManifestError(f"a {what} needs {name}")
    for name, kind in _KINDS.items():
        if name in content and not _is(kind, content[name]):
            raise ManifestError(f"{name} of a {what} must be {kind}, not {json.dumps(content[name])[:60]}")


def _is(kind: str, value: Any) -> bool:
    if kind == _TEXTS:
        return isinstance(value, list) and all(isinstance(one, str) for one in value)
    return isinstance(value, str if kind == _TEXT else dict)


def sha256(path: Path) -> str:
    """Of a file's bytes. Raises ManifestError."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ManifestError(f"{path} cannot be read: {error.strerror}") from error
