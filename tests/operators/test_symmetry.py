"""A symmetric body and a symmetric garment get symmetric weights, without being asked to."""

import builders
import figure
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
from mathutils import Euler, Matrix  # noqa: E402

pytestmark = pytest.mark.usefixtures("native", "scene")


def asymmetry(obj):
    """(V,) the largest difference between each row and its mirror image's, left and right exchanged."""
    positions = np.array([v.co for v in obj.data.vertices])
    across = np.linalg.norm(positions[:, None] * [-1, 1, 1] - positions[None], axis=2)
    assert across.min(axis=1).max() < 1e-4
    rows = builders.dense(obj, figure.BONES)
    return np.abs(rows - rows[across.argmin(axis=1)][:, [0, 3, 4, 1, 2]]).max(axis=1)


def place(matrix, *objects):
    for obj in objects:
        obj.matrix_world = matrix @ obj.matrix_world
    bpy.context.view_layer.update()


def cut_one_way(obj):
    """The same with its quads cut from their first corners."""
    faces = [list(p.vertices) for p in obj.data.polygons]
    positions = figure.rest(obj)
    return builders.mesh("Cut", positions, [t for a, b, c, d in faces for t in ([a, b, c], [a, c, d])])


def pleated(obj):
    """Pleats that are mirror images of each other, with quads that are no trapezoids."""
    for vertex in obj.data.vertices:
        x, y, z = vertex.co
        vertex.co.y = y * (1 + 0.08 * np.sin(40 * z + 9 * abs(x)))
        vertex.co.z = z + 0.02 * np.cos(60 * abs(x)) * (y > 1e-3)
    return obj


@pytest.mark.parametrize("method", ["paper", "confidence"])
@pytest.mark.parametrize("kind", ["quads", "cut one way", "pleats"])
def test_skirt(plain, kind, method):
    body, skirt = figure.body(), figure.skirt()
    skirt = {"quads": lambda: skirt, "cut one way": lambda: cut_one_way(skirt), "pleats": lambda: pleated(skirt)}[
        kind
    ]()
    plain(body, skirt, method=method)
    assert asymmetry(skirt).max() < 0.01


@pytest.mark.parametrize(
    "matrix",
    [Matrix.Translation((0, 5, 1)), Euler((0.5, 0.3, 1.0)).to_matrix().to_4x4(), Matrix.Diagonal((-1, 1, 1, 1))],
    ids=["moved", "turned", "mirrored"],
)
def test_wherever_the_character_stands(plain, matrix):
    body, skirt = figure.body(), figure.skirt()
    place(matrix, body.modifiers[0].object, body, skirt)
    plain(body, skirt)
    assert asymmetry(skirt).max() < 0.01


def between_the_legs(across):
    """A strip in the middle plane of the legs, or one across it."""
    side, z = np.meshgrid(np.linspace(-0.02, 0.02, 5), np.linspace(0.3, 0.7, 9))
    x, y = (side, 0 * side) if across else (0 * side, side)
    quads = [[5 * j + i, 5 * j + i + 1, 5 * j + i + 6, 5 * j + i + 5] for j in range(8) for i in range(4)]
    return builders.mesh("Strip", np.stack([x, y, z], axis=-1).reshape(-1, 3), quads)


def test_what_is_equally_near_to_both_legs_follows_both(plain):
    body, strip = figure.body(), between_the_legs(across=True)
    plain(body, strip, max_normal_angle=np.pi)
    rows = builders.dense(strip, figure.BONES)
    middle = rows[np.abs(figure.rest(strip)[:, 0]) < 1e-6]
    assert np.abs(middle[:, [1, 2]] - middle[:, [3, 4]]).max() < 1e-5
    assert asymmetry(strip).max() < 1e-5
    assert rows.sum(axis=1) == pytest.approx(1)


def test_but_the_one_it_looks_away_from_if_it_looks_at_the_other(plain):
    body, strip = figure.body(), between_the_legs(across=False)
    plain(body, strip)
    first = builders.dense(strip, figure.BONES)
    assert first[:, [1, 2]].sum(axis=1).min() > 0.99 or first[:, [3, 4]].sum(axis=1).min() > 0.99
    strip.data.flip_normals()
    plain(body, strip)
    np.testing.assert_allclose(builders.dense(strip, figure.BONES), first[:, [0, 3, 4, 1, 2]], atol=1e-5)


def test_a_turned_character_gets_the_same_weights(plain):
    """What is relative to a size is so in the character's own frame."""
    body, skirt = figure.body(), figure.skirt()
    plain(body, skirt)
    upright = builders.dense(skirt, figure.BONES)
    turn = Matrix.Translation((1, 2, 3)) @ Euler((0.5, 0.3, 1.0)).to_matrix().to_4x4()
    place(turn, body.modifiers[0].object, body, skirt)
    report = plain(body, skirt)
    assert np.abs(builders.dense(skirt, figure.BONES) - upright).max() < 1e-3
    assert report.garments[0].matched > 0


def test_flaws_of_a_body_are_counted_by_its_own_vertices(plain):
    """Not by the centres of its quads."""
    body = figure.body()
    body.vertex_groups["Hips"].remove(list(range(5)))
    for name in figure.BONES:
        body.vertex_groups[name].remove([100, 101])
    body.vertex_groups["Shin.L"].add([3], 0.25, "REPLACE")
    report = plain(body, figure.skirt())
    assert any("2 vertices of Body have no weights" in warning for warning in report.all_warnings())
    assert any("1 vertices of Body have weights that do not sum to 1" in warning for warning in report.all_warnings())
