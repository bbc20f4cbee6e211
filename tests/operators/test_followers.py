"""After a transfer a target does what its new weights say, or a sentence names what overrules them."""

from importlib import import_module

import builders
import figure
import numpy as np
import pytest
from transferring import said

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
from mathutils import Matrix  # noqa: E402

pytestmark = pytest.mark.usefixtures("native", "scene")


def astray(obj, rig, before):
    """How far a pose takes it from where linear blending of its weights does."""
    weights = builders.dense(obj, figure.BONES)
    figure.turn(rig, "Leg.L", -50)
    return np.linalg.norm(figure.shown(obj) - figure.blended(rig, before, weights), axis=1).max()


def on_a_bone(boot, rig, body):
    boot.parent, boot.parent_type, boot.parent_bone = rig, "BONE", "Shin.L"
    bpy.context.view_layer.update()
    boot.matrix_world = Matrix.Identity(4)


def on_an_empty(boot, rig, body):
    empty = bpy.data.objects.new("Socket", None)
    bpy.context.collection.objects.link(empty)
    empty.parent, empty.parent_type, empty.parent_bone = rig, "BONE", "Shin.L"
    boot.parent = empty
    bpy.context.view_layer.update()
    boot.matrix_world = Matrix.Identity(4)


def child_of(boot, rig, body):
    constraint = boot.constraints.new("CHILD_OF")
    constraint.target, constraint.subtarget = rig, "Shin.L"
    constraint.inverse_matrix = (rig.matrix_world @ rig.pose.bones["Shin.L"].matrix).inverted()


def copied_place(boot, rig, body):
    constraint = boot.constraints.new("COPY_ROTATION")
    constraint.target, constraint.subtarget = rig, "Shin.L"
    constraint.target_space = constraint.owner_space = "LOCAL"


def armature_constraint(boot, rig, body):
    target = boot.constraints.new("ARMATURE").targets.new()
    target.target, target.subtarget = rig, "Shin.L"


def surface_deform(boot, rig, body):
    modifier = boot.modifiers.new("Surface", "SURFACE_DEFORM")
    modifier.target = body
    builders.select(boot)
    bpy.ops.object.surfacedeform_bind(modifier=modifier.name)
    assert modifier.is_bound


def hook(boot, rig, body):
    modifier = boot.modifiers.new("Hook", "HOOK")
    modifier.object, modifier.subtarget = rig, "Shin.L"
    modifier.vertex_indices_set(range(len(boot.data.vertices)))


def socket(rig):
    """An empty on the shin."""
    empty = bpy.data.objects.new("Socket", None)
    bpy.context.collection.objects.link(empty)
    empty.parent, empty.parent_type, empty.parent_bone = rig, "BONE", "Shin.L"
    bpy.context.view_layer.update()
    return empty


def hook_on_a_socket(boot, rig, body):
    modifier = boot.modifiers.new("Hook", "HOOK")
    modifier.object = socket(rig)
    modifier.matrix_inverse = modifier.object.matrix_world.inverted()
    modifier.vertex_indices_set(range(len(boot.data.vertices)))


def shrinkwrap(boot, rig, body):
    modifier = boot.modifiers.new("Wrap", "SHRINKWRAP")
    modifier.target, modifier.wrap_mode = body, "OUTSIDE_SURFACE"


def warp(boot, rig, body):
    modifier = boot.modifiers.new("Warp", "WARP")
    modifier.object_from, modifier.object_to = socket(rig), socket(rig)


def nodes(boot, rig, body):
    tree = bpy.data.node_groups.new("Look", "GeometryNodeTree")
    for in_out in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
    tree.links.new(tree.nodes.new("NodeGroupInput").outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    tree.nodes.new("GeometryNodeObjectInfo").inputs["Object"].default_value = body
    boot.modifiers.new("Nodes", "NODES").node_group = tree


def nodes_that_are_given_it(boot, rig, body):
    nodes(boot, rig, boot)
    modifier = boot.modifiers["Nodes"]
    tree = modifier.node_group
    tree.nodes["Object Info"].inputs["Object"].default_value = None
    name = tree.interface.new_socket("Object", in_out="INPUT", socket_type="NodeSocketObject").identifier
    if hasattr(modifier, "properties"):
        getattr(modifier.properties.inputs, name).value = body
    else:
        modifier[name] = body


def driven_place(boot, rig, body):
    driver = boot.driver_add("location", 2).driver
    target = driver.variables.new().targets[0]
    driver.variables[0].type = "TRANSFORMS"
    target.id, target.bone_target, target.transform_type = rig, "Shin.L", "ROT_X"
    target.transform_space, driver.expression = "LOCAL_SPACE", "var"


def twice_by_modifiers(boot, rig, body):
    figure.bind(boot, rig)
    figure.bind(boot, rig)


def twice_as_a_child(boot, rig, body):
    figure.bind(boot, rig)
    boot.parent, boot.parent_type = rig, "ARMATURE"


def switched_off(boot, rig, body):
    modifier = figure.bind(boot, rig)
    modifier.show_viewport = modifier.show_render = False


def other_rig(boot, rig, body):
    figure.bind(boot, figure.rig(name="Boot Rig"))


def envelopes(boot, rig, body):
    modifier = figure.bind(boot, rig)
    modifier.use_bone_envelopes = True


def limited(boot, rig, body):
    builders.paint(boot, part=[1.0] * 10 + [np.nan] * (len(boot.data.vertices) - 10))
    figure.bind(boot, rig).vertex_group = "part"


def data_transfer(boot, rig, body):
    modifier = boot.modifiers.new("Data", "DATA_TRANSFER")
    modifier.object, modifier.use_vert_data, modifier.data_types_verts = body, True, {"VGROUP_WEIGHTS"}
    modifier.layers_vgroup_select_src, modifier.layers_vgroup_select_dst = "ALL", "NAME"
    figure.bind(boot, rig)
    for name in figure.BONES:
        boot.vertex_groups.new(name=name)


def weight_edit(boot, rig, body):
    boot.vertex_groups.new(name="Leg.L")
    modifier = boot.modifiers.new("Edit", "VERTEX_WEIGHT_EDIT")
    modifier.vertex_group, modifier.default_weight, modifier.use_add = "Leg.L", 1, True
    modifier.falloff_type, modifier.add_threshold = "STEP", 0
    figure.bind(boot, rig)


def weight_mix(boot, rig, body):
    boot.vertex_groups.new(name="Shin.L")
    modifier = boot.modifiers.new("Mix", "VERTEX_WEIGHT_MIX")
    modifier.vertex_group_a, modifier.default_weight_b, modifier.mix_set = "Shin.L", 0.2, "ALL"
    figure.bind(boot, rig)


KINDS = [
    (on_a_bone, "parented to the bone Shin.L of Rig"),
    (on_an_empty, "hangs on Socket"),
    (child_of, "constraint Child Of"),
    (copied_place, "constraint Copy Rotation"),
    (armature_constraint, "constraint Armature"),
    (surface_deform, "modifier Surface, which follows Body"),
    (hook, "modifier Hook, which follows Rig"),
    (hook_on_a_socket, "modifier Hook, which follows Socket"),
    (shrinkwrap, "modifier Wrap, which follows Body"),
    (warp, "modifier Warp, which follows Socket"),
    (nodes, "modifier Nodes, which follows Body"),
    (nodes_that_are_given_it, "modifier Nodes, which follows Body"),
    (driven_place, "driver on location, which follows Rig"),
    (twice_by_modifiers, "deformed by Rig twice, the second time by the modifier Armature.001"),
    (twice_as_a_child, "deformed by Rig twice, by a modifier and as its child"),
    (switched_off, "modifier Armature, which is off in the viewport"),
    (other_rig, "deformed by Boot Rig and not by Rig"),
    (envelopes, "binds by bone envelopes"),
    (limited, "acts in the group part only"),
    (data_transfer, "modifier Data, which overrules"),
    (weight_edit, "modifier Edit, which overrules"),
    (weight_mix, "modifier Mix, which overrules"),
]


@pytest.mark.parametrize(("follow", "phrase"), KINDS, ids=[kind.__name__ for kind, _ in KINDS])
def test_what_else_moves_it_is_named(plain, body, rig, boot, follow, phrase):
    follow(boot, rig, body)
    bpy.context.view_layer.update()
    assert phrase in said(plain(body, boot))


@pytest.mark.parametrize("follow", [kind for kind, _ in KINDS], ids=[kind.__name__ for kind, _ in KINDS])
def test_or_replaced_on_demand(plain, body, rig, boot, follow):
    before = figure.rest(boot)
    follow(boot, rig, body)
    bpy.context.view_layer.update()
    report = plain(body, boot, replace_others=True)
    assert said(report) == ""
    assert figure.shown(boot) == pytest.approx(before, abs=1e-5), "it stays where it was"
    assert astray(boot, rig, before) < 1e-4


def test_what_hangs_on_a_bone_of_a_posed_rig_is_put_back_at_rest(plain, body, rig, boot):
    before = figure.rest(boot)
    on_a_bone(boot, rig, body)
    figure.turn(rig, "Shin.L", 30)
    plain(body, boot, replace_others=True)
    rig.pose.bones["Shin.L"].matrix_basis = Matrix.Identity(4)
    assert figure.shown(boot) == pytest.approx(before, abs=1e-5)
    assert astray(boot, rig, before) < 1e-4


def test_harmless_company_is_not_named(plain, body, rig, boot):
    """A parent that carries the whole character, a constraint to something else, weights of other groups."""
    boot.parent = rig
    boot.constraints.new("LIMIT_LOCATION")
    builders.paint(boot, pin=1.0)
    modifier = boot.modifiers.new("Edit", "VERTEX_WEIGHT_EDIT")
    modifier.vertex_group = "pin"
    boot.modifiers.new("Mirror", "MIRROR").mirror_object = rig
    boot.modifiers["Mirror"].use_mirror_merge = False
    boot.modifiers.new("Bevel", "BEVEL")
    assert said(plain(body, boot)) == ""


class TestModifier:
    """The settings of the source's Armature modifier come along."""

    @pytest.mark.parametrize("name", ["use_deform_preserve_volume", "use_multi_modifier"])
    def test_switches(self, plain, body, boot, name):
        setattr(body.modifiers[0], name, True)
        plain(body, boot)
        assert getattr(boot.modifiers[0], name)

    def test_preserve_volume_keeps_leggings_on_the_knee(self, plain, body, rig):
        body.modifiers[0].use_deform_preserve_volume = True
        legs = figure.part(body, "Leggings", lambda centre: centre[2] < 0.9)
        legs.vertex_groups.clear()
        plain(body, legs)
        figure.turn(rig, "Shin.L", 100)
        near = figure.shown(body)
        distance = np.linalg.norm(figure.shown(legs)[:, None] - near[None], axis=2).min(axis=1)
        assert distance.max() < 1e-4

    def test_a_group_that_limits_it(self, plain, body, boot):
        builders.paint(body, soft=np.where(figure.rest(body)[:, 2] < 0.25, 1.0, np.nan))
        body.modifiers[0].vertex_group = "soft"
        plain(body, boot)
        low = figure.rest(boot)[:, 2] < 0.2
        assert boot.modifiers[0].vertex_group == "soft"
        assert (builders.dense(boot, ["soft"])[low] > 0.9).all() and not builders.dense(boot, ["soft"])[-24:].any()

    def test_other_settings_of_a_modifier_that_is_there_are_named(self, plain, body, rig, boot):
        body.modifiers[0].use_deform_preserve_volume = True
        figure.bind(boot, rig)
        assert "other settings than that of Body" in said(plain(body, boot))


class TestCorrectiveSmooth:
    """A body that smooths its poses."""

    @pytest.fixture
    def smooth(self, body):
        modifier = body.modifiers.new("Tidy", "CORRECTIVE_SMOOTH")
        modifier.iterations = 7
        return modifier

    def test_it_is_offered(self, plain, body, boot, smooth):
        assert "Body has the modifier Tidy" in said(plain(body, boot))

    def test_it_is_taken_over(self, plain, body, boot, smooth):
        boot.modifiers.new("Subsurf", "SUBSURF")
        assert said(plain(body, boot, add_corrective_smooth=True)) == ""
        assert [m.type for m in boot.modifiers] == ["ARMATURE", "CORRECTIVE_SMOOTH", "SUBSURF"]
        assert boot.modifiers["Tidy"].iterations == 7
        assert said(plain(body, boot)) == "", "it has one now"

    def test_before_the_pose_it_is_something_else(self, plain, body, boot):
        body.modifiers.new("Tidy", "CORRECTIVE_SMOOTH")
        body.modifiers.move(1, 0)
        assert said(plain(body, boot)) == ""


class TestFittedInPose:
    """A garment modelled on the posed body is bound in that pose."""

    @pytest.fixture
    def fitted(self, body, rig):
        """Trousers around the posed legs."""
        figure.turn(rig, "Leg.L", -25, "Y")
        figure.turn(rig, "Shin.L", 40)
        figure.turn(rig, "Leg.R", 25, "Y")
        positions = figure.shown(body)[: 2 * 21 * 24]
        faces = [list(p.vertices) for p in body.data.polygons if max(p.vertices) < len(positions)]
        obj = builders.mesh("Trousers", positions, faces)
        normals = np.array([vertex.normal for vertex in obj.data.vertices])
        for vertex, position in zip(obj.data.vertices, positions + 0.008 * normals, strict=True):
            vertex.co = position
        return obj

    @pytest.mark.parametrize("volume", [False, True])
    def test_it_stays_where_it_is_and_follows_from_there(self, plain, body, rig, fitted, volume):
        body.modifiers[0].use_deform_preserve_volume = volume
        before = figure.shown(fitted)
        report = plain(body, fitted, geometry="CURRENT")
        assert "Trousers bound in the pose" in report.sentence() and said(report) == ""
        assert figure.shown(fitted) == pytest.approx(before, abs=1e-5)
        for bone in rig.pose.bones:
            bone.matrix_basis = Matrix.Identity(4)
        truth = figure.rest(body)[: len(before)]
        off = np.linalg.norm(figure.shown(fitted) - truth, axis=1)
        assert off.max() < 0.03 and off.mean() < 0.012, "at rest it lies around the legs at rest"

    def test_its_shape_keys_go_along(self, plain, body, rig, fitted):
        fitted.shape_key_add(name="Basis", from_mix=False)
        wide = fitted.shape_key_add(name="Wide", from_mix=False)
        for point in wide.data:
            point.co.y += 0.01
        wide.value = 0.5
        before = figure.shown(fitted)
        plain(body, fitted, geometry="CURRENT")
        assert figure.shown(fitted) == pytest.approx(before, abs=1e-5)
        wide.value = 0
        assert figure.shown(fitted)[:, 1] == pytest.approx(before[:, 1] - 0.005, abs=1e-5)

    def test_nothing_is_left_if_a_later_target_fails(self, addon, plain, body, rig, fitted, boot, monkeypatch):
        """Neither the rest shape that was bound, nor what no longer follows the rig by other means."""
        fitted.shape_key_add(name="Basis", from_mix=False)
        boot.parent, boot.parent_type, boot.parent_bone = rig, "BONE", "Shin.L"
        follow = boot.constraints.new("COPY_LOCATION")
        follow.target, follow.subtarget = rig, "Shin.L"
        bpy.context.view_layer.update()
        writing = import_module(f"{addon.__name__}.transfer.write")
        report, count = writing._report, []

        def fails(*arguments):
            count.append(1)
            if len(count) == 2:
                raise OSError("injected")
            return report(*arguments)

        monkeypatch.setattr(writing, "_report", fails)
        before = figure.shown(fitted), figure.rest(fitted), boot.matrix_world.copy()
        with pytest.raises(OSError, match="injected"):
            plain(body, fitted, boot, geometry="CURRENT", replace_others=True)
        bpy.context.view_layer.update()
        assert np.array_equal(figure.rest(fitted), before[1])
        assert np.array_equal(figure.shown(fitted), before[0])
        assert not fitted.vertex_groups and not boot.vertex_groups and not fitted.modifiers
        assert (boot.parent, boot.parent_bone, follow.mute) == (rig, "Shin.L", False)
        assert boot.matrix_world == before[2]

    def test_one_that_has_the_modifier_but_no_weights_yet(self, plain, body, rig, fitted):
        figure.bind(fitted, rig)
        before = figure.shown(fitted)
        plain(body, fitted, geometry="CURRENT")
        assert figure.shown(fitted) == pytest.approx(before, abs=1e-5)

    def test_one_that_follows_already_keeps_its_rest_shape(self, plain, body, rig):
        trousers = figure.trousers()
        plain(body, trousers)
        figure.turn(rig, "Leg.L", 40)
        before = figure.rest(trousers)
        report = plain(body, trousers, geometry="CURRENT")
        assert "bound" not in report.sentence()
        assert np.array_equal(figure.rest(trousers), before)

    def test_a_mirror_is_refused(self, plain, addon, body, fitted):
        fitted.modifiers.new("Mirror", "MIRROR")
        before = figure.rest(fitted)
        with pytest.raises(addon.scene.error.SceneError, match="Trousers has a Mirror modifier"):
            plain(body, fitted, geometry="CURRENT")
        assert np.array_equal(figure.rest(fitted), before) and not fitted.vertex_groups

    def test_a_shared_mesh_is_refused(self, plain, addon, body, fitted):
        twin = bpy.data.objects.new("Twin", fitted.data)
        bpy.context.collection.objects.link(twin)
        with pytest.raises(addon.scene.error.SceneError, match="shares its mesh with Twin"):
            plain(body, fitted, geometry="CURRENT")
