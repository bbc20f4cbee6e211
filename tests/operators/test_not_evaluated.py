"""What Blender does not evaluate stands where it would be seen, and not where it was seen last."""

import builders
import figure
import numpy as np
import pytest
from limbs import ARM, limb, truth

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")

HIDING = ["excluded", "disabled collection", "disabled object", "other scene"]


def put_away(how, *objects):
    """Into a collection that Blender leaves out."""
    scene = bpy.context.scene
    away = bpy.data.collections.new("Away")
    (bpy.data.scenes.new("Other") if how == "other scene" else scene).collection.children.link(away)
    for obj in objects:
        for collection in list(obj.users_collection):
            collection.objects.unlink(obj)
        away.objects.link(obj)
    if how == "excluded":
        bpy.context.view_layer.layer_collection.children["Away"].exclude = True
    away.hide_viewport = how == "disabled collection"
    for obj in objects:
        obj.hide_viewport = how == "disabled object"
    bpy.context.view_layer.update()


@pytest.mark.parametrize("how", HIDING)
def test_a_body_that_hangs_on_a_moved_parent(plain, body, rig, boot, how):
    """Its own matrix is still that of the place where it was seen last."""
    plain(body, boot)
    expected = builders.dense(boot, figure.BONES)
    boot.vertex_groups.clear()
    boot.modifiers.clear()
    body.parent = rig
    put_away(how, body, rig)
    rig.location.x = boot.location.x = 5
    plain(body, boot)
    np.testing.assert_allclose(builders.dense(boot, figure.BONES), expected, atol=1e-5)
    assert [collection.name for collection in body.users_collection] == ["Away"]
    assert body.hide_viewport == (how == "disabled object")


@pytest.mark.parametrize("how", HIDING)
def test_the_list_of_objects_can_be_gone_through_afterwards(addon, body, how):
    """Blender frees the list when next it needs it: whoever is going through it then crashes."""
    put_away(how, body)
    for number in range(50):
        bpy.context.collection.objects.link(bpy.data.objects.new(f"Empty {number}", None))
    addon.scene.evaluation.bring_up_to_date([body])
    assert sum(obj.visible_get() for obj in bpy.context.view_layer.objects) > 50
    assert body not in [obj for obj in bpy.context.view_layer.objects if obj.visible_get()]


@pytest.mark.parametrize("how", HIDING)
def test_a_file_that_was_just_loaded(plain, body, boot, how, tmp_path):
    body.location.x = boot.location.x = body.modifiers[0].object.location.x = 5
    put_away(how, body)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "figure.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "figure.blend"))
    boot = bpy.data.objects["Boot"]
    plain(bpy.data.objects["Body"], boot)
    truth = figure.weights_at(figure.rest(boot) - [5, 0, 0])
    assert np.abs(builders.dense(boot, figure.BONES) - truth).mean() < 0.02


@pytest.mark.parametrize("how", ["excluded", "disabled object"])
def test_a_character_whose_weights_are_retargeted(addon, scene, how):
    rig, meshes = limb("Man", part=10)
    for obj in meshes:
        shares = truth(obj, 3.0)
        builders.paint(obj, **{name.replace(".", "__"): shares[:, j] for j, name in enumerate(ARM)})
    _, child = limb("Child", length=2.0, radius=0.25, around=16, along=30, at=(4, 1, 0), part=12)
    params = addon.retarget.RetargetParams()
    addon.retarget.retarget_weights(bpy.context, rig, child, params)
    expected = [builders.dense(obj, ARM) for obj in child]
    put_away(how, *meshes)
    for obj in (rig, *(obj for obj in meshes if obj.parent != rig)):
        obj.location.x += 7
    bpy.context.view_layer.update()
    addon.retarget.retarget_weights(bpy.context, rig, child, params)
    for obj, rows in zip(child, expected, strict=True):
        np.testing.assert_allclose(builders.dense(obj, ARM), rows, atol=1e-3)


def test_a_mesh_that_gets_automatic_weights(addon, boot, rig):
    boot.parent = rig
    addon.autoskin.automatic_weights([boot], rig, addon.autoskin.AutoskinParams())
    expected = builders.dense(boot, figure.BONES)
    boot.vertex_groups.clear()
    put_away("excluded", boot)
    rig.location.x = 5
    addon.autoskin.automatic_weights([boot], rig, addon.autoskin.AutoskinParams())
    np.testing.assert_allclose(builders.dense(boot, figure.BONES), expected, atol=1e-3)
