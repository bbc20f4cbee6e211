"""Loose parts without a match: the order in which they hang, many of them, policies where nothing matches, wires."""

import contextlib
import time

import igl
import numpy as np
import pytest
import skinwright_native as native
from test_fill import sheet
from test_weld import body

POLICIES = ["bridge", "nearest", "rigid", "skip"]


def loose_parts(count: int, seed: int, height: float) -> tuple[np.ndarray, np.ndarray]:
    """A sheet on the body and small triangles, some of them rows of a strip, over it."""
    positions, triangles = sheet(8)
    positions[:, 2] += 0.005
    rng = np.random.default_rng(seed)
    corners = (rng.random((count, 1, 3)) + [0, 0, height] + rng.random((count, 3, 3)) * 0.03).reshape(-1, 3)
    faces = np.arange(3 * count).reshape(-1, 3) + len(positions)
    strip, strip_faces = sheet(6)
    strip = strip * np.float32([1, 0.02, 0]) + np.float32([0, 0.5, height / 2])
    start = len(positions) + len(corners)
    return (
        np.vstack([positions, corners, strip]).astype(np.float32),
        np.vstack([triangles, faces, strip_faces + np.uint32(start)]).astype(np.uint32),
    )


def prim(positions, triangles, island, is_solved, rows):
    """Squared gap and row of every island: always the one with the smallest gap to what has a row is next."""
    positions = positions.astype(float)
    faces_of = lambda k: triangles[np.isin(island[triangles[:, 0]], k)].astype(np.int64)  # noqa: E731
    waiting = sorted(set(island.tolist()) - set(np.flatnonzero(is_solved).tolist()))
    members = {k: np.flatnonzero(island == k) for k in waiting}

    def gap(k, faces):
        squared, face, at = igl.point_mesh_squared_distance(positions[members[k]], positions, faces)
        best = squared.argmin()
        return squared[best], faces[face[best]], at[best]

    best = {}
    for k in waiting:
        squared, face, at = gap(k, faces_of(np.flatnonzero(is_solved)))
        corners = [np.ascontiguousarray(positions[i][None]) for i in face]
        best[k] = squared, igl.barycentric_coordinates(np.ascontiguousarray(at[None]), *corners)[0] @ rows[face]
    answer = {}
    while best:
        k = min(best, key=lambda k: (best[k][0], k))
        answer[k] = best.pop(k)
        for other in best:
            squared, _, _ = gap(other, faces_of([k]))
            if squared < best[other][0]:
                best[other] = squared, rows[members[k][0]]
    return answer


@pytest.mark.parametrize(("count", "height"), [(60, 0.3), (60, 2.0), (150, 0.05)])
def test_parts_hang_as_prims_algorithm_says(count, height):
    source = native.Source(*body())
    positions, triangles = loose_parts(count, count, height)
    # Out of reach of the body, so that the garment counts.
    settings = {"max_distance": 0.02, "mask": (np.arange(len(positions)) < 64).astype(np.uint8) * 2}
    result = source.transfer(positions, triangles, **settings)
    island = native.Inpainting(source, positions, triangles).islands
    rows = result.weights.to_dense().astype(float)
    is_solved = np.zeros(island.max() + 1, bool)
    is_solved[0] = True
    body_distance = np.array([result.distance[island == k].min() for k in range(len(is_solved))])
    of_garment = 0
    for k, (squared, row) in prim(positions, triangles, island, is_solved, rows).items():
        members = np.flatnonzero(island == k)
        assert (rows[members] == rows[members[0]]).all()
        # Where the garment is out of reach and the body nearer, the body counts, and what hangs there differs too.
        if squared**0.5 <= settings["max_distance"] or body_distance[k] >= squared**0.5:
            of_garment += 1
            assert np.abs(rows[members[0]] - row).max() < 1e-5
    assert of_garment > 0


def test_a_chain_of_beads_ends_in_its_first_row():
    """Each bead hangs on the one before; the sequins at its end on the last one."""
    source = native.Source(*body())
    positions, triangles = sheet(8)
    positions[:, 2] += 0.005
    beads = np.linspace(0, 4, 400)[:, None] * [0, 0, 1] + [0.5, 0.5, 0.5]
    rng = np.random.default_rng(0)
    sequins = rng.random((400, 3)) * [1, 1, 0.2] + [0, 0, 4.6]
    centres = np.vstack([beads, sequins])[:, None]
    corners = (centres + rng.random((800, 3, 3)) * 1e-3).reshape(-1, 3)
    all_positions = np.vstack([positions, corners]).astype(np.float32)
    faces = np.vstack([triangles, len(positions) + np.arange(2400).reshape(-1, 3)])
    mask = (np.arange(len(all_positions)) < 64).astype(np.uint8) * 2
    result = source.transfer(all_positions, faces, mask=mask, max_distance=10.0)
    rows = result.weights.to_dense()[len(positions) :]
    # A row that is handed on is normalised again for each.
    np.testing.assert_allclose(rows, np.tile(rows[0], (len(rows), 1)), atol=1e-6)
    assert len(result.report["unmatched_islands"]) == 800


@pytest.mark.parametrize("policy", POLICIES)
def test_thousands_of_parts_and_cancelling_them(policy):
    source = native.Source(*body())
    positions, triangles = loose_parts(20_000, 1, 2.0)
    mask = (np.arange(len(positions)) < 64).astype(np.uint8) * 2
    prepared = native.Inpainting(source, positions, triangles)
    result = prepared.solve(mask=mask, max_distance=0.05, island_policy=policy)
    assert len(result.report["unmatched_islands"]) == 20_001
    job = prepared.start(mask=mask, max_distance=0.05, island_policy=policy)
    time.sleep(0.02)
    job.cancel()
    with contextlib.suppress(native.Cancelled):
        job.result()
    again = prepared.solve(mask=mask, max_distance=0.05, island_policy=policy)
    np.testing.assert_array_equal(again.weights.values, result.weights.values)


def test_one_button_on_a_large_garment_hangs_where_it_hung():
    """The few triangles that can be nearest give the row that all of them give."""
    source = native.Source(*body())
    positions, triangles = sheet(120)
    positions[:, 2] += 0.005
    button = np.float32([[0.3, 0.4, 0.2], [0.31, 0.4, 0.2], [0.3, 0.41, 0.2]])
    both = np.vstack([positions, button])
    faces = np.vstack([triangles, [[len(positions), len(positions) + 1, len(positions) + 2]]])
    mask = np.r_[np.full(len(positions), 2), np.zeros(3)]
    result = source.transfer(both, faces, mask=mask, max_distance=10.0)
    rows = result.weights.to_dense().astype(float)
    squared, face, at = igl.point_mesh_squared_distance(
        button.astype(float), positions.astype(float), triangles.astype(np.int64)
    )
    best = squared.argmin()
    corners = triangles[face[best]]
    share = igl.barycentric_coordinates(
        np.ascontiguousarray(at[best][None]), *[np.ascontiguousarray(positions[i].astype(float)[None]) for i in corners]
    )[0]
    np.testing.assert_allclose(rows[-3:], np.tile(share @ rows[corners], (3, 1)), atol=1e-6)


@pytest.mark.parametrize("policy", POLICIES)
def test_policies_answer_where_nothing_matches(policy):
    source = native.Source(*body())
    holster, faces = sheet(6)
    holster = holster * np.float32(0.1) + np.float32([0.4, 0.4, 0.5])
    if policy == "skip":
        with pytest.raises(native.NothingMatched, match="distance now in force"):
            source.transfer(holster, faces, island_policy=policy)
        return
    result = source.transfer(holster, faces, island_policy=policy)
    assert not result.matched.any() and result.report["unmatched_islands"][0]["policy"] == policy
    rows = result.weights.to_dense()
    np.testing.assert_allclose(rows.sum(axis=1), 1, atol=1e-6)
    own = source.transfer(holster, faces, max_distance=10.0, max_normal_angle=3.1415).weights.to_dense()
    if policy == "nearest":
        np.testing.assert_allclose(rows, own, atol=1e-6)
    elif policy == "bridge":
        np.testing.assert_allclose(rows, np.tile(own[result.distance.argmin()], (36, 1)), atol=1e-6)
    with pytest.raises(native.NothingMatched):
        source.transfer(holster, faces, island_policy=policy, mask=np.zeros(36))
    with pytest.raises(native.NothingMatched):
        source.transfer(holster + 100, faces, island_policy=policy)


def test_the_distance_of_a_button_is_not_that_of_a_button():
    positions, triangles, weights = body()
    source = native.Source(positions, triangles, weights)
    diagonal = np.linalg.norm(np.ptp(positions.astype(float), axis=0))
    button, faces = sheet(5)
    button = button * np.float32(0.02) + np.float32([0.5, 0.5, 0.2])
    report = source.transfer(button, faces, island_policy="nearest").report
    np.testing.assert_allclose(report["max_distance"], 0.015 * diagonal, rtol=1e-6)
    large = source.transfer(positions, triangles).report["max_distance"]
    np.testing.assert_allclose(large, 0.05 * diagonal, rtol=1e-6)


def test_wires_get_weights_along_their_edges():
    """A strand that starts on the body: near vertices match, the others are filled along the edges."""
    source = native.Source(*body())
    count = 30
    strand = np.stack([np.full(count, 0.5), np.full(count, 0.5), np.linspace(0, 2, count)], axis=1)
    strand[:, 2] += 0.3 * np.sin(5 * 0.5)
    edges = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1)
    settings = {"max_distance": 0.2, "smoothness_length": 0.0}
    result = source.transfer(strand, np.zeros((0, 3)), target_edges=edges, **settings)
    rows = result.weights.to_dense()
    assert 0 < result.matched.sum() < count and result.report["islands"] == 1 and result.report["loose"] == 0
    last = np.flatnonzero(result.matched).max()
    np.testing.assert_allclose(rows[last:], np.tile(rows[last], (count - last, 1)), atol=1e-5)
    # Held at both ends, rows change linearly along the strand, whatever the lengths of its edges.
    strand[10:20, 2] += np.random.default_rng(0).uniform(-0.02, 0.02, 10)
    mask = np.zeros(count)
    mask[[0, -1]] = 2
    along = np.r_[0, np.cumsum(np.linalg.norm(np.diff(strand, axis=0), axis=1))]
    found = source.transfer(strand, np.zeros((0, 3)), target_edges=edges, mask=mask, **settings).weights.to_dense()
    expected = found[0] + (along / along[-1])[:, None] * (found[-1] - found[0])
    np.testing.assert_allclose(found, expected, atol=1e-5)
    # Edges of triangles count for nothing.
    card, faces = sheet(9)
    plain = source.transfer(card, faces, max_distance=0.01)
    with_edges = source.transfer(card, faces, target_edges=np.vstack([faces[:, :2], faces[:, 1:]]), max_distance=0.01)
    np.testing.assert_array_equal(plain.weights.values, with_edges.weights.values)
    with pytest.raises(native.InvalidMesh, match="edge 0 of the target mesh"):
        source.transfer(card, faces, target_edges=[[0, 999]])
