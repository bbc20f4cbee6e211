"""Which garments go on which bodies: jobs from a manifest or a folder, shards of them, and what each depends on.

No Blender here: a scheduler reads a manifest with plain Python and leaves the work to others.
"""

import hashlib
import json
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
            _sha256(self.body),
            _sha256(self.garment),
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
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ManifestError(f"{path} cannot be read as a manifest: {error}") from error
    return _jobs(content, path.parent)


def shard(jobs: list[Job], index: int, count: int) -> list[Job]:
    """Part `index` (0 to count - 1) of `count` parts: disjoint, together all, the same everywhere.

    By the hash of a job's name, so that adding a garment moves no other job to another part.
    """
    if not 0 <= index < count:
        raise ManifestError(f"shard {index}/{count} does not exist: count from 0 to {count - 1}")
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
        raise ManifestError(f"the manifest has version {content['version']}; this Skinwright reads version {VERSION}")
    bodies: dict[str, dict[str, Any]] = {}
    for body in content["bodies"]:
        _check(body, "body", ("file",))
        bodies[body.get("name") or Path(body["file"]).stem] = body
    jobs = []
    for garment in content["garments"]:
        _check(garment, "garment", ("file",))
        jobs += _of_garment(garment, bodies, content.get("settings", {}), folder)
    names = [job.name for job in jobs]
    for name in names:
        if names.count(name) > 1:
            raise ManifestError(f"two jobs are called {name}: give the garments or bodies different names")
    return jobs


def _of_garment(
    garment: dict[str, Any], bodies: dict[str, dict[str, Any]], settings: dict[str, Any], folder: Path
) -> list[Job]:
    own = garment.get("name") or Path(garment["file"]).stem
    jobs = []
    for name in garment.get("bodies", list(bodies)):
        if name not in bodies:
            raise ManifestError(f"garment {own} names the body {name}, which is not among {', '.join(bodies)}")
        body = bodies[name]
        jobs.append(
            Job(
                f"{name}--{own}",
                (folder / body["file"]).resolve(),
                (folder / garment["file"]).resolve(),
                body.get("object", ""),
                tuple(garment.get("objects", ())),
                settings | garment.get("settings", {}),
            )
        )
    return jobs


def _check(content: Any, what: str, needed: tuple[str, ...]) -> None:
    if not isinstance(content, dict):
        raise ManifestError(f"a {what} must be a JSON object, not {json.dumps(content)[:60]}")
    for name in content.keys() - _KEYS[what]:
        raise ManifestError(f"a {what} has no {name}; it has {', '.join(sorted(_KEYS[what]))}")
    for name in needed:
        if not content.get(name):
            raise ManifestError(f"a {what} needs {name}")


def _sha256(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ManifestError(f"{path} cannot be read: {error.strerror}") from error
