"""Flipped normals: a vertex follows its own limb, and a lining the limb it lies on."""

import numpy as np
import pytest
import skinwright_native as native


def tube(x: float, radius: float, inward: bool = False, around: int = 48, along: int = 21):
    """A leg along z."""
    a, z = np.meshgrid(np.linspace(0, 2 * np.pi, around, endpoint=False), np.linspace(0, 1, along))
    positions = np.stack([x + radius * np.cos(a), radius * np.sin(a), z], axis=-1).reshape(-1, 3)
    k = np.arange(around * (along - 1))
    right = k // around * around + (k + 1) % around
    faces = np.vstack([np.stack([k, right, right + around], 1), np.stack([k, right + around, k + around], 1)])
    return positions, faces[:, ::-1] if inward else faces


def join(*meshes):
    starts = np.cumsum([0] + [len(p) for p, _ in meshes])
    return np.vstack([p for p, _ in meshes]), np.vstack([f + s for (_, f), s in zip(meshes, starts, strict=False)])


def legs(gap: float, radius: float = 0.1):
    """Two legs `gap` apart, a bone each."""
    c = radius + gap / 2
    positions, faces = join(tube(c, radius), tube(-c, radius))
    rows = np.repeat(np.eye(2, dtype=np.float32), len(positions) // 2, axis=0)
    return native.Source(positions, faces, native.Weights.from_dense(rows)), c


def wrong(source, c, *tubes, **settings):
    """How many vertices of garments (radius, inward) follow the other leg."""
    left = join(*[tube(c, radius, inward, 50, 31) for radius, inward in tubes])
    right = join(*[tube(-c, radius, inward, 50, 31) for radius, inward in tubes])
    rows = source.transfer(*join(left, right), max_distance=0.05, **settings).weights.to_dense()
    half = len(rows) // 2
    return int((rows[:half, 1] > 0.5).sum() + (rows[half:, 0] > 0.5).sum())


@pytest.mark.parametrize("gap", [0.0, 0.004, 0.01, 0.02])
@pytest.mark.parametrize("off", [0.003, 0.006, 0.009])
def test_trousers_follow_their_own_leg(gap, off):
    source, c = legs(gap)
    assert wrong(source, c, (0.1 + off, False)) == 0


@pytest.mark.parametrize("gap", [0.01, 0.03, 0.2])
def test_a_lining_follows_the_leg_it_lies_on(gap):
    """Trousers with an inner layer that faces the leg."""
    source, c = legs(gap)
    assert wrong(source, c, (0.102, True), (0.104, False)) == 0
    rows = source.transfer(*tube(c, 0.102, True), max_distance=0.05)
    assert rows.matched.all()
    assert not source.transfer(*tube(c, 0.102, True), max_distance=0.05, match_flipped_normals=False).matched.any()


def test_thresholds_may_change_after_preparing():
    source, c = legs(0.004)
    garment = join(tube(c, 0.106), tube(-c, 0.106))
    prepared = native.Inpainting(source, *garment, max_distance=0.05)
    for settings in (
        {"max_distance": 0.05, "max_normal_angle": 0.3},
        {"max_distance": 0.004},
        {"max_distance": 0.05, "match_flipped_normals": False},
        {"max_distance": 0.05},
    ):
        fresh = source.transfer(*garment, **settings)
        kept = prepared.solve(**settings)
        np.testing.assert_array_equal(kept.weights.values, fresh.weights.values)
        np.testing.assert_array_equal(kept.distance, fresh.distance)


@pytest.mark.parametrize("method", ["paper", "confidence"])
@pytest.mark.parametrize("flipped", [True, False])
def test_a_source_whose_faces_are_there_twice_is_the_same_source(method, flipped):
    """Once to each side, on the same vertices, as single-sided engines want it: no vertex loses its normal."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-1, 1, 6), np.linspace(-1, 1, 6)))
    positions, k = np.stack([x, y, 0 * x], 1), np.array([i * 6 + j for i in range(5) for j in range(5)])
    faces = np.vstack([np.stack([k, k + 1, k + 7], 1), np.stack([k, k + 7, k + 6], 1)])
    rows = native.Weights.from_dense(np.stack([(x + 1) / 2, (1 - x) / 2], 1).astype(np.float32))
    garment = positions * 0.9 + (0, 0, 0.02)
    found = []
    for triangles in (faces, np.vstack([faces, faces[:, ::-1]])):
        done = native.Source(positions, triangles, rows).transfer(
            garment, faces, method=method, match_flipped_normals=flipped
        )
        assert done.matched.all()
        found.append(done.weights.to_dense())
    np.testing.assert_array_equal(*found)
