"""What fits a garment in space is part of its rest shape: the armature belongs after it, whoever adds it."""

import builders
import figure
import numpy as np
import pytest
from mathutils import Matrix
from transferring import said

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


def linked(name, data=None):
    made = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(made)
    return made


def lattice(obj):
    """Pulls the boot up, as a lattice does that fits it to a leg."""
    cage = linked("Cage", bpy.data.lattices.new("Cage"))
    cage.location, cage.scale = (0, 0, 0.6), (3, 3, 4)
    bpy.context.view_layer.update()
    for number, point in enumerate(cage.data.points):
        point.co_deform.z += 0.03
        point.co_deform.x += 0.03 * (number % 3)
    obj.modifiers.new("Fit", "LATTICE").object = cage


def taper(obj):
    modifier = obj.modifiers.new("Fit", "SIMPLE_DEFORM")
    modifier.deform_method, modifier.factor, modifier.deform_axis = "TAPER", 0.3, "Z"


def shrinkwrap(obj):
    modifier = obj.modifiers.new("Fit", "SHRINKWRAP")
    modifier.target = builders.mesh("Form", *figure.tube(0.12, 0, 0.5, 0.115))


def nodes(obj):
    obj.data.transform(Matrix.Translation((0, 0, -0.2)))
    tree = bpy.data.node_groups.new("Lift", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = ("NodeGroupInput", "GeometryNodeSetPosition", "NodeGroupOutput")
    first, lift, last = (tree.nodes.new(kind) for kind in kinds)
    lift.inputs["Offset"].default_value = (0, 0, 0.2)
    tree.links.new(first.outputs[0], lift.inputs[0])
    tree.links.new(lift.outputs[0], last.inputs[0])
    obj.modifiers.new("Fit", "NODES").node_group = tree


def displace(obj):
    obj.data.transform(Matrix.Translation((0, 0, -0.2)))
    modifier = obj.modifiers.new("Fit", "DISPLACE")
    modifier.strength, modifier.mid_level, modifier.direction = 0.2, 0, "Z"


FITS = [lattice, taper, shrinkwrap, nodes, displace]


def astray(rig, boot, before):
    """How far a pose takes the boot from where its weights take the shape that was shown at rest."""
    weights = builders.dense(boot, figure.BONES)
    figure.turn(rig, "Leg.L", -50)
    return np.abs(figure.shown(boot) - figure.blended(rig, before, weights)).max()


@pytest.mark.parametrize("fit", FITS)
def test_an_armature_that_is_added_poses_the_shape_that_was_shown(plain, body, rig, boot, fit):
    fit(boot)
    before = figure.shown(boot)
    assert said(plain(body, boot)) == ""
    assert figure.shown(boot) == pytest.approx(before, abs=1e-4)
    assert astray(rig, boot, before) < 1e-4


@pytest.mark.parametrize("fit", [lattice, nodes])
def test_so_does_the_armature_of_automatic_weights(addon, rig, boot, fit):
    fit(boot)
    before = figure.shown(boot)
    addon.autoskin.automatic_weights([boot], rig, addon.autoskin.AutoskinParams())
    assert astray(rig, boot, before) < 1e-4


def test_what_reacts_to_the_pose_comes_after_it(plain, body, boot):
    lattice(boot)
    for kind in ("SUBSURF", "SOLIDIFY", "CLOTH"):
        boot.modifiers.new(kind, kind)
    displacing = boot.modifiers.new("Along Normals", "DISPLACE")
    displacing.strength = 0.001
    hugging = boot.modifiers.new("Hug", "SHRINKWRAP")
    hugging.target = body
    plain(body, boot)
    kinds = [modifier.type for modifier in boot.modifiers]
    assert kinds == ["LATTICE", "ARMATURE", "SUBSURF", "SOLIDIFY", "CLOTH", "DISPLACE", "SHRINKWRAP"]


@pytest.mark.parametrize("as_child", [True, False])
@pytest.mark.parametrize("fit", [lattice, taper])
def test_one_that_shapes_the_pose_is_named_or_lifted(plain, body, rig, boot, fit, as_child):
    """The boot was bound before somebody fitted it, and new modifiers are the last ones."""
    if as_child:
        boot.parent, boot.parent_type = rig, "ARMATURE"
    else:
        figure.bind(boot, rig)
    fit(boot)
    before = figure.shown(boot)
    assert "Boot has the modifier Fit after its armature" in said(plain(body, boot))
    assert "after its armature" not in said(plain(body, boot, replace_others=True))
    assert astray(rig, boot, before) < 1e-4


def test_one_that_changes_nothing_is_not_named(plain, body, rig, boot):
    figure.bind(boot, rig)
    lattice(boot)
    for point in boot.modifiers["Fit"].object.data.points:
        point.co_deform = point.co
    assert said(plain(body, boot)) == ""


def test_fine_relief_after_the_armature_is_not_named(plain, body, rig, boot):
    """Wrinkles of a millimetre slide a little as it moves, and that is usual."""
    figure.bind(boot, rig)
    relief = boot.modifiers.new("Relief", "DISPLACE")
    relief.texture, relief.strength = bpy.data.textures.new("Noise", "CLOUDS"), 0.001
    assert said(plain(body, boot)) == ""


def test_of_the_body_it_is_named(plain, body, boot):
    taper(body)
    assert "Fit of Body comes after the armature" in said(plain(body, boot))


def test_what_blender_keeps_last_does_not_keep_the_armature_from_its_place(plain, body, boot):
    """Shade Auto Smooth adds such a modifier."""
    boot.modifiers.new("Cloth", "CLOTH")
    nodes(boot)
    pinned = boot.modifiers["Fit"]
    if not hasattr(pinned, "use_pin_to_last"):
        pytest.skip("this Blender keeps none last")
    pinned.node_group.nodes["Set Position"].inputs["Offset"].default_value = (0, 0, 0)
    pinned.use_pin_to_last = True
    smoothing = body.modifiers.new("Smooth", "CORRECTIVE_SMOOTH")
    smoothing.iterations = 1
    plain(body, boot, add_corrective_smooth=True)
    assert [m.type for m in boot.modifiers] == ["ARMATURE", "CORRECTIVE_SMOOTH", "CLOTH", "NODES"]


def test_a_cache_that_plays_over_the_weights_is_named(plain, body, rig, boot):
    figure.bind(boot, rig)
    boot.modifiers.new("Sim", "MESH_CACHE").filepath = "//sim.pc2"
    assert "Boot has the modifier Sim, which plays a cache" in said(plain(body, boot))
