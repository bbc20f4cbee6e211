"""`skinwright wardrobe MANIFEST --out FOLDER`: every garment on every body, done again only where inputs changed."""

import argparse
import json
import sys
from pathlib import Path

from .. import files
from ..wardrobe import manifest, results, work


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("manifest", type=Path, help="JSON manifest, or a folder with bodies/ and garments/")
    parser.add_argument("--out", required=True, type=Path, help="folder for weights, records and the report")
    parser.add_argument("--shard", default="0/1", help="which part of the jobs, for example 2/8; counted from 0")
    parser.add_argument("--job", action="append", help="only the job of this name; may be repeated")
    parser.add_argument("--save-blend", action="store_true", help="save the dressed scene of each job too")


def run(options: argparse.Namespace) -> int:
    """Do the jobs; returns the exit code of the worst: 0 all done or kept, 1 some failed, 2 wrong usage."""
    try:
        index, count = _shard(options.shard)
        jobs = manifest.shard(chosen(manifest.read(options.manifest), options.job), index, count)
    except ValueError as error:  # a ManifestError is one too
        print(f"skinwright: {error}", file=sys.stderr)
        return 2
    name = "report.json" if count == 1 and not options.job else f"report-{index}-of-{count}.json"
    _check_outputs(options, jobs, name)
    outcomes = []
    for number, job in enumerate(jobs, 1):
        outcomes.append(work.run(job, options.out, save_blend=options.save_blend))
        last = outcomes[-1]
        said = last.record.get("error") or last.record.get("sentence", "")
        print(f"[{number}/{len(jobs)}] {job.name}: {last.status}. {said}", flush=True)
    merged = results.merge(outcomes)
    if not options.job:
        results.write(options.out, name, (json.dumps(merged, indent=2) + "\n").encode())
    return 1 if merged["failed"] else 0


def _shard(text: str) -> tuple[int, int]:
    index, _, count = text.partition("/")
    if not (index.isdecimal() and count.isdecimal()):
        raise manifest.ManifestError(f"--shard is {text!r}, but must be two numbers: 2/8 is the third of eight parts")
    return int(index), int(count)


def _check_outputs(options: argparse.Namespace, jobs: list[manifest.Job], report: str) -> None:
    """Before anything is done: no output may cost an input, nor the report a file that is none."""
    options.out.mkdir(parents=True, exist_ok=True)
    inputs = {options.manifest.resolve(), *(path for job in jobs for path in (job.body, job.garment))}
    names = [report, *(f"{job.name}{ending}" for job in jobs for ending in work.ENDINGS)]
    for path in (options.out / name for name in names):
        if path.resolve() in inputs:
            raise files.FileError(f"{path} is an input and would be replaced: give --out another folder")
    files.check_output(options.out / report, replaces=files.REPORT)


def chosen(jobs: list[manifest.Job], names: list[str] | None) -> list[manifest.Job]:
    """The jobs of these names, or all. Raises ManifestError for a name that no job has."""
    for name in set(names or ()) - {job.name for job in jobs}:
        raise manifest.ManifestError(f"there is no job {name} in the manifest")
    return [job for job in jobs if not names or job.name in names]
