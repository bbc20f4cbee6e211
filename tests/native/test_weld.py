"""Borders that exist only in the file: a mesh that is cut apart gets what the whole one gets, to the bit."""

import numpy as np
import pytest
import skinwright_native as native
from test_fill import sheet, split

POLICIES = ["bridge", "nearest", "rigid", "skip"]


def body():
    positions, triangles = sheet(21)
    at = np.clip(positions[:, 0], 0, 1)[:, None] * 4
    rows = np.maximum(0, 1 - np.abs(at - np.arange(5))).astype(np.float32) + np.float32(1e-6)
    return positions, triangles, native.Weights.from_dense(rows)


def garment():
    """A sheet that leaves the body, with buttons above it."""
    positions, triangles = sheet(24, seed=7)
    positions[:, 2] += np.where(positions[:, 0] > 0.5, (positions[:, 0] - 0.5) * 1.5, 0.01).astype(np.float32)
    button, faces = sheet(3)
    for k, height in enumerate((0.5, 0.52, 1.5)):
        faces_of_button = faces + np.uint32(len(positions))
        positions = np.vstack([positions, button * 0.05 + np.float32([0.3 + 0.2 * k, 0.4, height])])
        triangles = np.vstack([triangles, faces_of_button])
    return positions, triangles


def seams(positions, triangles, columns):
    """Cut at these x: vertices there are doubled. The first copy of each keeps its place in the order."""
    panel = np.searchsorted(columns, positions[triangles].mean(axis=1)[:, 0])
    corner = np.stack([triangles.ravel(), np.repeat(panel, 3)], axis=1)
    kept, place = np.unique(corner, axis=0, return_inverse=True)
    first = np.searchsorted(kept[:, 0], kept[:, 0])
    return positions[kept[:, 0]], place.reshape(-1, 3).astype(np.uint32), first.astype(np.uint32)


CUTS = {
    "panels": lambda p, t: seams(p, t, [0.3, 0.6]),
    "many panels": lambda p, t: seams(p, t, np.linspace(0.05, 0.95, 12)),
    "flat shaded": split,
}
SETTINGS = [
    {},
    {"smoothing_iterations": 5},
    {"max_influences": 2, "smoothing_iterations": 2},
    {"smoothness_length": 0.0},
    {"match_flipped_normals": False, "max_distance": 0.03},
] + [{"island_policy": policy, "max_distance": 0.05} for policy in POLICIES]


def same(found, whole, old):
    """Rows of the cut mesh against those of the whole one, bit by bit."""
    assert np.array_equal(found.to_dense(), whole.to_dense()[old])
    counts = np.diff(whole.indptr)[old]
    assert np.array_equal(np.diff(found.indptr), counts)


@pytest.mark.parametrize("cut", CUTS)
@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_a_cut_garment_gets_the_bits_of_the_whole_one(cut, settings):
    source = native.Source(*body())
    positions, triangles = garment()
    apart, faces, first = CUTS[cut](positions, triangles)
    old = np.unique(first, return_inverse=True)[1].ravel()
    rng = np.random.default_rng(3)
    for mask in (None, rng.choice([0, 1, 2], len(positions), p=[0.2, 0.7, 0.1]).astype(np.uint8)):
        whole = source.transfer(positions, triangles, mask=mask, **settings)
        found = source.transfer(apart, faces, mask=None if mask is None else mask[old], **settings)
        same(found.weights, whole.weights, old)
        assert np.array_equal(found.matched, whole.matched[old])
        assert np.array_equal(found.distance, whole.distance[old])
        assert np.array_equal(found.angle, whole.angle[old], equal_nan=True)
        report, expected = found.report, whole.report
        assert report["islands"] == expected["islands"] and report["blocks"] == expected["blocks"]
        assert report["welded"] == len(apart) - len(positions) and expected["welded"] == 0
        assert report["matched"] == found.matched.sum() and report["vertices"] == len(apart)
        islands = [{**island, "vertices": 0, "first_vertex": 0} for island in report["unmatched_islands"]]
        assert islands == [{**island, "vertices": 0, "first_vertex": 0} for island in expected["unmatched_islands"]]
        for island in report["unmatched_islands"]:
            members = np.flatnonzero(
                native.Inpainting(source, apart, faces).islands
                == native.Inpainting(source, apart, faces).islands[island["first_vertex"]]
            )
            assert island["vertices"] == len(members) and island["first_vertex"] == members[0]


def test_without_a_weld_the_cut_opens():
    source = native.Source(*body())
    apart, faces, first = seams(*garment(), [0.6])
    rows = source.transfer(apart, faces, relative_weld_tolerance=0.0).weights.to_dense()
    assert np.abs(rows - rows[first]).max() > 0.01
    prepared = native.Inpainting(source, apart, faces, relative_weld_tolerance=0.0)
    np.testing.assert_array_equal(prepared.solve(relative_weld_tolerance=0.0).weights.to_dense(), rows)
    # Another tolerance prepares it again.
    welded = prepared.solve().weights.to_dense()
    assert np.array_equal(welded, welded[first])
    np.testing.assert_array_equal(welded, source.transfer(apart, faces).weights.to_dense())


@pytest.mark.parametrize("offset", [0.4, 0.9, 3.0])
def test_the_tolerance_is_a_length(offset):
    """Copies nearer than the tolerance are one, others are not, whatever cell of a grid they fall into."""
    positions, triangles = sheet(12)
    apart, faces, first = split(positions, triangles)
    diagonal = np.linalg.norm(np.ptp(positions.astype(float), axis=0))
    direction = np.random.default_rng(1).normal(size=apart.shape)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    tolerance = 1e-4
    is_copy = first != np.arange(len(first))
    moved = apart + (offset * tolerance * diagonal * direction * is_copy[:, None]).astype(np.float32)
    source = native.Source(*body())
    report = source.transfer(moved, faces, relative_weld_tolerance=tolerance, max_distance=1.0).report
    distances = np.linalg.norm((moved - moved[first]).astype(float), axis=1)[is_copy] / diagonal
    if offset < 1:
        assert (distances < tolerance).all() and report["welded"] == is_copy.sum()
    else:
        assert (distances > tolerance).all() and report["welded"] < is_copy.sum() / 4


def test_many_coincident_vertices_are_welded_at_once():
    """20,000 vertices at three places: a comparison of all with all would not end."""
    source = native.Source(*body())
    positions, triangles = garment()
    heap = np.repeat(np.float32([[0.1, 0.1, 0.3], [0.2, 0.1, 0.3], [0.1, 0.2, 0.3]]), 20_000, axis=0)
    faces = np.arange(20_000)[:, None] + [0, 20_000, 40_000] + len(positions)
    report = source.transfer(np.vstack([positions, heap]), np.vstack([triangles, faces])).report
    assert report["welded"] == 60_000 - 3


def test_a_double_sided_card_keeps_its_normal():
    """Two sheets with the same corners, facing opposite ways, whose normals cancel once they are one."""
    source = native.Source(*body())
    card, faces = sheet(15)
    card[:, 2] += 0.005
    twice = np.vstack([card, card])
    both = np.vstack([faces, faces[:, ::-1] + np.uint32(len(card))])
    for settings in ({}, {"match_flipped_normals": False}):
        whole = source.transfer(card, faces, **settings)
        found = source.transfer(twice, both, **settings)
        assert whole.matched.all() and found.matched.all()
        np.testing.assert_allclose(found.weights.to_dense(), np.tile(whole.weights.to_dense(), (2, 1)), atol=1e-7)
        assert found.report["unmatched_islands"] == []
    # The same faces on shared vertices.
    shared = source.transfer(card, np.vstack([faces, faces[:, ::-1]]))
    assert shared.matched.all()
    # Quads that are cut along the other diagonal on their back.
    n = 15
    corner = (np.arange(n - 1)[None] + n * np.arange(n - 1)[:, None]).ravel()
    back = np.vstack(
        [np.stack([corner, corner + n, corner + 1], 1), np.stack([corner + 1, corner + n, corner + n + 1], 1)]
    )
    other = source.transfer(twice, np.vstack([faces, back + len(card)]))
    assert other.matched.mean() > 0.7 and (np.diff(other.weights.indptr) > 0).all()


def test_the_source_may_be_cut_too():
    """Split normals of a body do not turn matches away."""
    positions, triangles, weights = body()
    apart, faces, first = split(positions, triangles)
    old = np.unique(first, return_inverse=True)[1].ravel()
    dense = weights.to_dense()[old]
    whole = native.Source(positions, triangles, weights).transfer(*garment())
    found = native.Source(apart, faces, native.Weights.from_dense(dense)).transfer(*garment())
    assert np.array_equal(found.matched, whole.matched)
    np.testing.assert_allclose(found.angle, whole.angle, atol=1e-6)
    np.testing.assert_allclose(found.weights.to_dense(), whole.weights.to_dense(), atol=1e-6)


def test_a_mask_that_differs_between_copies():
    source = native.Source(*body())
    positions, triangles = garment()
    apart, faces, first = seams(positions, triangles, [0.6])
    copies = np.flatnonzero(first != np.arange(len(first)))
    forced, forbidden = np.ones(len(apart), np.uint8), np.ones(len(apart), np.uint8)
    forced[copies], forced[first[copies]] = 2, 0
    forbidden[copies] = 0
    assert source.transfer(apart, faces, mask=forced).matched[np.r_[copies, first[copies]]].all()
    assert not source.transfer(apart, faces, mask=forbidden).matched[np.r_[copies, first[copies]]].any()
