"""Retargeting and automatic weights on files as artists have them: inside out, hidden company, other deformers."""

import builders
import figure
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


@pytest.fixture
def child(scene):
    """A stouter figure beside the body, without weights."""
    rig = figure.rig(name="Child Rig")
    positions, faces = figure.joined(
        figure.tube(0.12, 0, 1.0, (0.09, 0.11)),
        figure.tube(-0.12, 0, 1.0, (0.09, 0.11)),
        figure.tube(0, 0.95, 1.3, (0.27, 0.23), 48, 10),
    )
    obj = builders.mesh("Child", positions, faces)
    figure.bind(obj, rig)
    rig.location.x = obj.location.x = 3
    bpy.context.view_layer.update()
    return obj


def half(obj):
    """Its left half under a Mirror modifier that comes before the armature."""
    positions = np.array([vertex.co for vertex in obj.data.vertices])
    faces = [list(p.vertices) for p in obj.data.polygons if (positions[list(p.vertices)][:, 0] >= -1e-6).all()]
    used = sorted({i for face in faces for i in face})
    number = {i: k for k, i in enumerate(used)}
    data = bpy.data.meshes.new("Half")
    data.from_pydata(positions[used].tolist(), [], [[number[i] for i in face] for face in faces])
    obj.data = data
    modifier = obj.modifiers.new("Mirror", "MIRROR")
    obj.modifiers.move(len(obj.modifiers) - 1, 0)
    return modifier


def error(obj):
    """(V,) how much of the weight is on wrong bones, but at the plane between the legs."""
    positions = np.array([vertex.co for vertex in obj.data.vertices])
    wrong = np.abs(builders.dense(obj, figure.BONES) - figure.weights_at(positions)).sum(1) / 2
    return wrong[np.abs(positions[:, 0]) > 0.03]


def retarget(addon, source, *targets):
    return addon.retarget.retarget_weights(bpy.context, source, list(targets), addon.retarget.RetargetParams())


def skin(addon, obj, rig):
    return addon.autoskin.automatic_weights([obj], rig, addon.autoskin.AutoskinParams(resolution=64))


def said(report):
    return " | ".join(report.all_warnings())


class TestInsideOut:
    """Faces that look inward: a mirrored scale was applied, or a program stores them the other way round."""

    @pytest.mark.parametrize("who", ["source", "target", "both", "a leg"])
    def test_retargeting(self, addon, body, child, who):
        if who in ("source", "both"):
            body.data.flip_normals()
        if who in ("target", "both"):
            child.data.flip_normals()
        if who == "a leg":
            for face in child.data.polygons[480:960]:
                face.flip()
            child.data.update()
        retarget(addon, body, child)
        assert error(child).mean() < 0.02

    def test_automatic_weights(self, addon, child):
        rig = child.modifiers[0].object
        skin(addon, child, rig)
        expected = builders.dense(child, figure.BONES)
        child.vertex_groups.clear()
        child.data.flip_normals()
        assert said(skin(addon, child, rig)) == ""
        np.testing.assert_allclose(builders.dense(child, figure.BONES), expected, atol=1e-3)


class TestHiddenCompany:
    """Levels of detail, hulls and older versions hang on most rigs."""

    @pytest.mark.parametrize("hide", ["eye", "disabled"])
    def test_it_is_left_out_and_named(self, addon, body, child, hide):
        rough = builders.mesh("Body LOD", *figure.tube(0.12, 0, 1, 0.1, 6))
        figure.paint(rough, np.tile([0.5, 0, 0, 0.5, 0], (len(rough.data.vertices), 1)))
        figure.bind(rough, body.modifiers[0].object)
        rough.hide_set(hide == "eye")
        rough.hide_viewport = hide == "disabled"
        report = retarget(addon, body.modifiers[0].object, child)
        assert error(child).mean() < 0.02
        assert "Hidden meshes on Rig took no part in its shape and weights: Body LOD" in said(report)

    def test_a_character_that_is_hidden_as_a_whole_counts(self, addon, body, child):
        body.hide_set(True)
        assert said(retarget(addon, body.modifiers[0].object, child)) == ""
        assert error(child).mean() < 0.02


def groups_off(child):
    half(child).use_mirror_vertex_groups = False


def after_the_armature(child):
    half(child)
    child.modifiers.move(0, 1)


def limited(child):
    child.vertex_groups.new(name="Upper")
    child.modifiers["Armature"].vertex_group = "Upper"


def envelopes(child):
    child.modifiers["Armature"].use_bone_envelopes = True


def twice(child):
    child.parent, child.parent_type = child.modifiers["Armature"].object, "ARMATURE"
    child.matrix_parent_inverse = child.parent.matrix_world.inverted()


def hidden(child):
    child.modifiers["Armature"].show_viewport = False


def overruled(child):
    child.vertex_groups.new(name="Hips")
    modifier = child.modifiers.new("Edit", "VERTEX_WEIGHT_EDIT")
    modifier.vertex_group = "Hips"
    child.modifiers.move(1, 0)


def wrapped(child):
    proxy = figure.body(child.modifiers["Armature"].object)
    proxy.name, proxy.location.x = "Proxy", 3
    child.modifiers.new("Wrap", "SHRINKWRAP").target = proxy


OBSTACLES = [
    (groups_off, "Vertex Groups is off in the modifier Mirror of Child"),
    (after_the_armature, "The modifier Mirror of Child comes after the armature"),
    (limited, "acts in the group Upper only"),
    (envelopes, "binds by bone envelopes too"),
    (twice, "is deformed by Child Rig twice"),
    (hidden, "is off in the viewport"),
    (overruled, "has the modifier Edit, which overrules the weights"),
    (wrapped, "has the modifier Wrap, which follows Proxy too"),
]


@pytest.mark.parametrize("spoil, phrase", OBSTACLES, ids=[spoil.__name__ for spoil, _ in OBSTACLES])
@pytest.mark.parametrize("how", ["retarget", "automatic"])
def test_what_keeps_the_weights_from_acting_is_named(addon, body, child, how, spoil, phrase):
    rig = child.modifiers[0].object
    spoil(child)
    report = retarget(addon, body, child) if how == "retarget" else skin(addon, child, rig)
    assert phrase in said(report)


@pytest.mark.parametrize("how", ["retarget", "automatic"])
def test_a_plain_character_is_not_talked_about(addon, body, child, how):
    child.modifiers.new("Subdivision", "SUBSURF")
    report = retarget(addon, body, child) if how == "retarget" else skin(addon, child, child.modifiers[0].object)
    assert said(report) == ""
