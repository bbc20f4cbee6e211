"""Refined skin where a limb meets a trunk."""

import numpy as np
import pytest
import skinwright_native as native


@pytest.fixture(scope="module")
def figure():
    """Positions, triangles and dense weights of a trunk 14 wide and 34 tall with an arm on one side, made of cubes."""
    solid = np.zeros((40, 12, 40), bool)
    solid[3:17, 2:10, 3:37] = True
    solid[17:37, 3:9, 27:33] = True
    faces = []
    for axis in range(3):
        for side in (0, 1):
            outside = ~np.roll(solid, -1 if side else 1, axis=axis)
            for cell in np.argwhere(solid & outside):
                corner = np.zeros((4, 3), int)
                b, c = (axis + 1) % 3, (axis + 2) % 3
                corner[:, axis] = side
                corner[1:3, b], corner[2:, c] = 1, 1
                faces.append((cell + corner)[:: 1 if side else -1])
    places, quads = np.unique(np.array(faces).reshape(-1, 3), axis=0, return_inverse=True)
    quads = quads.reshape(-1, 4)
    triangles = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.uint32)
    t = np.clip((places[:, 0] - 14) / 6, 0, 1) * (np.abs(places[:, 2] - 30) < 5)
    arm = t * t * (3 - 2 * t)
    weights = np.zeros((len(places), 3), np.float32)
    weights[:, 0], weights[:, 2] = 1 - arm, arm
    return places.astype(np.float32), triangles, weights


# Spine, collar bone, upper arm.
PARENTS = np.array([-1, 0, 1], np.int32)
SEGMENTS = np.array([[[10, 6, 3], [10, 6, 30]], [[10, 6, 30], [17, 6, 30]], [[17, 6, 30], [36, 6, 30]]], float)


def turned(degrees):
    """Matrices (3, 4, 4) that turn the arm down at the shoulder."""
    pose = np.tile(np.eye(4), (3, 1, 1))
    a, joint = np.radians(degrees), np.array([17.0, 6, 30])
    rotation = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    pose[2, :3, :3], pose[2, :3, 3] = rotation, joint - rotation @ joint
    return pose


@pytest.mark.parametrize("quality", ["live", "bake"])
@pytest.mark.parametrize("degrees", [-40, 40])
def test_a_shoulder_leaves_the_chest_where_it_is(figure, degrees, quality):
    places, triangles, weights = figure
    refiner = native.Refiner(places, triangles, native.Weights.from_dense(weights), PARENTS, SEGMENTS)
    moved = refiner.solve(turned(degrees), quality=quality)
    away = np.linalg.norm(places - [17, 6, 30], axis=1)
    chest = (weights[:, 2] == 0) & (away > 8)
    assert chest.sum() > 500
    assert np.abs(moved - places)[chest].max() < 0.5
    assert [joint["volume"] for joint in refiner.measure(turned(degrees), moved)["joints"]] == [None]
