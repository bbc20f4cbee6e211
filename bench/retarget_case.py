"""Pairs of characters with known answers, and the figures that judge retargeted weights.

MakeHuman's bodies are one mesh in many shapes, so a vertex's own index is its true place on the source. The honest
variant takes that gift away: the target gets other vertices, one in each old triangle, and its true weights are
interpolated.
"""

from __future__ import annotations

import itertools
import json
import sys
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import igl
import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests"))
from support import characters
from support.characters import Character

SAMPLES = 600
_MAIN = [
    "upperarm",
    "lowerarm",
    "upperleg",
    "lowerleg",
    "spine",
    "neck",
    "clavicle",
    "shoulder",
    "pelvis",
    "foot",
    "wrist",
    "head",
    "root",
]


@dataclass(frozen=True)
class Pair:
    """A source, a target, and the target's true weights over the source's bones (V, B)."""

    name: str
    source: Character
    target: Character
    truth: np.ndarray
    places: np.ndarray | None = None
    """Where on the source each target vertex truly belongs (V, 3), if it is known."""
    area: np.ndarray | None = None
    """Share of the source's surface that each target vertex stands for (V,)."""


def makehuman_pairs(wheel: Path) -> list[Pair]:
    """The man to four other bodies, three of them in another pose."""
    source = characters.makehuman_body("male", wheel=wheel)
    pairs = []
    for shape in ("female", "heavy", "child", "baby"):
        target = characters.makehuman_body(shape, t_pose=shape != "female", wheel=wheel)
        pose = "same pose" if shape == "female" else "T pose"
        pairs.append(Pair(f"{shape}, {pose}", source, target, source.weights, source.positions, areas(source)))
    return pairs


def remeshed(pair: Pair, seed: int = 1) -> Pair:
    """The target with other vertices: one at a random point of every triangle, in place of the old ones."""
    random = np.random.default_rng(seed)
    target = pair.target
    inside = random.dirichlet([2, 2, 2], size=len(target.triangles))
    blend = sp.csr_matrix(
        (inside.ravel(), (np.repeat(np.arange(len(inside)), 3), target.triangles.ravel())),
        shape=(len(inside), len(target.positions)),
    )
    triangles = _dual(target.triangles, len(target.positions))
    weights = blend @ pair.truth
    area = igl.doublearea(pair.source.positions, target.triangles.astype(np.int64))
    body = replace(target, positions=blend @ target.positions, triangles=triangles, weights=weights)
    return Pair(pair.name, pair.source, body, weights, blend @ pair.source.positions, area / area.sum())


def _dual(triangles: np.ndarray, n_vertices: int) -> np.ndarray:
    """Triangles over the old triangles: a fan around each old vertex whose triangles form a closed ring."""
    after: dict[tuple[int, int], tuple[int, int]] = {}
    for t, (a, b, c) in enumerate(triangles):
        after[a, b], after[b, c], after[c, a] = (t, c), (t, a), (t, b)
    fans = []
    first: dict[int, tuple[int, int]] = {}
    for t, corners in enumerate(triangles):
        for k in range(3):
            first.setdefault(corners[k], (t, corners[(k + 1) % 3]))
    for vertex, (_, start) in first.items():
        ring: list[int] = []
        edge = start
        while (vertex, edge) in after and len(ring) < 64:
            t, edge = after[vertex, edge]
            ring.append(t)
            if edge == start:
                break
        if edge == start and len(ring) > 2:
            fans += [(ring[0], ring[k], ring[k + 1]) for k in range(1, len(ring) - 1)]
    return np.array(fans)


def file_pairs(folder: Path) -> list[Pair]:
    """Every pair of `retarget.json`; the truth is what the target's artist painted."""
    pairs = []
    for entry in json.loads((folder / "retarget.json").read_text()):
        source, target = (characters.gltf_character(folder / entry[side]) for side in ("source", "target"))
        pairs.append(Pair(f"{entry['source']} to {entry['target']}", source, target, target.weights))
    return pairs


# Characters that share a skeleton with others of their folder; each is the source of the next.
_FAMILIES = ("qm_women", "qm_men", "animals")


def other_pairs(folder: Path) -> list[Pair]:
    """Each file of a family as the target of the one before it, but for the pairs of `retarget.json`."""
    named = {(entry["source"], entry["target"]) for entry in json.loads((folder / "retarget.json").read_text())}
    pairs = []
    for family in _FAMILIES:
        files = sorted(path.relative_to(folder).as_posix() for path in (folder / family).glob("*.glb"))
        for first, second in itertools.pairwise(files):
            if (first, second) in named:
                continue
            source, target = (characters.gltf_character(folder / name) for name in (first, second))
            pairs.append(Pair(f"{first} to {second}", source, target, target.weights))
    return pairs


def areas(body: Character) -> np.ndarray:
    """Share of the area per vertex (V,)."""
    mass = igl.massmatrix(body.positions, body.triangles.astype(np.int64), igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    mass = np.nan_to_num(mass)
    return mass / mass.sum()


def main_bones(names: list[str], parents: np.ndarray) -> np.ndarray:
    """Sums the weights of fingers, toes and face into main bones (B, M): errors there would drown all others."""
    main = [name for name in names if any(word in name for word in _MAIN)]
    gather = np.zeros((len(names), len(main)))
    for j, name in enumerate(names):
        k = j
        while name not in main and parents[k] >= 0:
            k = parents[k]
            name = names[k]
        gather[j, main.index(name) if name in main else main.index("root")] = 1
    return gather


@dataclass(frozen=True)
class Figures:
    """Geodesic error in % of the root of the area, half L1 of the weights, wrong main bone and flips in %."""

    geodesic: float
    half_l1: float
    flips: float


class Ruler:
    """Measures correspondences onto one source."""

    def __init__(self, source: Character) -> None:
        self.source = source
        triangles = source.triangles
        edges = np.unique(
            np.sort(np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), 1), axis=0
        )
        length = np.linalg.norm(source.positions[edges[:, 0]] - source.positions[edges[:, 1]], axis=1)
        ends = (np.r_[edges[:, 0], edges[:, 1]], np.r_[edges[:, 1], edges[:, 0]])
        self._graph = sp.csr_matrix((np.r_[length, length], ends), shape=[len(source.positions)] * 2)
        self._tree = cKDTree(source.positions)
        self._root_area = np.sqrt(0.5 * igl.doublearea(source.positions, triangles.astype(np.int64)).sum())
        self._normals = igl.per_vertex_normals(source.positions, triangles.astype(np.int64))

    def measure(self, pair: Pair, points: np.ndarray, weights: np.ndarray) -> Figures:
        """`points` (V, 3) on the source, `weights` (V, B) over its bones."""
        area, places = pair.area, pair.places
        if area is None or places is None:
            raise ValueError(f"{pair.name}: the true places are not known")
        random = np.random.default_rng(1)
        samples = random.choice(len(area), SAMPLES, p=area)
        found, true = self._tree.query(points)[1], self._tree.query(places)[1]
        distances = dijkstra(self._graph, indices=true[samples])
        geodesic = distances[np.arange(SAMPLES), found[samples]]
        # Edges are coarse beside short ways: there the straight line is as good.
        straight = np.linalg.norm(points - places, axis=1)[samples]
        near = straight < 0.02 * self._root_area
        geodesic[near] = np.minimum(geodesic, straight)[near]
        gather = main_bones(pair.source.names, pair.source.parents)
        half = 0.5 * np.abs(weights @ gather - pair.truth @ gather).sum(1)
        front = self._normals[true, 1]
        facing = np.abs(front) > 0.5
        flipped = np.sign(self._normals[found, 1]) != np.sign(front)
        return Figures(
            100 * geodesic.mean() / self._root_area,
            (half * area).sum(),
            100 * (flipped * area)[facing].sum() / area[facing].sum(),
        )


@cache
def ruler(wheel: Path) -> Ruler:
    """That of the man."""
    return Ruler(characters.makehuman_body("male", wheel=wheel))
