"""Linear blend skinning against the formula in NumPy."""

import numpy as np
import pytest
import skinwright_native as native


def random_pose(rng: np.random.Generator, bones: int) -> np.ndarray:
    """(B, 4, 4) affine matrices, not only rigid ones."""
    pose = np.tile(np.eye(4), (bones, 1, 1))
    pose[:, :3] += rng.normal(scale=0.5, size=(bones, 3, 4))
    return pose


@pytest.mark.parametrize("total", [1.0, 0.3, 40.0])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_equals_the_formula(total, dtype):
    rng = np.random.default_rng(1)
    rest = rng.normal(size=(500, 3)).astype(np.float32)
    weights = rng.dirichlet(np.full(7, 0.3), 500).astype(np.float32) * np.float32(total)
    weights[::50] = 0
    pose = random_pose(rng, 7).astype(dtype)
    homogeneous = np.column_stack([rest, np.ones(500)])
    sums = weights.sum(axis=1, dtype=float, keepdims=True)
    expected = np.einsum("ib,bxy,iy->ix", weights / np.where(sums > 0, sums, 1), pose[:, :3].astype(float), homogeneous)
    expected[::50] = rest[::50]
    posed = native.linear_blend(rest, native.Weights.from_dense(weights), pose)
    assert posed.dtype == np.float32 and posed.shape == (500, 3)
    np.testing.assert_allclose(posed, expected, atol=2e-6)
    np.testing.assert_array_equal(posed, native.linear_blend(rest, native.Weights.from_dense(weights), pose, threads=1))


def test_refuses_what_does_not_fit():
    weights = native.Weights.from_dense(np.ones((2, 3)))
    pose = np.tile(np.eye(4), (3, 1, 1))
    with pytest.raises(native.InvalidParameter, match=r"rest_positions has 1 entries where 2 are needed"):
        native.linear_blend(np.zeros((1, 3)), weights, pose)
    with pytest.raises(native.InvalidParameter, match=r"pose_from_rest must have shape \(B, 4, 4\)"):
        native.linear_blend(np.zeros((2, 3)), weights, pose[:, :3])
    with pytest.raises(native.InvalidParameter, match="every bone matrix must be finite"):
        native.linear_blend(np.zeros((2, 3)), weights, pose * np.nan)
