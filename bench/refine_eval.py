"""Refined skin against linear blending, Preserve Volume and Corrective Smooth, all three as Blender computes them.

    python bench/refine_eval.py [--quick] [--out FOLDER]

Tables: a bent and twisted cylinder with two sets of weights and with each constraint off; knee and elbow of a MakeHuman
body over cell sizes; every character over test poses and clips; pictures of some of them, and of an elbow and a knee
that bend. Volume is
against rest; pairs are pairs of triangles that pass through each other; bulge is the farthest that skin comes from its
bones as a multiple of rest.
Needs bpy, the native module and the characters (SKINWRIGHT_DATA).
"""

import argparse
import json
import os
import sys
import time
from pathlib import Path

import numpy as np
import refine_picture
import skinwright_native as native

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests"))
from support import posed, skin

ROOT = Path(__file__).resolve().parent.parent
DATA = Path(os.environ.get("SKINWRIGHT_DATA", ROOT.parent / "shared" / "data"))
BODIES = [
    "mh_male/body.glb",
    "mh_female/body.glb",
    "q_male_peasant/body.glb",
    "q_female_peasant/body.glb",
    "qm_men/Casual.glb",
    "qm_men/Suit.glb",
    "qm_women/Casual.glb",
    "animations/mannequin_clips.glb",
]
POSES = ["candy", "elbows", "squat", "sit"]
CLIP_SHARES = (0.25, 0.6)
"""Which frames of a clip are solved, as shares of its length."""
PICTURED = [
    ("mh_male/body.glb", "elbows"),
    ("mh_male/body.glb", "squat"),
    ("mh_female/body.glb", "sit"),
    ("q_male_peasant/body.glb", "candy"),
    ("q_female_peasant/body.glb", "squat"),
    ("qm_men/Casual.glb", "elbows"),
    ("qm_men/Suit.glb", "squat"),
    ("animations/mannequin_clips.glb", "sit"),
]
CHARACTERS = (
    "New pairs of triangles that pass through each other, within one piece of the mesh (+ between pieces) / volume % "
    "by the winding number, to 0.3 % / 99.9 % quantile of edge stretch; ms is the CPU time of one solve. Pieces that "
    "lie in each other at rest, as clothes over clothes do, slide along each other."
)


def volume(positions, triangles) -> float:
    """Enclosed by a closed mesh."""
    a, b, c = (positions[triangles[:, k]].astype(float) for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


class InBlender:
    """A character as a Blender mesh with an armature of its bones, for what Blender itself makes of a pose."""

    def __init__(self, positions, triangles, weights, parents, segments):
        import bpy

        self.bpy = bpy
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        mesh = bpy.data.meshes.new("Body")
        mesh.from_pydata(positions.tolist(), [], triangles.tolist())
        self.obj = bpy.data.objects.new("Body", mesh)
        self.rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
        for obj in (self.obj, self.rig):
            bpy.context.collection.objects.link(obj)
        bpy.context.view_layer.objects.active = self.rig
        bpy.ops.object.mode_set(mode="EDIT")
        bones = [self.rig.data.edit_bones.new(f"b{j}") for j in range(len(parents))]
        for bone, parent, (head, tail) in zip(bones, parents, segments, strict=True):
            bone.head, bone.tail = head, tail
            bone.parent = bones[parent] if parent >= 0 else None
        bpy.ops.object.mode_set(mode="OBJECT")
        for j, column in enumerate(weights.T):
            group = self.obj.vertex_groups.new(name=f"b{j}")
            for i in np.flatnonzero(column):
                group.add([int(i)], float(column[i]), "REPLACE")
        self.armature = self.obj.modifiers.new("Armature", "ARMATURE")
        self.armature.object = self.rig
        self.smooth = self.obj.modifiers.new("Smooth", "CORRECTIVE_SMOOTH")

    def posed(self, pose_from_rest, *, preserve_volume=False, smooth=False):
        """(V, 3) evaluated."""
        from mathutils import Matrix

        self.armature.use_deform_preserve_volume, self.smooth.show_viewport = preserve_volume, smooth
        for bone in sorted(self.rig.pose.bones, key=lambda b: len(b.parent_recursive)):
            turned = Matrix(pose_from_rest[int(bone.name[1:])].tolist())
            bone.matrix = turned @ bone.bone.matrix_local
            self.bpy.context.view_layer.update()
        evaluated = self.obj.evaluated_get(self.bpy.context.evaluated_depsgraph_get())
        positions = np.empty(len(evaluated.data.vertices) * 3, np.float32)
        evaluated.data.vertices.foreach_get("co", positions)
        return positions.reshape(-1, 3)


def cylinder(around=40, along=64, radius=0.25):
    """Positions and triangles of a capped tube along x from -1 to 1."""
    x, angle = np.linspace(-1, 1, along + 1), np.arange(around) * 2 * np.pi / around
    rings = [[[u, radius * np.cos(a), radius * np.sin(a)] for a in angle] for u in x]
    positions = np.array([p for ring in rings for p in ring] + [[-1, 0, 0], [1, 0, 0]], np.float32)
    triangles, ends = [], (len(positions) - 2, len(positions) - 1)
    for j in range(around):
        k = (j + 1) % around
        for i in range(along):
            a, b, c, d = i * around + j, i * around + k, (i + 1) * around + j, (i + 1) * around + k
            triangles += [[a, d, b], [a, c, d]] if (i + j) % 2 else [[a, c, b], [b, c, d]]
        triangles += [[ends[0], j, k], [ends[1], along * around + k, along * around + j]]
    return positions, np.array(triangles, np.uint32)[:, ::-1].copy()  # outwards


def cylinder_weights(positions) -> dict[str, np.ndarray]:
    """Inverse distance to the fourth power, and a smooth step within the radius."""
    x, radius = positions[:, 0].astype(float), np.linalg.norm(positions[:, 1:].astype(float), axis=1)
    distance = np.stack([np.hypot(np.maximum(x, 0), radius), np.hypot(np.maximum(-x, 0), radius)], 1)
    inverse = np.maximum(distance, 1e-6) ** -4
    t = np.clip((x + 0.25) / 0.5, 0, 1)
    t = t * t * (3 - 2 * t)
    return {"1/d^4": inverse / inverse.sum(1, keepdims=True), "smoothstep": np.stack([1 - t, t], 1)}


def cylinder_table(lines: list[str], quick: bool) -> None:
    """Every method on every bend."""
    positions, triangles = cylinder()
    parents, segments = np.array([-1, 0]), np.array([[[-1, 0, 0], [0, 0, 0]], [[0, 0, 0], [1, 0, 0]]], float)
    rest = volume(positions, triangles)
    cases = [("bend", [0, 0, 1], d) for d in (60, 90, 120, 135)] + [("twist", [1, 0, 0], d) for d in (120, 179)]
    lines += ["## Cylinder", "", "Volume % / pairs / bulge; for the refined ones also inverted tetrahedra in %.", ""]
    names = ["linear", "Preserve Volume", "Corrective Smooth", "refined, live", "refined, bake"]
    off = {"stretch": 0, "volume": 0, "bind": 0, "energy": 0, "self_collision": False}
    lines += ["| | " + " | ".join(names + [f"bake, {name} off" for name in off]) + " |", "|---" * 11 + "|"]
    for label, weights in cylinder_weights(positions).items():
        blender = InBlender(positions, triangles, weights, parents, segments)
        rows = native.Weights.from_dense(weights)
        make = lambda rows=rows, **k: native.Refiner(positions, triangles, rows, parents, segments, **k)  # noqa: E731
        refiner, without = make(), {name: make(**{name: value}) for name, value in off.items()}
        for kind, axis, degrees in cases:
            pose = np.tile(np.eye(4), (2, 1, 1))
            pose[1, :3, :3] = posed.about(np.array(axis, float), degrees)
            shown = [
                blender.posed(pose),
                blender.posed(pose, preserve_volume=True),
                blender.posed(pose, smooth=True),
            ]
            cells = [_figures(refiner, pose, x, volume(x, triangles) / rest - 1) for x in shown]
            solvers: list[tuple[native.Refiner, native.Quality]] = [(refiner, "live"), (refiner, "bake")]
            solvers += [(other, "bake") for other in without.values()]
            for solver, quality in solvers:
                x = solver.solve(pose, quality=quality)
                report = solver.report()
                assert report is not None  # it has just solved
                inverted = report["inverted_tetrahedra"] / max(report["active_tetrahedra"], 1)
                cells.append(_figures(refiner, pose, x, volume(x, triangles) / rest - 1) + f" / {inverted:.2%}")
            lines.append(f"| {label}, {kind} {degrees} | " + " | ".join(cells) + " |")
            print(lines[-1], flush=True)
        if quick:
            break


def _figures(refiner, pose, positions, lost) -> str:
    figures = refiner.measure(pose, positions)
    bulge = max((joint["bulge"] for joint in figures["joints"]), default=1.0)
    return f"{lost:+.2%} / {figures['pairs']} / {bulge:.2f}"


def joints_table(lines: list[str]) -> None:
    """Knee and elbow over cell sizes; volume of a ball around the joint, as a share of what it holds at rest."""
    character = posed.read(DATA / "mh_male/body.glb")
    triangles = skin.weld(character.positions, character.triangles)
    rest, diagonal = volume(character.positions, triangles), np.linalg.norm(np.ptp(character.positions, axis=0))
    lines += ["", "## Joints of mh_male", "", "Volume of the region / pairs / bulge / inverted.", ""]
    lines += ["| joint | cell | limit | linear | live | bake |", "|---|---|---|---|---|---|"]
    for name, degrees, radius in (("calf_l", 120, 0.3), ("lowerarm_l", 60, 0.2), ("lowerarm_l", 90, 0.2)):
        joint = character.bones.index(name)
        pose = posed.rotated(character, joint, _flexion(character, joint, degrees))
        points = np.random.default_rng(0).uniform(-radius, radius, (40000, 3))
        points = points[np.linalg.norm(points, axis=1) < radius] + character.segments[joint, 0]
        inside = skin.winding(character.positions, triangles, points) > 0.5
        region = inside.mean() * 4 / 3 * np.pi * radius**3
        for cell in (0.8, 1.0, 1.25):
            for limit in (1.08, 1.10):
                refiner = skin.refiner_of(character, cell=0.015 * diagonal * cell, bind=limit)
                cells = []
                for quality in (None, "live", "bake"):
                    linear = native.linear_blend(
                        character.positions, native.Weights.from_dense(character.weights), pose
                    )
                    x = refiner.solve(pose, quality=quality) if quality else linear
                    report = refiner.report() if quality else None
                    cells.append(_figures(refiner, pose, x, (volume(x, triangles) - rest) / region))
                    if report:
                        cells[-1] += f" / {report['inverted_tetrahedra'] / max(report['active_tetrahedra'], 1):.2%}"
                lines.append(f"| {name} {degrees} | {cell} | {limit} | " + " | ".join(cells) + " |")
                print(lines[-1], flush=True)


def _flexion(character, joint: int, degrees: float) -> np.ndarray:
    """The rotation that bends a joint further the way it is bent at rest."""
    head, tail = character.segments[joint]
    parent = character.parents[joint]
    up, down = character.segments[parent, 0] - head, tail - head
    axis = np.cross(up, down)
    straight = np.linalg.norm(axis) < 0.05 * np.linalg.norm(up) * np.linalg.norm(down)
    axis = np.array([1.0, 0, 0]) if straight else axis
    closer = posed.about(axis, 5) @ down @ up > down @ up
    return posed.about(axis, degrees if closer else -degrees)


def characters_table(lines: list[str], quick: bool) -> None:
    """All bodies over the test poses, and the clips."""
    conventions = json.loads((DATA / "poses.json").read_text())
    lines += ["", "## Characters", "", CHARACTERS, ""]
    names = ["body", "pose", "linear", "Preserve Volume", "Corrective Smooth", "live", "ms", "bake", "ms"]
    lines += ["| " + " | ".join(names) + " |", "|---" * len(names) + "|"]
    pictures = []
    for path in BODIES[:2] if quick else BODIES:
        body = Body(posed.read(DATA / path))
        poses = {name: posed.pose(body.character, conventions["poses"][name], conventions) for name in POSES}
        for clip in (animation["name"] for animation in body.character.scene.get("animations", [])):
            seconds = posed.length(body.character, clip)
            poses |= {f"{clip} {s:.0%}": posed.clip(body.character, clip, s * seconds) for s in CLIP_SHARES}
        for name, pose in poses.items():
            shown, cells = body.solved(pose)
            lines.append(f"| {path} | {name} | " + " | ".join(cells) + " |")
            print(lines[-1], flush=True)
            if (path, name) in PICTURED:
                pictures.append((f"{path.removesuffix('.glb')}, {name}", body, shown))
    if pictures:
        refine_picture.sheet(pictures, ROOT / "bench" / "refine_results.png")


class Body:
    """A character with what its figures need."""

    def __init__(self, character: posed.Character) -> None:
        self.character = character
        triangles = skin.weld(character.positions, character.triangles).astype(np.uint32)
        self.triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
        self.pieces = skin.pieces(self.triangles, len(character.positions))
        self.at_rest = self._pairs(character.positions)
        self.step = np.ptp(character.positions, axis=0).max() / 150
        self.rest_volume = self._volume(character.positions)
        self.edges = skin.edges(self.triangles)
        self.weights, self.refiner = native.Weights.from_dense(character.weights), skin.refiner_of(character)
        arrays = character.positions, self.triangles, character.weights, character.parents, character.segments
        self.blender = InBlender(*arrays)

    def solved(self, pose: np.ndarray) -> tuple[list[np.ndarray], list[str]]:
        """Positions by every method, and the cells of the table."""
        positions = self.character.positions
        shown = [
            native.linear_blend(positions, self.weights, pose),
            native.dual_quaternion_blend(positions, self.weights, pose),
            self.blender.posed(pose, smooth=True),
        ]
        cells = [self.figures(x) for x in shown]
        for quality in ("live", "bake"):
            start = time.process_time()
            shown.append(self.refiner.solve(pose, quality=quality))
            milliseconds = (time.process_time() - start) * 1e3
            cells += [self.figures(shown[-1]), f"{milliseconds:.0f}"]
        return shown, cells

    def figures(self, positions: np.ndarray) -> str:
        new = self.new_pairs(positions)
        own = sum(self.pieces[self.triangles[a, 0]] == self.pieces[self.triangles[b, 0]] for a, b in new)
        between = f" + {len(new) - own}" if len(new) > own else ""
        lost = self._volume(positions) / self.rest_volume - 1
        stretch = skin.stretch(self.character.positions, positions, self.edges)
        return f"{own}{between} / {lost:+.1%} / {stretch:.2f}"

    def new_pairs(self, positions: np.ndarray) -> set[tuple[int, int]]:
        """Pairs of triangles that pass through each other and do not at rest."""
        return self._pairs(positions) - self.at_rest

    def _pairs(self, positions: np.ndarray) -> set[tuple[int, int]]:
        return {(a, b) for a, b in native.intersecting_pairs(positions, self.triangles).tolist()}

    def _volume(self, positions: np.ndarray) -> float:
        return skin.volume(positions, self.triangles, self.step)


def strips() -> None:
    """An elbow and a knee that bend, linear and refined, and how often they pass through themselves."""
    body = Body(posed.read(DATA / "mh_male/body.glb"))
    rows = []
    for name, most in (("lowerarm_l", 90), ("calf_l", 120)):
        joint = body.character.bones.index(name)
        turns = [_flexion(body.character, joint, degrees) for degrees in np.linspace(0, most, 7)[1:]]
        poses = [posed.rotated(body.character, joint, turn) for turn in turns]
        skew = turns[0] - turns[0].T
        axis = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
        outside = axis * np.sign(axis @ [body.character.segments[joint, 0, 0], 0, 0.3])
        linear = [native.linear_blend(body.character.positions, body.weights, pose) for pose in poses]
        refined = [body.refiner.solve(pose, quality="bake") for pose in poses]
        rows += [(f"{name}, {how}", body, joint, x, outside) for how, x in (("linear", linear), ("refined", refined))]
    refine_picture.strips(rows, ROOT / "bench" / "refine_strips.png")


def main() -> None:
    """All tables, printed as they come and written at the end."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one set of weights, two bodies")
    parser.add_argument("--only", choices=["cylinder", "joints", "characters", "strips"], help="one table")
    parser.add_argument("--out", type=Path, default=ROOT / "bench" / "refine_results.md", help="file of the tables")
    options = parser.parse_args()
    tables = {
        "cylinder": lambda lines: cylinder_table(lines, options.quick),
        "joints": joints_table,
        "characters": lambda lines: characters_table(lines, options.quick),
        "strips": lambda _: strips(),
    }
    lines = ["# Refined skin", ""]
    for name, table in tables.items():
        if options.only in (None, name):
            table(lines)
    if options.only != "strips":
        options.out.write_text("\n".join(lines) + "\n")
    print(f"written to {options.out}")
    sys.stdout.flush()
    os._exit(0)  # some bpy wheels hang when Python ends in the ordinary way


if __name__ == "__main__":
    main()
