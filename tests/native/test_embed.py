"""Embedding a skeleton: a figure built by hand, whose joints are known, and the character of another file."""

import numpy as np
import pytest
import skinwright_native as native
from doll import NAMES, PARENTS, figure, skeleton


@pytest.mark.parametrize("arm_length, lift", [(0.7, 0.0), (0.5, 0.0), (0.7, -0.4)])
def test_a_doll_takes_the_skeleton_of_another(arm_length, lift):
    """Shorter or lowered arms than the template's: every joint within 6 % of the height, and on its own side."""
    bones, positions_and_triangles = skeleton(), figure(arm_length, lift)
    # Where the template lies and how large it is does not matter.
    template = bones * 3 + [5, -2, 1]
    embedding = native.embed_skeleton(*positions_and_triangles, template[:, 0], template[:, 1], PARENTS)
    expected = skeleton(arm_length, lift)[:, 0]
    off = np.linalg.norm(embedding.heads - expected, axis=1) / 1.8
    assert embedding.report["symmetric"]
    assert off.max() < 0.06, dict(zip(NAMES, off.round(3), strict=True))
    assert embedding.heads[3, 0] > 0.03 and embedding.heads[5, 0] < -0.03
    assert np.allclose(embedding.heads[[3, 4, 7, 8]] * [-1, 1, 1], embedding.heads[[5, 6, 9, 10]], atol=1e-4)
    assert embedding.report["outside"] == []
    assert (embedding.confidence > 0).all() and (embedding.confidence <= 1).all()


def test_threads_change_nothing():
    bones, mesh = skeleton(), figure(0.6)
    one, many = (native.embed_skeleton(*mesh, bones[:, 0], bones[:, 1], PARENTS, threads=threads) for threads in (1, 3))
    assert np.array_equal(one.heads, many.heads) and np.array_equal(one.tails, many.tails)


def test_refusals_are_sentences():
    bones, mesh = skeleton(), figure()
    for parents, sentence in ((PARENTS[:-1], "parents"), (np.roll(np.arange(11), 1), "circle")):
        with pytest.raises(native.InvalidParameter, match=sentence):
            native.embed_skeleton(*mesh, bones[:, 0], bones[:, 1], parents)
    with pytest.raises(native.InvalidParameter, match="one point"):
        native.embed_skeleton(*mesh, bones[:, 0] * 0, bones[:, 1] * 0, PARENTS)


def test_a_job_can_be_cancelled():
    bones, mesh = skeleton(), figure()
    job = native.start_embed_skeleton(*mesh, bones[:, 0], bones[:, 1], PARENTS)
    assert np.array_equal(job.result().heads, native.embed_skeleton(*mesh, bones[:, 0], bones[:, 1], PARENTS).heads)
    job = native.start_embed_skeleton(*mesh, bones[:, 0], bones[:, 1], PARENTS)
    job.cancel()
    with pytest.raises(native.Cancelled):
        job.result()
