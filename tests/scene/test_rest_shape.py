"""scene.rest_shape: what a brush has moved, and putting it back bit for bit."""

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")


@pytest.fixture
def rest_shape(addon, scene):
    return addon.scene.rest_shape


def put(obj, positions):
    obj.data.attributes["position"].data.foreach_set("vector", positions.ravel())


def test_each_moved_vertex_is_found_once(rest_shape):
    obj = builders.grid("Body", 9)
    shape = rest_shape.read(obj)
    assert rest_shape.moved(obj, shape)[0].size == 0
    moved = {0: (1, 0, 0), 40: (0, -1e-7, 0), 41: (1, 2, 3), 80: (0, 0, 1)}
    positions = shape.positions.copy()
    for vertex, offset in moved.items():
        positions[vertex] += np.array(offset, np.float32)
    put(obj, positions)
    vertices, now = rest_shape.moved(obj, shape)
    assert vertices.tolist() == list(moved)
    assert np.array_equal(now, positions[list(moved)])


def test_bits_count(rest_shape):
    """A zero that changes its sign has to be put back; a position that is no number is no stroke without an end."""
    obj = builders.grid("Body", 3)
    positions = rest_shape.read(obj).positions
    positions[2, 1] = np.nan
    put(obj, positions)
    shape = rest_shape.read(obj)
    assert rest_shape.moved(obj, shape)[0].size == 0
    positions[5] = (*positions[5, :2], -0.0)
    put(obj, positions)
    assert rest_shape.moved(obj, shape)[0].tolist() == [5]
    rest_shape.restore(obj, shape)
    assert rest_shape.read(obj).positions.tobytes() == shape.positions.tobytes()
