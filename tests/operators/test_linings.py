"""Garments whose faces look inward, as linings and the insides of shells do, between thighs that nearly touch."""

import builders
import figure
import numpy as np
import pytest
from transferring import said

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")

AROUND, RINGS = 48, 20


@pytest.fixture
def body(scene):
    """Legs 6 mm apart, each with clean weights of its own."""
    legs = [figure.tube(x, 0, 1.0, (0.08, 0.1), AROUND, RINGS) for x in (0.103, -0.103)]
    obj = builders.mesh("Body", *figure.joined(*legs))
    weights = figure.weights_at(figure.rest(obj))
    half = len(weights) // 2
    weights[:half, 1:3] += weights[:half, 3:]
    weights[half:, 3:] += weights[half:, 1:3]
    weights[:half, 3:] = weights[half:, 1:3] = 0
    figure.paint(obj, weights)
    figure.bind(obj, figure.rig())
    return obj


def leg(x, off):
    return figure.tube(x, 0.1, 0.9, (0.082 + off, 0.098 + off), AROUND, RINGS)


def inward(x):
    positions, faces = leg(x, 0.002)
    return positions, faces[:, ::-1]


def shell(x):
    """Two layers, 1 mm apart, joined at both ends."""
    (inner, faces), (outer, _) = leg(x, 0.002), leg(x, 0.003)
    n, last = len(inner), RINGS * AROUND
    k = (np.arange(AROUND) + 1) % AROUND
    i = np.arange(AROUND)
    low = np.stack([i, n + i, n + k, k], axis=1)
    high = np.stack([last + k, n + last + k, n + last + i, last + i], axis=1)
    return np.concatenate([inner, outer]), np.concatenate([faces[:, ::-1], faces + n, low, high])


def outward(x):
    return leg(x, 0.002)


@pytest.mark.parametrize("method", ["paper", "confidence"])
@pytest.mark.parametrize("make", [inward, shell, outward])
def test_each_leg_follows_its_own(plain, body, make, method):
    trousers = builders.mesh("Trousers", *figure.joined(make(0.103), make(-0.103)))
    assert said(plain(body, trousers, method=method)) == ""
    weights = builders.dense(trousers, figure.BONES)
    half = len(weights) // 2
    astray = np.concatenate([weights[:half, 3:].sum(axis=1), weights[half:, 1:3].sum(axis=1)])
    assert astray.max() < 0.2


@pytest.mark.parametrize(("method", "most"), [("paper", 0.01), ("confidence", 0.002)])
def test_cloth_within_the_other_leg_comes_back(plain, body, method, most):
    """Its faces look outward, so what lies in the other thigh belongs to its own."""
    trousers = builders.mesh("Trousers", *figure.joined(leg(0.103, 0.012), leg(-0.103, 0.012)))
    plain(body, trousers, method=method)
    weights = builders.dense(trousers, figure.BONES)
    half = len(weights) // 2
    astray = np.concatenate([weights[:half, 3:].sum(axis=1), weights[half:, 1:3].sum(axis=1)])
    assert (astray > 0.5).mean() < most
