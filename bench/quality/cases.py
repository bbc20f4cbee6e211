"""The garments of a data folder, each with its body, its poses and what its artist made of it."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import igl
import numpy as np
import scipy.sparse as sp

from .characters import File, Mesh, Skeleton, joined, welded
from .poses import Poses, skinned

ARTISTS = ("artist", "mh_helper")
"""References that somebody painted; the others were bound by a program."""


def data_folder() -> Path:
    """SKINWRIGHT_DATA, or `shared/data` beside the checkout."""
    beside = Path(__file__).resolve().parents[3] / "shared" / "data"
    folder = Path(os.environ.get("SKINWRIGHT_DATA", beside))
    if not (folder / "cases.json").is_file():
        raise SystemExit(f"There are no characters at {folder}: set SKINWRIGHT_DATA")
    return folder


@dataclass
class Body:
    """A rigged body: its pose-from-rest transforms (P, B, 4, 4) and its surface in each pose."""

    path: str
    rig: str
    skeleton: Skeleton
    mesh: Mesh
    joints: dict[str, np.ndarray]
    pose_from_rest: np.ndarray

    @property
    def skin(self) -> sp.csr_matrix:
        """The weights, which every body has."""
        assert self.mesh.weights is not None
        return self.mesh.weights

    @cached_property
    def rest_surface(self) -> Surface:
        return Surface(self.mesh.positions, self.mesh.triangles)

    @cached_property
    def posed_surfaces(self) -> list[Surface]:
        posed = skinned(self.mesh.positions, self.skin.toarray(), self.pose_from_rest)
        return [Surface(positions, self.mesh.triangles) for positions in posed]


class Surface:
    """A triangle mesh that answers how far outside it a point lies."""

    def __init__(self, positions: np.ndarray, triangles: np.ndarray) -> None:
        self.positions, self.triangles = np.ascontiguousarray(positions), np.ascontiguousarray(triangles)
        self.tree = igl.AABB()
        self.tree.init(self.positions, self.triangles)
        self.normals = vertex_normals(self.positions, self.triangles)

    def closest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Distances (V), triangles (V), barycentric shares (V, 3) and closest points (V, 3)."""
        points = np.ascontiguousarray(points)
        squared, faces, found = self.tree.squared_distance(self.positions, self.triangles, points)
        corners = self.positions[self.triangles[faces]]
        shares = igl.barycentric_coordinates(found, *(np.ascontiguousarray(corners[:, k]) for k in range(3)))
        shares = np.clip(np.nan_to_num(shares, nan=1 / 3), 0, 1)
        return np.sqrt(np.maximum(squared, 0)), faces, shares / shares.sum(axis=1, keepdims=True), found

    def height(self, points: np.ndarray) -> np.ndarray:
        """How far outside the surface each point lies (V), negative inside, by the normal at its closest point."""
        _, faces, shares, found = self.closest(points)
        normals = np.einsum("vk,vki->vi", shares, self.normals[self.triangles[faces]])
        return np.einsum("vi,vi->v", points - found, normals)


@dataclass
class Case:
    """A garment without its weights, and the weights its artist painted (V, B), dense, or None."""

    name: str
    reference: str
    body: Body
    mesh: Mesh
    as_imported: Mesh
    artist: np.ndarray | None

    @cached_property
    def edges(self) -> np.ndarray:
        pairs = np.vstack(
            [self.mesh.triangles[:, [0, 1]], self.mesh.triangles[:, [1, 2]], self.mesh.triangles[:, [2, 0]]]
        )
        return np.unique(np.sort(pairs, axis=1), axis=0)

    @cached_property
    def areas(self) -> np.ndarray:
        """A third of the triangles around each vertex (V)."""
        corners = self.mesh.positions[self.mesh.triangles]
        thirds = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 6
        return np.bincount(self.mesh.triangles.ravel(), np.repeat(thirds, 3), len(self.mesh.positions))

    @cached_property
    def gaps(self) -> np.ndarray:
        return self.body.rest_surface.closest(self.mesh.positions)[0]

    @cached_property
    def rest_heights(self) -> np.ndarray:
        return self.body.rest_surface.height(self.mesh.positions)

    @cached_property
    def artist_posed(self) -> np.ndarray:
        assert self.artist is not None  # asked only of garments that have a reference
        return skinned(self.mesh.positions, self.artist, self.body.pose_from_rest)

    @cached_property
    def zones(self) -> dict[str, np.ndarray]:
        return zones(self.body.joints, self.mesh.positions, self.gaps)


def zones(joints: dict[str, np.ndarray], positions: np.ndarray, gaps: np.ndarray) -> dict[str, np.ndarray]:
    """Where transfers fail, as masks (V): sizes are shares of a unit that is 1 m on a person of 1.8 m or so."""
    x, y = positions[:, 0], positions[:, 1]
    unit = abs(joints["head"][1] - min(joints["foot_l"][1], joints["foot_r"][1])) / 1.45
    near = lambda point, radius: np.linalg.norm(positions - point, axis=1) < radius * unit  # noqa: E731
    down = lambda share: np.array([0, -share * unit, 0])  # noqa: E731
    hip, half_width = (joints["leg_l"] + joints["leg_r"]) / 2, abs(joints["leg_l"][0] - joints["leg_r"][0]) / 2
    between = (y < hip[1] - 0.1 * unit) & (abs(x - hip[0]) < 0.45 * half_width) & (y > joints["foot_l"][1] - 0.05)
    return {
        "armpit": near(joints["arm_l"] + down(0.06), 0.13) | near(joints["arm_r"] + down(0.06), 0.13),
        "crotch": near(hip + down(0.08), 0.14),
        "between_legs": between,
        "collar": near(joints["neck"], 0.14) & (y > joints["neck"][1] - 0.05 * unit),
        "loose": gaps > 0.03 * unit,
    }


def vertex_normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Area-weighted, unit length (V, 3)."""
    corners = positions[triangles]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = triangles.ravel()
    normals = np.stack([np.bincount(flat, np.repeat(faces[:, k], 3), len(positions)) for k in range(3)], axis=1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(lengths > 0, lengths, 1)


def read_cases(folder: Path, pattern: str = "") -> list[Case]:
    """Every garment of cases.json whose name contains `pattern`."""
    poses, bodies, found = Poses.read(folder), {}, []
    for entry in json.loads((folder / "cases.json").read_text()):
        if pattern in entry["id"]:
            if entry["body"] not in bodies:
                bodies[entry["body"]] = _body(folder, poses, entry)
            found += _garments(folder, bodies[entry["body"]], entry)
    return found


def _body(folder: Path, poses: Poses, entry: dict[str, Any]) -> Body:
    file = File(folder / entry["body"])
    skeleton = file.skeleton()
    joints = {name: skeleton.heads[bone] for name, bone in poses.joints(skeleton, entry["rig"]).items()}
    mesh = joined([welded(mesh) for mesh in file.meshes()])
    return Body(entry["body"], entry["rig"], skeleton, mesh, joints, poses.pose_from_rest(skeleton, entry["rig"]))


def _garments(folder: Path, body: Body, entry: dict[str, Any]) -> list[Case]:
    file = File(folder / entry["garment"])
    meshes = [mesh for mesh in file.meshes() if mesh.name == entry.get("mesh", mesh.name)]
    found = []
    for mesh in meshes:
        one, artist = welded(mesh), None
        if entry["reference"] != "none":
            names = file.skeleton().names
            assert one.weights is not None  # a reference is a garment with weights
            artist = one.weights[:, [names.index(name) for name in body.skeleton.names]].toarray()
            artist /= np.maximum(artist.sum(axis=1, keepdims=True), 1e-12)
        name = entry["id"] if len(meshes) == 1 else f"{entry['id']}:{mesh.name}"
        found.append(Case(name, entry["reference"], body, one, mesh, artist))
    return found
