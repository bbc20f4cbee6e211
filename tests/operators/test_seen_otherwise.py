"""What the artist sees although the mesh at hand does not have it: hidden parts, nearly closed seams, renders."""

import builders
import figure
import numpy as np
import pytest
from transferring import said

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


@pytest.fixture
def body(scene):
    return figure.body()


@pytest.fixture
def rig(body):
    return body.modifiers[0].object


def hide(body, vertices):
    body.vertex_groups.new(name="hide").add([int(i) for i in vertices], 1, "REPLACE")
    modifier = body.modifiers.new("Hide", "MASK")
    modifier.vertex_group, modifier.invert_vertex_group = "hide", True


class TestHiddenParts:
    """A Mask modifier of the body."""

    def test_below_a_garment_are_named(self, plain, body):
        height = figure.rest(body)[:, 2]
        hide(body, np.flatnonzero((height > 0.2) & (height < 0.85)))
        assert "of Trousers lies next to what the modifier Hide of Body hides" in said(plain(body, figure.trousers()))

    def test_elsewhere_are_not(self, plain, body):
        hide(body, np.flatnonzero(figure.rest(body)[:, 2] > 1.15))
        assert said(plain(body, figure.trousers())) == ""

    def test_that_hang_on_nothing_are_helpers(self, plain, body, rig):
        """As MakeHuman's skirt about the legs: nothing matches it, and nothing is said."""
        helper = figure.tube(0, 0.1, 1.0, 0.3)
        reference = figure.trousers("Reference")
        plain(body, reference)
        faces = [list(p.vertices) for p in body.data.polygons]
        both = builders.mesh("Both", *figure.joined((figure.rest(body), faces), helper))
        first = len(body.data.vertices)
        hips = np.tile([1.0, 0, 0, 0, 0], (len(helper[0]), 1))
        figure.paint(both, np.concatenate([builders.dense(body, figure.BONES), hips]))
        figure.bind(both, rig)
        hide(both, range(first, first + len(helper[0])))
        trousers = figure.trousers()
        assert said(plain(both, trousers, source_scope="OBJECT")) == ""
        assert builders.dense(trousers, figure.BONES) == pytest.approx(builders.dense(reference, figure.BONES))


class TestSeams:
    """Every face of a skirt by itself, as with flat shading, and its corners not quite where they were."""

    @staticmethod
    def skirt(jitter):
        positions, faces = figure.tube(0, 0.45, 1.2, (0.34, 0.25), 32, 12)
        corners = positions[faces.ravel()]
        rng = np.random.default_rng(0)
        single = np.arange(len(corners)).reshape(-1, 4)
        return faces.ravel(), builders.mesh("Skirt", corners + rng.uniform(-jitter, jitter, corners.shape), single)

    @staticmethod
    def opening(obj, corner, rig):
        for modifier in obj.modifiers:
            modifier.show_viewport = modifier.type == "ARMATURE"
        figure.turn(rig, "Leg.L", -70)
        now = figure.shown(obj)
        order = np.argsort(corner, kind="stable")
        first = np.flatnonzero(np.diff(corner[order], prepend=-1))
        middle = np.add.reduceat(now[order], first) / np.diff([*first, len(order)])[:, None]
        return np.linalg.norm(now - middle[corner], axis=1).max()

    def test_that_nearly_close_are_named(self, plain, body):
        _, skirt = self.skirt(2e-5)
        assert "Borders of Skirt lie up to" in said(plain(body, skirt))

    def test_and_the_weld_that_is_named_closes_them(self, plain, body, rig):
        corner, skirt = self.skirt(2e-5)
        weld = float(said(plain(body, skirt)).split("set Weld to ")[1].split()[0])
        assert said(plain(body, skirt, relative_weld_tolerance=2 * weld)) == ""
        assert self.opening(skirt, corner, rig) < 1e-3

    def test_that_close_are_not(self, plain, body):
        _, skirt = self.skirt(0)
        assert said(plain(body, skirt)) == ""

    def test_that_a_weld_modifier_closes_stay_closed(self, plain, body, rig):
        corner, skirt = self.skirt(1e-4)
        skirt.modifiers.new("Weld", "WELD").merge_threshold = 1e-3
        assert said(plain(body, skirt)) == ""
        assert self.opening(skirt, corner, rig) < 1e-3


def test_a_mirror_of_renders_completes_too(plain, body):
    """Half a skirt that is worked on without its other half."""
    whole = figure.skirt()
    plain(body, whole)
    half = figure.part(whole, "Half", lambda centre: centre[0] > 0)
    kept = np.flatnonzero(figure.rest(whole)[:, 0] > -1e-6)
    half.vertex_groups.clear()
    half.modifiers.new("Mirror", "MIRROR").show_viewport = False
    plain(body, half)
    assert builders.dense(half, figure.BONES) == pytest.approx(builders.dense(whole, figure.BONES)[kept], abs=1e-3)


def test_weights_that_change_after_the_armature_do_not_count(plain, body):
    reference, trousers = figure.trousers("Reference"), figure.trousers()
    plain(body, reference)
    modifier = body.modifiers.new("Edit", "VERTEX_WEIGHT_EDIT")
    modifier.vertex_group, modifier.default_weight, modifier.use_add = "Hips", 1, True
    modifier.falloff_type, modifier.add_threshold = "STEP", 0
    plain(body, trousers)
    assert builders.dense(trousers, figure.BONES) == pytest.approx(builders.dense(reference, figure.BONES))
