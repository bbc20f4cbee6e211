"""What is selected beside meshes: named where it can be made a mesh, and never a guess among armatures."""

import builders
import figure
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


def curve():
    return bpy.data.objects.new("Belt", bpy.data.curves.new("Belt", "CURVE"))


def text():
    return bpy.data.objects.new("Belt", bpy.data.curves.new("Belt", "FONT"))


def instance():
    belt = bpy.data.objects.new("Belt", None)
    belt.instance_type, belt.instance_collection = "COLLECTION", bpy.data.collections.new("Belts")
    return belt


def camera():
    return bpy.data.objects.new("Belt", bpy.data.cameras.new("Belt"))


def run(how, body, rig, boot, extra):
    bpy.context.collection.objects.link(extra)
    if how == "transfer":
        bpy.context.scene.skinwright.transfer.source = body
        builders.select(boot, extra)
        return bpy.ops.skinwright.transfer_weights()
    if how == "automatic":
        builders.select(boot, extra, rig)
        return bpy.ops.skinwright.automatic_weights(resolution=32)
    figure.bind(boot, figure.rig(name="Boot Rig"))
    bpy.context.scene.skinwright.retarget.source = rig
    builders.select(boot, extra)
    return bpy.ops.skinwright.retarget_weights()


@pytest.mark.parametrize("how", ["transfer", "automatic", "retarget"])
@pytest.mark.parametrize("make, named", [(curve, True), (text, True), (instance, True), (camera, False)])
def test_what_could_be_a_mesh_is_named(addon, body, rig, boot, how, make, named):
    assert run(how, body, rig, boot, make()) == {"FINISHED"}
    said = " ".join(addon.reporting.last.warnings)
    assert ("Belt is no mesh and was passed over" in said) == named


def test_of_two_armatures_the_active_one_counts(addon, rig, boot):
    other = figure.rig(name="Other")
    builders.select(boot, other, rig)
    bpy.context.view_layer.objects.active = boot
    with pytest.raises(RuntimeError, match="make the armature whose bones count the active object"):
        bpy.ops.skinwright.automatic_weights(resolution=32)
    assert not boot.vertex_groups
    bpy.context.view_layer.objects.active = other
    assert bpy.ops.skinwright.automatic_weights(resolution=32) == {"FINISHED"}
    assert boot.modifiers[0].object == other


@pytest.mark.parametrize("bound", [True, False])
def test_a_rig_that_was_posed_to_fit_a_mesh_is_named(addon, rig, boot, bound):
    """Bones at rest count, and what was not bound before jumps into the pose."""
    if bound:
        figure.bind(boot, rig)
    figure.turn(rig, "Leg.L", 20)
    builders.select(boot, rig)
    bpy.ops.skinwright.automatic_weights(resolution=32)
    assert ("Rig is posed, and its bones at rest were used" in " ".join(addon.reporting.last.warnings)) != bound
