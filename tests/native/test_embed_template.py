"""A skeleton from a template character: joints whose places are known, symmetry, refusals."""

import numpy as np
import pytest
from support import characters

wheel = pytest.mark.skipif(not characters.WHEEL.exists(), reason="needs the MakeHuman body: make demo fetches it")


def mirror(names):
    other = {name: name.replace(".L", ".#").replace(".R", ".L").replace(".#", ".R") for name in names}
    return np.array([names.index(other[name]) if other[name] in names else -1 for name in names])


def embed(native, source, target, **options):
    inputs = {
        "donor_positions": source.positions,
        "donor_triangles": source.triangles,
        "donor_weights": native.Weights.from_dense(source.weights),
        "mirror": mirror(source.names),
    } | options
    return native.embed_skeleton(
        target.positions, target.triangles, source.heads, source.tails, source.parents, method="template", **inputs
    )


@wheel
@pytest.mark.parametrize("shape", ["female", "heavy", "child", "baby"])
def test_joints_land_where_the_rig_of_the_target_has_them(native, shape):
    source, target = characters.makehuman_body("male"), characters.makehuman_body(shape)
    result = embed(native, source, target)
    weighted = source.weights.sum(0) > 0
    height = np.ptp(target.positions[:, 2])
    error = np.linalg.norm(result.heads - target.heads, axis=1)[weighted] / height
    assert error.mean() < 0.015
    # Joints of the face lie in the skin itself.
    outside = {source.names[j] for j in result.report["outside"]}
    assert not {
        name for name in outside if any(word in name for word in ("arm", "leg", "spine", "neck", "foot", "wrist"))
    }
    aside = np.abs(target.heads[:, 0]) > 0.01 * height
    assert (np.sign(result.heads[aside, 0]) == np.sign(target.heads[aside, 0])).all()


@wheel
def test_sides_are_mirror_images_and_the_middle_is_in_the_middle(native):
    source, target = characters.makehuman_body("male"), characters.makehuman_body("child")
    result = embed(native, source, target)
    pairs = mirror(source.names)
    assert result.report["symmetric"]
    plane = result.heads[pairs == np.arange(len(pairs)), 0].mean()
    reflected = result.heads[pairs] * (-1, 1, 1) + (2 * plane, 0, 0)
    symmetric = np.abs(source.heads[pairs] * (-1, 1, 1) - source.heads).max(1) < 1e-3
    assert np.abs(reflected - result.heads)[symmetric & (pairs >= 0)].max() < 1e-4 * np.ptp(target.positions[:, 2])


@wheel
def test_threads_do_not_change_a_bit(native):
    source, target = characters.makehuman_body("male"), characters.makehuman_body("female")
    one, two = (embed(native, source, target, threads=n) for n in (1, 2))
    assert np.array_equal(one.heads, two.heads) and np.array_equal(one.tails, two.tails)


def test_a_template_needs_its_character(native):
    triangle = np.eye(3), [[0, 1, 2]]
    with pytest.raises(native.InvalidParameter, match="needs mesh and weights"):
        native.embed_skeleton(*triangle, np.eye(3), np.eye(3) + 1, [-1, 0, 1], method="template")


def test_bad_input_gets_a_sentence(native):
    triangle = np.eye(3), [[0, 1, 2]]
    bones = np.eye(3), np.eye(3) + 1, [-1, 0, 1]
    donor = {"donor_positions": triangle[0], "donor_triangles": triangle[1], "method": "template"}
    weights = native.Weights.from_dense(np.eye(3))
    for options, sentence in [
        ({"donor_weights": native.Weights.from_dense(np.eye(3)[:2])}, "weights of the template has 2 entries"),
        ({"donor_weights": weights, "mirror": [0, 1]}, "mirror has 2 entries where 3 are needed"),
        ({"donor_weights": weights, "mirror": [0, 1, 9]}, "mirror is 9"),
        ({"donor_weights": weights, "landmarks": [[0, 7]]}, "a landmark must name a vertex"),
    ]:
        with pytest.raises(native.InvalidParameter, match=sentence):
            native.embed_skeleton(*triangle, *bones, **donor, **options)
