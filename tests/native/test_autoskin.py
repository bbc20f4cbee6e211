"""Automatic weights through the native module: against SciPy's solution of the same equation, and on real files."""

import os
from pathlib import Path

import glb
import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as sla
import skinwright_native as native
from doll import cylinder

ROOT = Path(__file__).resolve().parents[2]
METHODS = ("heat", "geodesic", "euclidean")


def chain(bones: int = 4, height: float = 4.0) -> tuple[np.ndarray, np.ndarray]:
    joints = np.column_stack([np.zeros((bones + 1, 2)), np.linspace(0, height, bones + 1)])
    return np.stack([joints[:-1], joints[1:]], axis=1), np.arange(bones) - 1


def assert_sound(result: native.AutoWeights) -> None:
    weights = result.weights
    sums = np.add.reduceat(weights.values, weights.indptr[:-1].astype(np.int64))
    assert np.diff(weights.indptr.astype(np.int64)).min() > 0
    assert np.abs(sums - 1).max() < 1e-5
    assert weights.values.min() > 0
    assert result.report["unweighted"] == 0


def cotangent_stiffness(positions: np.ndarray, triangles: np.ndarray) -> tuple[sp.csr_matrix, np.ndarray]:
    """Half cotangents, clamped as documented, and mixed Voronoi areas, in plain NumPy."""
    points, count = positions.astype(float)[triangles], len(positions)
    rows, columns, values, mass = [], [], [], np.zeros(count)
    cotangents = np.zeros((len(triangles), 3))
    for k in range(3):
        u, v = points[:, (k + 1) % 3] - points[:, k], points[:, (k + 2) % 3] - points[:, k]
        cotangents[:, k] = (u * v).sum(1) / np.linalg.norm(np.cross(u, v), axis=1)
    area = 0.5 * np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=1)
    obtuse = (cotangents < 0).any(axis=1)
    for k in range(3):
        i, j = triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3]
        rows += [i, j]
        columns += [j, i]
        values += [0.5 * cotangents[:, k]] * 2
        a, b = (k + 1) % 3, (k + 2) % 3
        to_a = ((points[:, a] - points[:, k]) ** 2).sum(1)
        to_b = ((points[:, b] - points[:, k]) ** 2).sum(1)
        voronoi = (to_a * cotangents[:, b] + to_b * cotangents[:, a]) / 8
        mixed = np.where(cotangents[:, k] < 0, area / 2, area / 4)
        np.add.at(mass, triangles[:, k], np.where(obtuse, mixed, voronoi))
    weights = sp.coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))).tocsr()
    median = np.median(np.abs(weights.data))
    weights.data = np.clip(weights.data, 1e-3 * median, 1e3 * median)
    return sp.diags(np.asarray(weights.sum(1)).ravel()) - weights, mass


def test_heat_is_the_solution_of_its_equation():
    """In a convex body every way is straight, so that the distances are those of elementary geometry."""
    positions, triangles = cylinder()
    segments, parents = chain()
    points = positions.astype(float)
    below = np.clip(points[:, None, 2], segments[:, 0, 2], segments[:, 1, 2])
    closest = np.concatenate([np.zeros((*below.shape, 2)), below[..., None]], axis=2)
    offset = points[:, None] - closest
    distance = np.linalg.norm(offset, axis=2)
    corners = points[triangles]
    normals = np.zeros_like(points)
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for k in range(3):
        np.add.at(normals, triangles[:, k], face)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cosine = np.einsum("vbk,vk->vb", offset / np.maximum(distance, 1e-300)[..., None], normals)
    half = 0.5 * (1 + cosine)
    effective = distance / (0.15 + 0.425 * (half**2 + (half**2 * (3 - 2 * half)) ** 3))
    nearest = effective.min(axis=1)
    least = 1e-4 * np.linalg.norm(np.ptp(points, axis=0))
    near = (effective <= 1.003 * nearest[:, None]).astype(float)
    stiffness, mass = cotangent_stiffness(positions, triangles)
    heat = mass * 5.0 / np.maximum(nearest, least) ** 2
    matrix = stiffness + sp.diags(near.sum(axis=1) * heat)
    expected = sla.spsolve(matrix.tocsc(), heat[:, None] * near)
    expected = np.where(expected < 0.025, 0, np.where(expected < 0.05, 2 * (expected - 0.025), expected))
    expected /= expected.sum(axis=1, keepdims=True)

    result = native.automatic_weights(positions, triangles, segments, parents)
    off = 0.5 * np.abs(result.weights.to_dense() - expected).sum(axis=1)
    # On the very ends both sides of a tie are right.
    assert np.percentile(off, 98) < 1e-3
    assert off.max() < 0.05
    assert result.report["residual"] < 1e-12


@pytest.mark.parametrize("method", METHODS)
def test_threads_change_nothing_and_every_row_is_sound(method):
    positions, triangles = cylinder()
    one, many = (
        native.automatic_weights(positions, triangles, *chain(), method=method, threads=threads) for threads in (1, 3)
    )
    assert_sound(one)
    assert np.array_equal(one.weights.values, many.weights.values)
    assert np.array_equal(one.weights.bones, many.weights.bones)


def test_a_job_returns_the_same_and_can_be_cancelled():
    positions, triangles = cylinder()
    job = native.start_automatic_weights(positions, triangles, *chain())
    once = native.automatic_weights(positions, triangles, *chain())
    assert np.array_equal(job.result().weights.values, once.weights.values)
    assert job.progress == 1
    cancelled = native.start_automatic_weights(*(cylinder(120, 400)), *chain(), resolution=400)
    assert not cancelled.wait(0)
    cancelled.cancel()
    assert cancelled.wait(60)
    with pytest.raises(native.Cancelled):
        cancelled.result()


@pytest.mark.parametrize(
    "change, sentence",
    [
        (lambda segments, parents: (segments[:0], parents[:0]), "no bones"),
        (lambda segments, parents: (segments[:, [0, 0]], parents), "no length"),
        (lambda segments, parents: (segments + 99, parents), "outside"),
        (lambda segments, parents: (segments * np.nan, parents), "not finite"),
        (lambda segments, parents: (segments, parents[1:]), "parents"),
        (lambda segments, parents: (segments, np.roll(np.arange(len(parents)), 1)), "circle"),
    ],
)
def test_refusals_are_sentences(change, sentence):
    with pytest.raises(native.InvalidParameter, match=sentence):
        native.automatic_weights(*cylinder(), *change(*chain()))


def test_unknown_methods_are_named():
    with pytest.raises(native.InvalidParameter, match="heat, geodesic, euclidean"):
        native.automatic_weights(*cylinder(), *chain(), method="magic")


def bones_of(mesh: glb.SkinnedMesh) -> tuple[np.ndarray, np.ndarray]:
    """A bone for each that is painted, from the middle of its vertices a little way up: enough to ask for weights."""
    weights = mesh.weights.toarray()
    middles = (weights.T @ mesh.positions) / np.maximum(weights.sum(axis=0), 1e-9)[:, None]
    middles = middles[weights.sum(axis=0) > 0]
    size = 0.02 * np.ptp(mesh.positions, axis=0).max()
    return np.stack([middles, middles + np.array([0, size, 0])], axis=1), np.full(len(middles), -1)


def files() -> list[str]:
    """Every file of the shared data, or none."""
    folder = Path(os.environ.get("SKINWRIGHT_DATA", ROOT.parent / "shared" / "data"))
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*.glb"))


@pytest.mark.parametrize("file", files())
def test_every_vertex_of_real_files_gets_weights(file):
    """Bodies of many islands, overlapping parts, garments; and each as a soup of triangles that share no vertex."""
    meshes = [mesh for mesh in glb.read_meshes(glb.data_folder() / file) if mesh.weights is not None]
    if not meshes:
        pytest.skip(f"{file} has no skinned mesh")
    mesh = glb.joined(meshes)
    segments, parents = bones_of(mesh)
    found = {}
    for method in METHODS:
        found[method] = native.automatic_weights(
            mesh.positions, mesh.triangles, segments, parents, method=method, resolution=64
        )
        assert_sound(found[method])
    corners = mesh.triangles.ravel()
    soup = native.automatic_weights(
        mesh.positions[corners], np.arange(len(corners)).reshape(-1, 3), segments, parents, resolution=64
    )
    assert_sound(soup)
    used = np.unique(corners)
    if len(np.unique(mesh.positions, axis=0)) == len(mesh.positions) == len(used):
        off = 0.5 * np.abs(soup.weights.to_dense() - found["heat"].weights.to_dense()[corners]).sum(axis=1)
        assert np.percentile(off, 99) < 1e-3


def test_triangles_at_random_get_weights():
    """A soup that is no surface at all: shards in and around the bones."""
    random = np.random.default_rng(3)
    middles = random.uniform([-0.6, -0.6, 0], [0.6, 0.6, 4], (400, 1, 3))
    positions = (middles + random.normal(0, 0.08, (400, 3, 3))).reshape(-1, 3).astype(np.float32)
    triangles = np.arange(1200).reshape(-1, 3)
    for method in METHODS:
        assert_sound(native.automatic_weights(positions, triangles, *chain(), method=method, resolution=48))
