"""What carries a target along by way of other objects, or in renders only, is named or replaced too."""

import builders
import figure
import numpy as np
import pytest
from transferring import said

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

from mathutils import Matrix  # noqa: E402

pytestmark = pytest.mark.usefixtures("native", "scene")


def stay(obj):
    """Leave the vertices where they were before a parent or constraint."""
    bpy.context.view_layer.update()
    obj.data.transform(obj.matrix_world.inverted())


def empty(name="Carrier"):
    made = bpy.data.objects.new(name, None)
    bpy.context.collection.objects.link(made)
    return made


def tree(name):
    made = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for in_out in ("INPUT", "OUTPUT"):
        made.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
    return made, made.nodes.new("NodeGroupInput"), made.nodes.new("NodeGroupOutput")


def nested(inner):
    outer, given, result = tree("Outer")
    group = outer.nodes.new("GeometryNodeGroup")
    group.node_tree = inner
    outer.links.new(given.outputs[0], group.inputs[0])
    outer.links.new(group.outputs[0], result.inputs[0])
    return outer


def skinned_lattice(rig, bone):
    cage = bpy.data.objects.new("Cage", bpy.data.lattices.new("Cage"))
    bpy.context.collection.objects.link(cage)
    cage.location, cage.scale = (0.12, 0, 0.3), (0.6, 0.6, 1.2)
    cage.vertex_groups.new(name=bone).add(list(range(len(cage.data.points))), 1, "REPLACE")
    figure.bind(cage, rig)
    return cage


def vertex_of_a_garment(boot, rig, body):
    sock = builders.mesh("Sock", *figure.tube(0.12, 0.05, 0.45, 0.095))
    figure.paint(sock, figure.weights_at(figure.rest(sock)))
    figure.bind(sock, rig)
    boot.parent, boot.parent_type, boot.parent_vertices = sock, "VERTEX", (100, 0, 0)
    stay(boot)


def ancestor_with_a_constraint(boot, rig, body):
    carrier = empty()
    constraint = carrier.constraints.new("CHILD_OF")
    constraint.target, constraint.subtarget = rig, "Shin.L"
    constraint.inverse_matrix = (rig.matrix_world @ rig.pose.bones["Shin.L"].matrix).inverted()
    boot.parent = carrier
    stay(boot)


def ancestor_with_a_driver(boot, rig, body):
    carrier = boot.parent = empty()
    driver = carrier.driver_add("rotation_euler", 0).driver
    target = driver.variables.new().targets[0]
    driver.variables[0].type = "TRANSFORMS"
    target.id, target.bone_target, target.transform_type = rig, "Leg.L", "ROT_X"
    target.transform_space, driver.expression = "LOCAL_SPACE", "var"
    stay(boot)


def spot_of_the_body(boot, rig, body):
    body.vertex_groups.new(name="spot").add([40, 41, 42, 65], 1, "REPLACE")
    constraint = boot.constraints.new("COPY_LOCATION")
    constraint.target, constraint.subtarget = body, "spot"
    stay(boot)


def surface_of_the_body(boot, rig, body):
    boot.constraints.new("SHRINKWRAP").target = body
    stay(boot)


def child_of_a_lattice(boot, rig, body):
    boot.parent, boot.parent_type = skinned_lattice(rig, "Leg.L"), "LATTICE"
    stay(boot)


def texture_on_a_bone(boot, rig, body):
    modifier = boot.modifiers.new("Displace", "DISPLACE")
    modifier.texture_coords, modifier.texture_coords_object = "OBJECT", rig
    modifier.texture_coords_bone, modifier.strength = "Leg.L", 0


def collection_of_cutters(boot, rig, body):
    collection = bpy.data.collections.new("Cutters")
    bpy.context.scene.collection.children.link(collection)
    cutter = builders.mesh("Cutter", *figure.tube(5, 0.1, 0.2, 0.05))
    collection.objects.link(cutter)
    cutter.parent, cutter.parent_type, cutter.parent_bone = rig, "BONE", "Shin.L"
    modifier = boot.modifiers.new("Cut", "BOOLEAN")
    modifier.operand_type, modifier.collection = "COLLECTION", collection


def nested_nodes(boot, rig, body):
    inner, given, result = tree("Inner")
    inner.links.new(given.outputs[0], result.inputs[0])
    inner.nodes.new("GeometryNodeObjectInfo").inputs["Object"].default_value = body
    boot.modifiers.new("Nodes", "NODES").node_group = nested(inner)


def in_renders_only(boot, rig, body):
    modifier = boot.modifiers.new("Wrap", "SHRINKWRAP")
    modifier.target, modifier.show_viewport = body, False


def data_transfer_in_renders(boot, rig, body):
    modifier = boot.modifiers.new("Data", "DATA_TRANSFER")
    modifier.object, modifier.use_vert_data, modifier.data_types_verts = body, True, {"VGROUP_WEIGHTS"}
    modifier.show_viewport = False
    figure.bind(boot, rig)


def stored_by_nodes(boot, rig, body):
    inner, given, result = tree("Store")
    store = inner.nodes.new("GeometryNodeStoreNamedAttribute")
    store.data_type, store.domain = "FLOAT", "POINT"
    store.inputs["Name"].default_value, store.inputs["Value"].default_value = "Hips", 0.9
    inner.links.new(given.outputs[0], store.inputs[0])
    inner.links.new(store.outputs[0], result.inputs[0])
    boot.modifiers.new("Nodes", "NODES").node_group = nested(inner)
    figure.bind(boot, rig)
    boot.vertex_groups.new(name="Hips")


def child_of_another_rig(boot, rig, body):
    boot.parent, boot.parent_type = figure.rig(name="Boot Rig"), "ARMATURE"


def another_rig_in_renders(boot, rig, body):
    figure.bind(boot, figure.rig(name="Boot Rig")).show_viewport = False


KINDS = [
    (vertex_of_a_garment, "parented to vertices of Sock"),
    (ancestor_with_a_constraint, "hangs on Carrier, which has the constraint Child Of, which follows Rig"),
    (ancestor_with_a_driver, "hangs on Carrier, which has a driver on rotation_euler, which follows Rig"),
    (spot_of_the_body, "constraint Copy Location, which follows Body"),
    (surface_of_the_body, "constraint Shrinkwrap, which follows Body"),
    (child_of_a_lattice, "deformed as a child of Cage"),
    (texture_on_a_bone, "modifier Displace, which follows Rig"),
    (collection_of_cutters, "modifier Cut, which follows Cutter"),
    (nested_nodes, "modifier Nodes, which follows Body"),
    (in_renders_only, "modifier Wrap, which follows Body"),
    (data_transfer_in_renders, "modifier Data, which overrules"),
    (stored_by_nodes, "modifier Nodes, which overrules"),
    (child_of_another_rig, "deformed as a child of Boot Rig and not by Rig"),
    (another_rig_in_renders, "deformed by Boot Rig and not by Rig"),
]


@pytest.mark.parametrize(("follow", "phrase"), KINDS, ids=[kind.__name__ for kind, _ in KINDS])
def test_it_is_named(plain, body, rig, boot, follow, phrase):
    follow(boot, rig, body)
    bpy.context.view_layer.update()
    assert phrase in said(plain(body, boot))


@pytest.mark.parametrize("follow", [kind for kind, _ in KINDS], ids=[kind.__name__ for kind, _ in KINDS])
def test_or_replaced_on_demand(plain, body, rig, boot, follow):
    before = figure.rest(boot)
    follow(boot, rig, body)
    bpy.context.view_layer.update()
    assert "turn on Replace" not in said(plain(body, boot, replace_others=True))
    weights = builders.dense(boot, figure.BONES)
    figure.turn(rig, "Leg.L", -50)
    assert figure.shown(boot) == pytest.approx(figure.blended(rig, before, weights), abs=1e-4)


def test_a_circle_of_constraints_ends(plain, body, boot):
    """Blender allows it and evaluates it in some order."""
    one, other = empty("One"), empty("Other")
    one.constraints.new("COPY_LOCATION").target = other
    other.constraints.new("COPY_LOCATION").target = one
    boot.parent = one
    assert said(plain(body, boot)) == ""


def test_a_rig_that_rides_on_a_bone_carries_all_alike(plain, body, rig, boot):
    horse = figure.bones({"Back": ((0, 0, 0), (0, 0, 1), None)}, "Horse")
    rig.parent, rig.parent_type, rig.parent_bone = horse, "BONE", "Back"
    boot.parent = rig
    assert "Horse" not in said(plain(body, boot))


@pytest.mark.parametrize("along", [False, True])
def test_a_pose_that_carries_the_body_alone_is_named(plain, body, rig, boot, along):
    """At rest the body lies elsewhere than where the boot was fitted to it."""
    horse = figure.bones({"Back": ((1, 0, 1), (1, 0, 1.3), None)}, "Horse")
    for obj in (rig, boot) if along else (rig,):
        obj.parent, obj.parent_type, obj.parent_bone = horse, "BONE", "Back"
        obj.matrix_parent_inverse = (horse.matrix_world @ horse.pose.bones["Back"].matrix).inverted()
    body.parent = rig
    figure.turn(horse, "Back", 5)
    assert ("Horse is posed, and shapes in rest pose were compared" in said(plain(body, boot))) != along


@pytest.mark.parametrize("in_renders", [True, False])
def test_a_hidden_armature_of_another_rig_is_none(plain, body, rig, boot, in_renders):
    before = figure.rest(boot)
    other = figure.bind(boot, figure.rig(name="Boot Rig"))
    other.show_viewport, other.show_render = False, in_renders
    plain(body, boot)
    weights = builders.dense(boot, figure.BONES)
    figure.turn(rig, "Leg.L", -50)
    assert figure.shown(boot) == pytest.approx(figure.blended(rig, before, weights), abs=1e-4)


def test_settings_go_to_the_new_modifier_and_not_to_an_empty_one(plain, body, rig, boot):
    body.modifiers[0].use_deform_preserve_volume = True
    boot.modifiers.new("Empty", "ARMATURE")
    boot.modifiers.new("Mirror", "MIRROR")  # the new one comes after it
    plain(body, boot)
    assert {m.name: m.use_deform_preserve_volume for m in boot.modifiers if m.type == "ARMATURE"} == {
        "Empty": False,
        "Rig": True,
    }


class TestMirrorAfterThePose:
    """What it makes is the pose of the other half."""

    @pytest.mark.parametrize("as_child", [True, False])
    def test_of_a_target(self, plain, body, rig, boot, as_child):
        if as_child:
            boot.parent, boot.parent_type = rig, "ARMATURE"
        else:
            figure.bind(boot, rig)
        boot.modifiers.new("Mirror", "MIRROR")
        assert "Mirror of Boot comes after the armature" in said(plain(body, boot))

    def test_of_the_source(self, plain, body, rig, boot):
        body.modifiers.new("Mirror", "MIRROR")
        assert "Mirror of Body comes after the armature" in said(plain(body, boot))

    def test_an_armature_that_is_attached_comes_after_it(self, plain, body, boot):
        boot.modifiers.new("Mirror", "MIRROR")
        assert said(plain(body, boot)) == ""


class TestEnvelopes:
    """A body that they deform moves otherwise than its weights say."""

    @pytest.mark.parametrize("by_groups", [True, False])
    def test_of_the_modifier(self, plain, body, boot, by_groups):
        body.modifiers[0].use_bone_envelopes, body.modifiers[0].use_vertex_groups = True, by_groups
        assert "Body is bound by bone envelopes" in said(plain(body, boot))

    def test_of_a_bone(self, plain, body, rig, boot):
        rig.data.bones["Leg.L"].use_envelope_multiply = True
        assert "follows the bone Leg.L, whose Envelope Multiply is on" in said(plain(body, boot))


def test_a_lattice_parent_shapes_what_is_seen(plain, body, rig, boot):
    """The boot was modelled beside the body, and the lattice brings it to the leg."""
    reference = builders.mesh("Reference", *figure.tube(0.12, 0.05, 0.45, 0.1))
    plain(body, reference)
    boot.data.transform(Matrix.Translation((-0.24, 0, 0)))
    cage = bpy.data.objects.new("Cage", bpy.data.lattices.new("Cage"))
    bpy.context.collection.objects.link(cage)
    for point in cage.data.points:
        point.co_deform.x += 0.24
    boot.parent, boot.parent_type = cage, "LATTICE"
    plain(body, boot)
    assert builders.dense(boot, figure.BONES) == pytest.approx(builders.dense(reference, figure.BONES), abs=1e-3)
    assert np.allclose(builders.dense(boot, figure.BONES)[:, 3:], 0, atol=1e-3)
