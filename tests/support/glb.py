"""Reads skinned meshes out of .glb files, as much of the format as the shared data uses."""

import json
import os
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp

DTYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass
class SkinnedMesh:
    """Positions (V, 3) float32, triangles (T, 3), weights (V, bones) sparse or None; equal positions are merged."""

    name: str
    positions: np.ndarray
    triangles: np.ndarray
    weights: sp.csr_matrix | None


def data_folder() -> Path:
    """The folder of real characters and garments; skips the test where there is none."""
    import pytest  # benchmarks read files without it

    root = Path(__file__).resolve().parents[2]
    folder = Path(os.environ.get("SKINWRIGHT_DATA", root.parent / "shared" / "data"))
    if not (folder / "cases.json").is_file():
        pytest.skip(f"no characters at {folder}: set SKINWRIGHT_DATA")
    return folder


def contents(path: Path) -> tuple[dict, Callable[[int], np.ndarray]]:
    """The scene of a file as JSON, and what reads an accessor by its number."""
    blob = path.read_bytes()
    length = struct.unpack_from("<I", blob, 12)[0]
    scene, binary = json.loads(blob[20 : 20 + length]), blob[20 + length + 8 :]
    return scene, lambda index: _accessor(scene, binary, index)


def read_meshes(path: Path) -> list[SkinnedMesh]:
    """All meshes of a file in its own space (rest pose, metres)."""
    scene, accessor = contents(path)
    nodes = [node for node in scene["nodes"] if "mesh" in node]
    return [_mesh(scene, accessor, node) for node in nodes]


def joined(meshes: list[SkinnedMesh]) -> SkinnedMesh:
    """All meshes as one."""
    offsets = np.cumsum([0] + [len(mesh.positions) for mesh in meshes])
    triangles = [mesh.triangles + offset for mesh, offset in zip(meshes, offsets, strict=False)]
    weights = sp.vstack([mesh.weights for mesh in meshes]).tocsr()
    return SkinnedMesh(meshes[0].name, np.vstack([m.positions for m in meshes]), np.vstack(triangles), weights)


def _accessor(scene: dict, binary: bytes, index: int) -> np.ndarray:
    accessor = scene["accessors"][index]
    view = scene["bufferViews"][accessor["bufferView"]]
    dtype, columns = np.dtype(DTYPES[accessor["componentType"]]), COLUMNS[accessor["type"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    stride = view.get("byteStride", columns * dtype.itemsize)
    rows = np.lib.stride_tricks.as_strided(
        np.frombuffer(binary, np.uint8)[start:], (accessor["count"], columns * dtype.itemsize), (stride, 1)
    )
    values = rows.copy().view(dtype).reshape(accessor["count"], columns)
    return values / np.iinfo(dtype.name).max if accessor.get("normalized") else values


def _mesh(scene: dict, accessor, node: dict) -> SkinnedMesh:
    positions: list[np.ndarray] = []
    triangles: list[np.ndarray] = []
    joints: list[np.ndarray] = []
    shares: list[np.ndarray] = []
    start = 0
    for part in scene["meshes"][node["mesh"]]["primitives"]:
        attributes = part["attributes"]
        positions.append(accessor(attributes["POSITION"]))
        triangles.append(accessor(part["indices"]).reshape(-1, 3).astype(np.int64) + start)
        if "JOINTS_0" in attributes:
            sets = range(sum(name.startswith("JOINTS_") for name in attributes))
            joints.append(np.hstack([accessor(attributes[f"JOINTS_{k}"]) for k in sets]))
            shares.append(np.hstack([accessor(attributes[f"WEIGHTS_{k}"]) for k in sets]))
        start += len(positions[-1])
    weights = None
    if joints and "skin" in node:
        at_bones, values = np.vstack(joints), np.vstack(shares)
        bones = len(scene["skins"][node["skin"]]["joints"])
        rows = np.repeat(np.arange(len(at_bones)), at_bones.shape[1])
        weights = sp.csr_matrix((values.ravel().astype(float), (rows, at_bones.ravel())), (start, bones))
    return _merge_equal_positions(node.get("name", ""), np.vstack(positions), np.vstack(triangles), weights)


def _merge_equal_positions(name, positions, triangles, weights) -> SkinnedMesh:
    """A file repeats a vertex for every normal or texture coordinate it has; the first one stays."""
    first: np.ndarray
    _, first, inverse = np.unique(positions, axis=0, return_index=True, return_inverse=True)
    kept = np.sort(first)
    new = np.searchsorted(kept, first)[inverse.ravel()]
    triangles = new[triangles]
    distinct = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return SkinnedMesh(
        name, positions[kept].astype(np.float32), triangles[distinct], None if weights is None else weights[kept]
    )
