"""What the artist sees although the mesh at hand does not have it: hidden parts, nearly closed seams, renders."""

import builders
import figure
import numpy as np
import pytest
from transferring import said

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


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


class TestPartsThatDoNotTouch:
    """The body's torso is a mesh of its own and ends above the legs."""

    @pytest.fixture
    def torso(self, body, rig):
        made = figure.part(body, "Torso", lambda centre: centre[2] > 0.99)
        figure.bind(made, rig)
        return made

    @pytest.fixture
    def legs(self, body, rig, torso):
        made = figure.part(body, "Legs", lambda centre: centre[2] < 0.94)
        figure.bind(made, rig)
        bpy.data.objects.remove(body)
        return made

    @pytest.fixture
    def overall(self, scene):
        leg = [figure.tube(x, 0.05, 0.97, (0.09, 0.11)) for x in (0.12, -0.12)]
        return builders.mesh("Overall", *figure.joined(*leg, figure.tube(0, 0.97, 1.29, (0.25, 0.21), 48, 10)))

    @pytest.mark.parametrize("hidden", [True, False])
    def test_are_named(self, plain, legs, torso, overall, hidden):
        torso.hide_set(hidden)
        assert "of Overall lies on Torso and out of reach of Legs" in said(plain(legs, overall))

    def test_are_not_where_they_take_part(self, plain, legs, overall):
        assert said(plain(legs, overall, source_scope="ARMATURE")) == ""


@pytest.mark.parametrize("method", ["paper", "confidence"])
def test_a_ribbon_on_edge_that_will_not_bend_is_named(plain, body, method):
    """Its normals lie along the surface, so nothing matches although it runs along the leg."""
    height = np.linspace(0.1, 0.9, 41)
    edges = [np.stack([np.full(41, x), np.zeros(41), height], axis=1) for x in (0.228, 0.242)]
    ribbon = np.concatenate(edges), [[i, i + 1, 42 + i, 41 + i] for i in range(40)]
    trousers = figure.tube(0.12, 0.05, 0.98, (0.09, 0.11))
    piped = builders.mesh("Piped", *figure.joined(trousers, ribbon))
    assert "A loose part of Piped matches nowhere" in said(plain(body, piped, method=method))
    assert said(plain(body, piped, method=method, island_policy="nearest")) == ""


def test_one_bone_alone_leaves_the_rest_short(plain, body):
    """Vertices that follow other bones have no weights at all afterwards."""
    body.vertex_groups.active = body.vertex_groups["Shin.L"]
    report = plain(body, figure.trousers(), groups="ACTIVE")
    assert "sum to less than 1, as only some bones were transferred" in said(report)
