"""scene.orientation: which parts of a mesh are inside out."""

import figure
import numpy as np
import pytest
from scipy import sparse
from scipy.sparse import csgraph


@pytest.fixture
def outward(addon, scene):
    return addon.scene.orientation.outward


def triangles_of(quads):
    return np.array([t for q in quads for t in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))], np.uint32)


def tubes(*shapes):
    """Positions, triangles and each triangle's tube."""
    positions, quads = figure.joined(*shapes)
    counts = [2 * len(faces) for _, faces in shapes]
    return positions.astype(np.float32), triangles_of(quads), np.repeat(np.arange(len(shapes)), counts)


LEGS = [figure.tube(0.12, 0, 1.0, 0.1), figure.tube(-0.12, 0, 1.0, 0.1)]


@pytest.mark.parametrize("turned", [[], [0], [1], [0, 1]])
def test_each_part_is_turned_by_itself(outward, turned):
    positions, triangles, part = tubes(*LEGS)
    spoilt = np.where(np.isin(part, turned)[:, None], triangles[:, ::-1], triangles)
    np.testing.assert_array_equal(outward(positions, spoilt), triangles)


@pytest.mark.parametrize("turned", [False, True])
def test_a_lining_looks_inward_and_is_turned_with_what_it_lines(outward, turned):
    positions, triangles, part = tubes(figure.tube(0, 0, 1.0, 0.3), figure.tube(0, 0.1, 0.9, 0.29))
    triangles = np.where((part == 1)[:, None], triangles[:, ::-1], triangles)
    given = triangles[:, ::-1] if turned else triangles
    np.testing.assert_array_equal(outward(positions, np.ascontiguousarray(given)), triangles)


def test_seams_do_not_make_parts(outward):
    """Every face has vertices of its own, as with flat shading."""
    positions, triangles, _ = tubes(LEGS[0])
    split, alone = positions[triangles].reshape(-1, 3), np.arange(3 * len(triangles), dtype=np.uint32).reshape(-1, 3)
    np.testing.assert_array_equal(outward(split, alone[:, ::-1]), alone)


def test_what_has_no_inside_stays(outward):
    x, y = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9))
    number = np.arange(81).reshape(9, 9)
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    for bulge in (0.0, 0.3, -0.3):
        patch = np.stack([x.ravel(), y.ravel(), bulge * (x**2 + y**2).ravel()], axis=1).astype(np.float32)
        triangles = triangles_of(quads.tolist())
        np.testing.assert_array_equal(outward(patch, triangles), triangles)
        both = np.concatenate([triangles, triangles[:, ::-1]])  # a card that is seen from both sides
        np.testing.assert_array_equal(outward(patch, both), both)
    assert outward(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32)).size == 0


@pytest.mark.parametrize("n_faces", [0, 300, 3000])
def test_what_faces_connect_is_what_scipy_says(addon, n_faces):
    rng = np.random.default_rng(n_faces)
    triangles = rng.integers(0, 2000, (n_faces, 3)).astype(np.uint32)
    place = rng.permutation(2000) // 2  # two vertices at each place
    found = addon.scene.places.connected(place, triangles)
    ends = place[np.concatenate([triangles[:, :2], triangles[:, 1:]])].reshape(-1, 2).T
    graph = sparse.coo_array((np.ones(ends.shape[1]), ends), shape=(1000, 1000))
    expected = csgraph.connected_components(graph, directed=False)[1][place]
    assert len(set(zip(found.tolist(), expected.tolist(), strict=True))) == len(set(found.tolist()))
    assert len(set(found.tolist())) == len(set(expected.tolist()))
