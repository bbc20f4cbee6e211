"""A wardrobe on a Dask cluster: a few jobs share one start of Blender, on whichever worker is free.

    python examples/wardrobe_dask.py wardrobe.json --out /shared/results --scheduler tcp://farm:8786
    python examples/wardrobe_dask.py wardrobe.json --out results --workers 2     # a cluster on this machine

Every worker must see the manifest's files and the output folder under the same paths. A worker that dies loses nothing:
its jobs go to another, and a job whose result is there already is kept. Needs `pip install distributed`; the command
that runs jobs is `--command`, by default this Python with the bpy wheel. Starting Blender costs more than a small
garment: `--at-once` says how many jobs one start does, fewer for large ones.
"""

import argparse
import importlib.util
import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

from distributed import Client, LocalCluster, as_completed

ROOT = Path(__file__).resolve().parent.parent
SCRIPT = ROOT / "blender_scripts" / "wardrobe.py"
RETRIES = 3


def main() -> int:
    """Hand out all jobs, merge what they say; returns the exit code of the worst."""
    options = _options()
    jobs = _manifest_module().read(options.manifest)
    command = [*shlex.split(options.command), str(options.manifest.resolve()), "--out", str(options.out.resolve())]
    with _client(options) as client:
        names = [job.name for job in jobs]
        parts = [names[at : at + options.at_once] for at in range(0, len(names), options.at_once)]
        futures = client.map(run_jobs, parts, command=command, retries=RETRIES, pure=False)
        failed = sorted(name for future in as_completed(futures) for name in _failed(future))
    print(
        f"{len(jobs) - len(failed)} of {len(jobs)} jobs have a result{': failed ' if failed else ''}{', '.join(failed)}"
    )
    return 1 if failed else 0


def run_jobs(names: list[str], command: list[str]) -> tuple[list[str], int, str]:
    """Some jobs in one Blender; returns their names, its exit code and what it said."""
    chosen = [argument for name in names for argument in ("--job", name)]
    done = subprocess.run([*command, *chosen], capture_output=True, encoding="utf-8", errors="replace", check=False)
    return names, done.returncode, done.stdout if done.stdout.strip() else done.stderr[-500:]


def _failed(future) -> list[str]:
    """Print how jobs ended; returns the names of those that failed, all of them if Blender did not get to its end."""
    names, code, said = future.result()
    print(said.strip(), flush=True)
    ended = dict(re.findall(r"^\[\d+/\d+\] (.+?): (done|kept|failed)\.", said, re.MULTILINE))
    return [name for name in names if code and ended.get(name, "failed") == "failed"]


def _client(options: argparse.Namespace) -> Client:
    if options.scheduler:
        return Client(options.scheduler)
    return Client(LocalCluster(n_workers=options.workers, threads_per_worker=1, dashboard_address=None))


def _manifest_module():
    """The reader of manifests alone: no Blender is needed to hand out jobs."""
    path = ROOT / "addon" / "skinwright" / "wardrobe" / "manifest.py"
    spec = importlib.util.spec_from_file_location("skinwright_wardrobe_manifest", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Run a wardrobe on a Dask cluster.")
    parser.add_argument("manifest", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--scheduler", help="address of a running scheduler; none starts a cluster here")
    parser.add_argument("--workers", type=int, default=2, help="worker processes of a cluster on this machine")
    parser.add_argument("--at-once", type=int, default=1, help="jobs that one start of Blender does")
    own = json.dumps(sys.executable), json.dumps(str(SCRIPT))
    parser.add_argument("--command", default=" ".join(own), help="runs a job; manifest and output folder are appended")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
