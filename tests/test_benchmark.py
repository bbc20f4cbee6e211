"""The benchmark's meshes are what it says they are, and its peers solve the same problem as we do."""

import igl
import meshes
import numpy as np
import peers
import pytest


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    meshes.CACHE = tmp_path_factory.mktemp("meshes")
    return meshes.load("source")


@pytest.fixture(scope="module")
def garment(source):
    return meshes.load("5k")


def test_the_body_has_its_size_and_its_bones(source):
    assert len(source.positions) == 10_682
    assert (source.weights > 0).any(axis=0).sum() == 60
    np.testing.assert_allclose(source.weights.sum(axis=1), 1, atol=1e-6)


def test_two_fifths_of_the_garment_find_no_match(source, garment):
    assert 0.37 < 1 - peers.match(source, garment).matched.mean() < 0.43


@pytest.mark.parametrize(
    ("smoothness", "expected"), [(1, 1 / 28), (np.sqrt(2), 1 / 52)], ids=["as in C++", "as in Python"]
)
def test_the_peers_energy_solves_the_fixture_of_four_vertices(smoothness, expected):
    square = meshes.Mesh(
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32), np.array([[0, 1, 2], [1, 2, 3]], np.uint32)
    )
    known = np.array([[1, 0], [0, 1], [0.5, 0.5]])
    row = peers.energy(square, smoothness)[3].toarray()[0]
    np.testing.assert_allclose(-(row[:3] @ known) / row[3], [expected, 1 - expected], atol=1e-12)


@pytest.mark.parametrize("passes", [0, 10])
def test_the_native_transfer_gives_the_answer_of_the_libigl_pipeline(native, source, garment, passes):
    expected, matched = peers.transfer(source, garment, passes)
    result = native.transfer_weights(
        source.positions,
        source.triangles,
        native.Weights.from_dense(source.weights),
        garment.positions,
        garment.triangles,
        smoothing_iterations=passes,
    )
    np.testing.assert_array_equal(result.matched, matched)
    np.testing.assert_allclose(result.weights.to_dense(), expected, atol=1e-6)


def test_the_one_component_system_is_that_of_libigls_fixed_boundary(garment):
    matrix, right, interior = peers.one_component(garment, 0.1)
    boundary = np.setdiff1d(np.arange(len(garment.positions)), interior)
    known = np.eye(60)[boundary % 60]
    energy, zeros = peers.energy(garment, 0.1), np.zeros((len(garment.positions), 60))
    expected = igl.min_quad_with_fixed(energy, zeros, boundary, known, energy[:0], zeros[:0], True)
    np.testing.assert_allclose(peers.superlu(matrix, right), expected[interior], atol=1e-9)
