"""What a job leaves behind: weights, then a record that says that all is there. No Blender here."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..files import REPORT, write_whole
from .manifest import Job, sha256


@dataclass(frozen=True)
class Outcome:
    """How a job ended: `status` is "done", "kept" (its inputs have not changed) or "failed"."""

    job: str
    status: str
    record: dict[str, Any]

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {"job": self.job, "status": self.status, **self.record}


def kept(folder: Path, job: Job, inputs: str) -> dict[str, Any] | None:
    """The record of an earlier run with the same inputs whose files are all as it wrote or found them."""
    try:
        record = json.loads((folder / f"{job.name}.json").read_text(encoding="utf-8"))
        known = {folder / name: digest for name, digest in record["files"].items()}
        known |= {Path(name): digest for name, digest in record["depends"].items()}
        whole = all(sha256(path) == digest for path, digest in known.items())
    except (OSError, ValueError, KeyError, AttributeError, TypeError, RecursionError):
        return None
    return record if whole and record.get("inputs") == inputs else None


def write(folder: Path, name: str, content: bytes) -> str:
    """Write a file that is whole or absent, whenever the process ends; returns its SHA-256."""
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / name, content)
    return hashlib.sha256(content).hexdigest()


def write_record(folder: Path, job: Job, record: dict[str, Any]) -> None:
    """The last file of a job: what is not recorded is done again."""
    write(folder, f"{job.name}.json", (json.dumps(record, indent=2) + "\n").encode())


def merge(outcomes: list[Outcome]) -> dict[str, Any]:
    """One report over all jobs, the worst first; the same whatever order they ended in."""
    rank = {"failed": 0, "done": 1, "kept": 1}
    ordered = sorted(outcomes, key=lambda o: (rank[o.status], -o.record.get("unmatched_share", 0.0), o.job))
    counts = {status: sum(o.status == status for o in outcomes) for status in ("done", "kept", "failed")}
    return {"format": REPORT, "jobs": len(outcomes), **counts, "outcomes": [outcome.to_json() for outcome in ordered]}
