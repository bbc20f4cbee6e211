"""How close transferred weights come to those that artists painted: a table and a picture of the worst garments.

    python bench/quality_eval.py [--only peasant] [--split-seams] [--no-penetration]

Reads SKINWRIGHT_DATA, or `shared/data` beside the checkout; writes bench/quality_results.md and .png.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path

# Its threads go on spinning after a product, and hold a core that the native module wants.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np
from quality import table
from quality.cases import Case, data_folder, read_cases
from quality.figures import figures
from quality.methods import Weighting, methods
from quality.poses import Poses

WORST = 3


def weights_of(case: Case, weigh: Weighting, split_seams: bool) -> np.ndarray:
    """Of the welded garment, or of the imported one, whose vertices at a seam are averaged to be scored."""
    if not split_seams:
        return weigh(case, case.mesh)
    imported = weigh(case, case.as_imported)
    keys = lambda positions: np.round(positions / 1e-6).astype(np.int64)  # noqa: E731
    place = {tuple(key): i for i, key in enumerate(keys(case.mesh.positions))}
    one = np.array([place[tuple(key)] for key in keys(case.as_imported.positions)])
    summed = np.zeros((len(case.mesh.positions), imported.shape[1]))
    np.add.at(summed, one, imported)
    return summed / np.bincount(one, minlength=len(summed))[:, None]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="garments whose name contains this")
    parser.add_argument("--split-seams", action="store_true", help="transfer to the garments as they are imported")
    parser.add_argument("--no-penetration", action="store_true", help="leave out the slowest figure")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "quality_results.md")
    parser.add_argument("--json", type=Path, help="write all figures here as well")
    options = parser.parse_args()
    start, folder = time.perf_counter(), data_folder()
    cases = read_cases(folder, options.only)
    results: table.Results = {}
    weights: dict[str, dict[str, np.ndarray]] = {}
    for case in cases:
        weights[case.name] = {n: weights_of(case, m, options.split_seams) for n, m in methods().items()}
        by_method = weights[case.name].items()
        results[case.name] = {n: figures(case, w, not options.no_penetration) for n, w in by_method}
        print(f"{time.perf_counter() - start:5.0f} s  {case.name}", flush=True)
    text = table.report(cases, results) + "\n## Every garment\n\n" + table.per_garment(results)
    options.out.write_text("# Transferred weights against the artists'\n\n" + text)
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))
    print(text)
    draw_worst(cases, results, weights, list(Poses.read(folder).poses), options.out.with_suffix(".png"))


def draw_worst(cases, results, weights, pose_names: list[str], path: Path) -> None:
    """The garments whose last method deviates most from the artist, relative to the reference."""
    from quality import picture

    painted = [case for case in cases if case.artist is not None]
    last = list(methods())[-1]
    loss = lambda case: results[case.name][last]["def_p95_mm"] / results[case.name][table.REFERENCE]["def_p95_mm"]  # noqa: E731
    worst = sorted(painted, key=loss, reverse=True)[:WORST]
    picture.draw([(case, weights[case.name]) for case in worst], pose_names, path)


if __name__ == "__main__":
    main()
