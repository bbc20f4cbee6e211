"""A wardrobe on a Dask cluster: each job is a Blender of its own, on whichever worker is free.

    python examples/wardrobe_dask.py wardrobe.json --out /shared/results --scheduler tcp://farm:8786
    python examples/wardrobe_dask.py wardrobe.json --out results --workers 2     # a cluster on this machine

Every worker must see the manifest's files and the output folder under the same paths. A worker that dies loses nothing:
its jobs go to another, and a job whose result is there already is kept. Needs `pip install distributed`; the command
that runs a job is `--command`, by default this Python with the bpy wheel.
"""

import argparse
import importlib.util
import json
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
        futures = client.map(run_job, [job.name for job in jobs], command=command, retries=RETRIES, pure=False)
        failed = [name for future in as_completed(futures) for name in [_ended(future)] if name]
    print(
        f"{len(jobs) - len(failed)} of {len(jobs)} jobs have a result{': failed ' if failed else ''}{', '.join(failed)}"
    )
    return 1 if failed else 0


def run_job(name: str, command: list[str]) -> tuple[str, int, str]:
    """One job in a process of its own: what it does to Blender cannot reach the next."""
    done = subprocess.run(
        [*command, "--job", name], capture_output=True, encoding="utf-8", errors="replace", check=False
    )
    return name, done.returncode, done.stdout.strip().splitlines()[-1] if done.stdout.strip() else done.stderr[-500:]


def _ended(future) -> str:
    """Print how a job ended; returns its name if it failed."""
    name, code, said = future.result()
    print(said, flush=True)
    return name if code else ""


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
    own = json.dumps(sys.executable), json.dumps(str(SCRIPT))
    parser.add_argument("--command", default=" ".join(own), help="runs a job; manifest and output folder are appended")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
