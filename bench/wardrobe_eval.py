"""How far one machine goes with a wardrobe, and what kills cost: 200 jobs alone, with Dask, and after two kills.

    python bench/wardrobe_eval.py [--jobs 200]

The jobs are real garments on their bodies (`SKINWRIGHT_DATA`), each under several settings. One run does all of them in
one Blender; another is ended twice by SIGKILL and started again; the third hands ten jobs at once to two Dask workers,
one of which is ended by SIGKILL on the way. The bytes of all results must agree. Writes bench/wardrobe_results.md.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DATA = Path(os.environ.get("SKINWRIGHT_DATA", ROOT.parent / "shared" / "data"))
FOLDER = ROOT / "out" / "wardrobe"
AT_ONCE = 10
BODIES = ("mh_female", "mh_male", "q_female_peasant", "q_male_peasant")


@dataclass
class Run:
    """Wall time and CPU time of a way to do all jobs, in seconds, and how often it was started."""

    name: str
    wall: float
    cpu: float
    starts: int
    digest: str


def main() -> int:
    """All ways, then the report; the exit code says whether the bytes agree."""
    parser = argparse.ArgumentParser(description="A wardrobe alone, killed, and with Dask.")
    parser.add_argument("--jobs", type=int, default=200)
    options = parser.parse_args()
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    manifest = FOLDER / "wardrobe.json"
    manifest.write_text(json.dumps(wardrobe(options.jobs), indent=1), encoding="utf-8")
    runs = [alone(manifest), killed(manifest, options.jobs), with_dask(manifest, options.jobs)]
    text = report(runs, options.jobs)
    print(text)
    (ROOT / "bench" / "wardrobe_results.md").write_text(text, encoding="utf-8")
    return 0 if len({run.digest for run in runs}) == 1 else 1


def wardrobe(jobs: int) -> dict:
    """The manifest: every garment that has one body of its own, again and again with other settings."""
    cases = [case for case in json.loads((DATA / "cases.json").read_text(encoding="utf-8")) if garment_of_a_body(case)]
    garments = []
    for number in range(jobs):
        case, turn = cases[number % len(cases)], number // len(cases)
        settings = {"max_influences": 1 + turn % 8, "smoothing_iterations": turn // 8}
        name = f"{case['id'].replace('/', '-')}-{turn:02d}"
        body = case["id"].split("/")[0]
        garments.append({"name": name, "file": str(DATA / case["garment"]), "bodies": [body], "settings": settings})
    bodies = [{"name": body, "file": str(DATA / body / "body.glb")} for body in BODIES]
    return {"version": 1, "bodies": bodies, "garments": garments}


def garment_of_a_body(case: dict) -> bool:
    """Whether a case's files hold a body and a garment, and nothing else."""
    return case["id"].split("/")[0] in BODIES


def command(manifest: Path, out: Path) -> list[str]:
    """All jobs in one Blender."""
    return [sys.executable, str(ROOT / "blender_scripts" / "wardrobe.py"), str(manifest), "--out", str(out)]


def alone(manifest: Path) -> Run:
    """One process, one start."""
    out = FOLDER / "alone"
    with Clock() as clock:
        subprocess.run(command(manifest, out), check=True, stdout=subprocess.DEVNULL)
    return Run("one Blender", clock.wall, clock.cpu, 1, digest(out))


def killed(manifest: Path, jobs: int) -> Run:
    """Ended when a third and two thirds of the jobs are done."""
    out = FOLDER / "killed"
    with Clock() as clock:
        for share in (1 / 3, 2 / 3):
            process = subprocess.Popen(command(manifest, out), stdout=subprocess.DEVNULL)
            while len(list(out.glob("*--*.json"))) < jobs * share and process.poll() is None:
                time.sleep(0.02)
            process.send_signal(signal.SIGKILL)
            process.wait()
        subprocess.run(command(manifest, out), check=True, stdout=subprocess.DEVNULL)
    return Run("one Blender, killed twice", clock.wall, clock.cpu, 3, digest(out))


def with_dask(manifest: Path, jobs: int) -> Run:
    """Two workers; one of them is ended when a third of the jobs is done."""
    out = FOLDER / "dask"
    script = [sys.executable, str(ROOT / "examples" / "wardrobe_dask.py"), str(manifest), "--out", str(out)]
    with Clock() as clock:
        process = subprocess.Popen([*script, "--workers", "2", "--at-once", str(AT_ONCE)], stdout=subprocess.DEVNULL)
        while len(list(out.glob("*--*.json"))) < jobs / 3 and process.poll() is None:
            time.sleep(0.02)
        worker = workers(process.pid)[0]
        os.kill(worker, signal.SIGKILL)
        if process.wait():
            raise SystemExit("the run with Dask failed")
    return Run("two Dask workers, one killed", clock.wall, clock.cpu, -(-jobs // AT_ONCE), digest(out))


def workers(scheduler: int) -> list[int]:
    """Processes that the scheduler has started and that have started others: workers with a job."""
    parents = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                fields = (folder / "stat").read_text(encoding="utf-8", errors="replace").rsplit(")", 1)[1].split()
            except OSError:
                continue
            parents[int(folder.name)] = int(fields[1])
    busy = set(parents.values())
    return sorted(pid for pid, parent in parents.items() if parent == scheduler and pid in busy)


class Clock:
    """Wall time, and CPU time of the processes that ended inside."""

    def __enter__(self) -> Clock:
        self.begin, self.used = time.perf_counter(), self._used()
        return self

    def __exit__(self, *_error: object) -> None:
        self.wall, self.cpu = time.perf_counter() - self.begin, self._used() - self.used

    @staticmethod
    def _used() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime


def digest(out: Path) -> str:
    """Of the names and bytes of all results."""
    whole = hashlib.sha256()
    for path in sorted(out.glob("*.npz")):
        whole.update(path.name.encode() + hashlib.sha256(path.read_bytes()).digest())
    return whole.hexdigest()


def report(runs: list[Run], jobs: int) -> str:
    """A table, and whether the bytes agree."""
    lines = [
        f"# {jobs} jobs of a wardrobe",
        "",
        f"Real garments on their bodies, {jobs} jobs with different settings; {os.cpu_count()} cores.",
        "",
        "| way | wall, s | CPU, s | CPU per job, s | starts of Blender |",
        "| --- | ---: | ---: | ---: | ---: |",
    ]
    for run in runs:
        lines.append(f"| {run.name} | {run.wall:.0f} | {run.cpu:.0f} | {run.cpu / jobs:.2f} | {run.starts} |")
    same = "All results have the same bytes." if len({run.digest for run in runs}) == 1 else "**The bytes differ.**"
    return "\n".join([*lines, "", f"{same} SHA-256 over names and files: `{runs[0].digest[:16]}`.", ""])


if __name__ == "__main__":
    sys.exit(main())
