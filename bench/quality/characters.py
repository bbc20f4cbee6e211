"""Rigged characters out of .glb files: skeleton, meshes and the weights their artists painted."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

DTYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
TOLERANCE = 1e-6
"""Metres within which the vertices of a file are one: it repeats them for every normal and texture coordinate."""


@dataclass(frozen=True)
class Skeleton:
    """Bone names, parents (-1 for a root) and the positions of the bones' heads in the rest pose (B, 3), metres."""

    names: list[str]
    parents: list[int]
    heads: np.ndarray


@dataclass(frozen=True)
class Mesh:
    """Rest positions (V, 3), triangles (T, 3), weights (V, B) whose rows sum to 1, or None."""

    name: str
    positions: np.ndarray
    triangles: np.ndarray
    weights: sp.csr_matrix | None


class File:
    """One .glb file, held open as its JSON and its binary chunk."""

    def __init__(self, path: Path) -> None:
        blob = path.read_bytes()
        length = struct.unpack_from("<I", blob, 12)[0]
        self.scene: dict[str, Any] = json.loads(blob[20 : 20 + length])
        self.binary = blob[20 + length + 8 :]

    def skeleton(self) -> Skeleton:
        """Of the first skin. The rest pose is that of the inverse bind matrices, in which the weights were painted."""
        skin, nodes = self.scene["skins"][0], self.scene["nodes"]
        joints = {node: place for place, node in enumerate(skin["joints"])}
        above = {child: node for node, entry in enumerate(nodes) for child in entry.get("children", [])}
        parents = []
        for node in joints:
            while (parent := above.get(node)) is not None and parent not in joints:
                node = parent
            parents.append(-1 if parent is None else joints[parent])
        inverse = self._accessor(skin["inverseBindMatrices"]).astype(float).reshape(-1, 4, 4).transpose(0, 2, 1)
        names = [nodes[node].get("name", f"joint {node}") for node in joints]
        return Skeleton(names, parents, np.linalg.inv(inverse)[:, :3, 3])

    def meshes(self) -> list[Mesh]:
        """All meshes in bind space, vertices as the file has them, split at seams."""
        return [self._mesh(node) for node in self.scene["nodes"] if "mesh" in node]

    def _accessor(self, index: int) -> np.ndarray:
        entry = self.scene["accessors"][index]
        view = self.scene["bufferViews"][entry["bufferView"]]
        dtype, columns = np.dtype(DTYPES[entry["componentType"]]), COLUMNS[entry["type"]]
        start = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
        size = columns * dtype.itemsize
        shape, strides = (entry["count"], size), (view.get("byteStride", size), 1)
        rows = np.lib.stride_tricks.as_strided(np.frombuffer(self.binary, np.uint8)[start:], shape, strides)
        values = rows.copy().view(dtype).reshape(entry["count"], columns)
        return values / np.iinfo(dtype.name).max if entry.get("normalized") else values

    def _mesh(self, node: dict[str, Any]) -> Mesh:
        positions: list[np.ndarray] = []
        triangles: list[np.ndarray] = []
        members: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        start = 0
        for part in self.scene["meshes"][node["mesh"]]["primitives"]:
            attributes = part["attributes"]
            positions.append(self._accessor(attributes["POSITION"]).astype(float))
            triangles.append(self._accessor(part["indices"]).reshape(-1, 3).astype(np.int64) + start)
            rows = np.arange(start, start + len(positions[-1]))
            for k in range(sum(name.startswith("JOINTS_") for name in attributes)):
                joints, shares = (self._accessor(attributes[f"{what}_{k}"]) for what in ("JOINTS", "WEIGHTS"))
                members.append((np.repeat(rows, joints.shape[1]), joints.ravel(), shares.ravel().astype(float)))
            start += len(rows)
        weights = None
        if members and "skin" in node:
            at_rows, at_bones, values = (np.concatenate(column) for column in zip(*members, strict=True))
            bones = len(self.scene["skins"][node["skin"]]["joints"])
            weights = normalised(sp.csr_matrix((values, (at_rows, at_bones)), (start, bones)))
        return Mesh(node.get("name", ""), np.vstack(positions), np.vstack(triangles), weights)


def welded(mesh: Mesh) -> Mesh:
    """Without the copies of vertices at seams; of several copies the first one's weights stay."""
    keys = np.round(mesh.positions / TOLERANCE).astype(np.int64)
    first: np.ndarray
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    kept = np.sort(first)
    triangles = np.searchsorted(kept, first)[inverse.ravel()][mesh.triangles]
    triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
    weights = None if mesh.weights is None else mesh.weights[kept]
    return replace(mesh, positions=mesh.positions[kept], triangles=triangles, weights=weights)


def joined(meshes: list[Mesh]) -> Mesh:
    """All meshes as one."""
    offsets = np.cumsum([0] + [len(mesh.positions) for mesh in meshes[:-1]])
    triangles = [mesh.triangles + offset for mesh, offset in zip(meshes, offsets, strict=True)]
    weights = sp.vstack([mesh.weights for mesh in meshes]).tocsr()
    return Mesh(meshes[0].name, np.vstack([m.positions for m in meshes]), np.vstack(triangles), weights)


def normalised(weights: sp.csr_matrix) -> sp.csr_matrix:
    """Rows divided by their sums; empty rows stay empty."""
    sums = np.asarray(weights.sum(axis=1)).ravel()
    return (sp.diags(1 / np.where(sums > 0, sums, 1)) @ weights).tocsr()
