"""Embedding a skeleton: a figure built by hand, whose joints are known, and the character of another file."""

import numpy as np
import pytest
import skinwright_native as native
from test_autoskin import cylinder


def limb(start: list[float], end: list[float], radius: float) -> tuple[np.ndarray, np.ndarray]:
    """A closed tube from one point to another."""
    positions, triangles = cylinder(16, 24)
    start, end = np.array(start, float), np.array(end, float)
    along = (end - start) / np.linalg.norm(end - start)
    aside = np.cross(along, [0, 1, 0] if abs(along[1]) < 0.9 else [1, 0, 0])
    aside /= np.linalg.norm(aside)
    frame = np.stack([aside, np.cross(along, aside), along])
    local = positions * [2 * radius, 2 * radius, np.linalg.norm(end - start) / 4]
    return start + local @ frame, triangles


def figure(arm_length: float = 0.7, lift: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A doll of overlapping closed tubes, Z up, facing -Y: as an artist blocks one out."""
    parts = [limb([0, 0, 0.9], [0, 0, 1.5], 0.14), limb([0, 0, 1.45], [0, 0, 1.8], 0.09)]
    for side in (1, -1):
        parts.append(limb([0, 0, 1.4], [side * (0.15 + arm_length), 0, 1.4 + lift], 0.05))
        parts.append(limb([side * 0.1, 0, 0.95], [side * 0.14, 0, 0.0], 0.07))
    positions, triangles, start = [], [], 0
    for part, faces in parts:
        positions.append(part)
        triangles.append(faces + start)
        start += len(part)
    return np.vstack(positions).astype(np.float32), np.vstack(triangles)


NAMES = ["hips", "spine", "head", "arm.L", "fore.L", "arm.R", "fore.R", "leg.L", "shin.L", "leg.R", "shin.R"]
PARENTS = np.array([-1, 0, 1, 1, 3, 1, 5, 0, 7, 0, 9])


def skeleton(arm_length: float = 0.7, lift: float = 0.0) -> np.ndarray:
    """Heads and tails (B, 2, 3) for the figure."""
    bones = {
        "hips": ([0, 0, 0.95], [0, 0, 1.1]),
        "spine": ([0, 0, 1.1], [0, 0, 1.4]),
        "head": ([0, 0, 1.45], [0, 0, 1.8]),
    }
    for name, side in (("L", 1), ("R", -1)):
        joint = lambda share, s=side: [s * (0.15 + share * arm_length), 0, 1.4 + lift * (0.15 + share) / 1.15]  # noqa: E731
        knee = lambda share, s=side: [s * (0.1 + 0.04 * share), 0, 0.95 - 0.95 * share]  # noqa: E731
        bones[f"arm.{name}"] = (joint(0), joint(0.5))
        bones[f"fore.{name}"] = (joint(0.5), joint(1))
        bones[f"leg.{name}"] = (knee(0.05), knee(0.5))
        bones[f"shin.{name}"] = (knee(0.5), knee(1))
    return np.array([bones[name] for name in NAMES])


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
