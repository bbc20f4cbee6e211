"""Raw weights on real garments equal an independent solver's ."""

import json

import numpy as np
import oracle
import pytest
import skinwright_native as native
from glb import data_folder, joined, read_meshes

THETA = np.radians(35)
GARMENTS = [
    "mh_female/helper_skirt",
    "mh_female/female_elegantsuit01",
    "mh_female/JeansSkirt",
    "mh_female/Sleeveless",
    "mh_female/F_Dress_03",
    "mh_male/male_casualsuit05",
    "mh_male/male_casualsuit04",
    "mh_male/male_worksuit01",
    "mh_male/shoes03",
    "q_female_peasant/Arms",
    "q_female_peasant/Body",
    "q_female_peasant/Legs",
    "q_male_peasant/Body",
    "q_male_peasant/Feet",
    "q_male_peasant/Legs",
    "qm_women/SciFi/SciFi_Body",
    "qm_men/Farmer/Farmer_Pants",
]


@pytest.mark.parametrize("case", GARMENTS)
def test_raw_weights_equal_the_oracle(case):
    folder = data_folder()
    entry = next(entry for entry in json.loads((folder / "cases.json").read_text()) if entry["id"] == case)
    body = joined(read_meshes(folder / entry["body"]))
    meshes = read_meshes(folder / entry["garment"])
    garment = next(mesh for mesh in meshes if mesh.name == entry.get("mesh", mesh.name))
    positions = garment.positions.astype(float)
    reference = (body.positions.astype(float), body.triangles, body.weights)
    matching = oracle.match(reference, (positions, garment.triangles))

    weights = native.Weights(body.weights.indptr, body.weights.indices, body.weights.data, body.weights.shape[1])
    source = native.Source(body.positions, body.triangles, weights)
    # Relative distances refer to no less than a part of the source; the oracle's distance is absolute.
    max_distance = 0.05 * np.linalg.norm(np.ptp(positions[np.unique(garment.triangles)], axis=0))
    settings = {"max_distance": max_distance}
    prepared = native.Inpainting(source, garment.positions, garment.triangles, **settings)
    # A few vertices that would match flipped look for a point that looks the right way: test_flipped.py.
    moved = prepared.distance > matching.distance * (1 + 1e-5) + 1e-7
    assert (np.pi - matching.angle[moved] <= THETA + 1e-4).all()
    np.testing.assert_allclose(prepared.distance[~moved], matching.distance[~moved], rtol=1e-5, atol=1e-7)

    matched = prepared.matched(**settings)
    copied = prepared.solve(mask=np.where(matched, 2, 0), **settings).weights.to_dense()
    angle, rows = matching.angle.copy(), matching.rows.tolil()
    differs = np.abs(np.nan_to_num(prepared.angle) - np.nan_to_num(angle)) > 1e-4
    differs |= matched & (np.abs(copied - matching.rows.toarray()).max(axis=1) > 1e-6)
    normals = oracle.vertex_normals(positions, garment.triangles)
    assert (prepared.angle[moved] <= THETA).all()
    angle[moved], rows[moved] = prepared.angle[moved], copied[moved]
    for i in np.flatnonzero(differs & ~moved):
        tied = oracle.ties(reference, positions[i], normals[i])
        misfit = np.abs(tied.angle - prepared.angle[i])
        if matched[i]:
            misfit = np.maximum(misfit, np.abs(tied.rows.toarray() - copied[i]).max(axis=1))
        chosen = np.nanargmin(misfit)
        assert misfit[chosen] < 1e-4
        angle[i], rows[i] = tied.angle[chosen], tied.rows[chosen]
    assert differs.mean() < 0.05

    expected = (np.where(moved, prepared.distance, matching.distance) <= max_distance) & (
        (angle <= THETA) | (np.pi - angle <= THETA)
    )
    undecided = np.abs(prepared.distance / max_distance - 1) < 1e-6
    undecided |= (np.abs(angle - THETA) < 1e-5) | (np.abs(np.pi - angle - THETA) < 1e-5)
    assert np.array_equal(matched[~undecided], expected[~undecided])

    for length in (0.05 * np.linalg.norm(np.ptp(reference[0], axis=0)), 0.0, 1.0):
        unknown, raw = oracle.inpaint(positions, garment.triangles, matched, rows.tocsr(), length)
        vertices, values = prepared.raw_weights(smoothness_length=length, mask=np.where(matched, 2, 0), **settings)
        assert np.array_equal(vertices, unknown)
        assert len(unknown) == 0 or np.abs(values - raw).max() <= 1e-6
