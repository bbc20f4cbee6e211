"""What is compared is what is seen: shape keys and modifiers of both meshes, without the pose."""

import builders
import figure
import numpy as np
import pytest
from transferring import said

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


def wrong_share(obj, truth):
    """Mean share of the weight that is on a wrong bone."""
    return np.abs(builders.dense(obj, figure.BONES) - truth).sum(1).mean() / 2


def grow(obj, scale, value=1.0):
    """A shape key that makes the figure taller, as the macros of character generators do."""
    obj.shape_key_add(name="Basis", from_mix=False)
    key = obj.shape_key_add(name="Tall", from_mix=False)
    for point in key.data:
        point.co.z *= scale
    key.value = value
    return key


@pytest.fixture
def tall():
    """A figure of 1.3 times its height by a shape key, its rig fitted to that; and trousers for it."""
    rig = figure.rig()
    builders.select(rig)
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in rig.data.edit_bones:
        bone.head.z, bone.tail.z = 1.3 * bone.head.z, 1.3 * bone.tail.z
    bpy.ops.object.mode_set(mode="OBJECT")
    body, trousers = figure.body(rig), figure.trousers()
    for vertex in trousers.data.vertices:
        vertex.co.z *= 1.3
    return body, trousers


TRUTH_TALL = [1, 1, 1.3]


@pytest.mark.parametrize("kind", ["value", "two keys", "driven", "pinned"])
def test_shape_keys_of_the_source(plain, tall, kind):
    body, trousers = tall
    key = grow(body, 1.3)
    if kind == "two keys":
        key.value = 0.5
        second = body.shape_key_add(name="Taller", from_mix=False)
        for mine, theirs in zip(second.data, key.data, strict=True):
            mine.co = theirs.co
        second.value = 0.5
    if kind == "driven":
        key.value = 0
        body["height"] = 1.0
        driver = key.driver_add("value").driver
        variable = driver.variables.new()
        variable.targets[0].id, variable.targets[0].data_path = body, '["height"]'
        driver.expression = variable.name
    if kind == "pinned":
        key.value = 0
        body.active_shape_key_index, body.show_only_shape_key = 1, True
    plain(body, trousers)
    assert wrong_share(trousers, figure.weights_at(figure.rest(trousers) / TRUTH_TALL)) < 0.02
    assert key.value == (0.5 if kind == "two keys" else key.value)


def test_rest_is_still_the_raw_mesh(plain, tall):
    body, trousers = tall
    grow(body, 1.3)
    plain(body, trousers, geometry="REST")
    assert wrong_share(trousers, figure.weights_at(figure.rest(trousers) / TRUTH_TALL)) > 0.1


def test_shape_keys_of_the_target(plain):
    """Trousers made for a small figure and fitted by a key."""
    body, trousers = figure.body(), figure.trousers()
    truth = figure.weights_at(figure.rest(trousers))
    for vertex in trousers.data.vertices:
        vertex.co.z *= 0.7
    grow(trousers, 1 / 0.7)
    plain(body, trousers)
    assert wrong_share(trousers, truth) < 0.03


@pytest.mark.parametrize("kind", ["LATTICE", "SIMPLE_DEFORM", "CAST"])
def test_modifiers_that_shape_the_source(plain, kind):
    """Whatever moves the body's surface, the garment is laid over the result."""
    body, trousers = figure.body(), figure.trousers()
    modifier = body.modifiers.new("Shape", kind)
    body.modifiers.move(1, 0)
    if kind == "LATTICE":
        cage = bpy.data.objects.new("Cage", bpy.data.lattices.new("Cage"))
        bpy.context.collection.objects.link(cage)
        cage.location, cage.scale = (0, 0, 0.5), (2, 2, 2)
        modifier.object = cage
        for point in cage.data.points:
            point.co_deform.z += 1
        offset = (0, 0, 2)
    elif kind == "SIMPLE_DEFORM":
        modifier.deform_method, modifier.deform_axis, modifier.factor = "STRETCH", "Z", 0.0
        offset = (0, 0, 0)
    else:
        modifier.factor = 0
        offset = (0, 0, 0)
    truth = figure.weights_at(figure.rest(trousers))
    trousers.location = offset
    bpy.context.view_layer.update()
    plain(body, trousers)
    assert wrong_share(trousers, truth) < 0.03


@pytest.mark.parametrize("kind", ["own plane", "object's plane", "bisected"])
def test_a_source_under_a_mirror(plain, kind):
    """Half a body, mirrored: the other leg has the other leg's bones."""
    whole = figure.body()
    half = figure.part(whole, "Half", lambda centre: centre[0] > 0)
    modifier = half.modifiers.new("Mirror", "MIRROR")
    if kind == "object's plane":
        centre = bpy.data.objects.new("Centre", None)
        bpy.context.collection.objects.link(centre)
        half.location.x, centre.location.x = 0, 0
        modifier.mirror_object = centre
    if kind == "bisected":
        modifier.use_bisect_axis[0] = True
    figure.bind(half, whole.modifiers[0].object)
    bpy.data.objects.remove(whole)
    trousers = figure.trousers()
    plain(half, trousers)
    rows, x = builders.dense(trousers, figure.BONES), figure.rest(trousers)[:, 0]
    assert rows[x < -0.03][:, [1, 2]].max() < 0.05 and rows[x > 0.03][:, [3, 4]].max() < 0.05
    assert wrong_share(trousers, figure.weights_at(figure.rest(trousers))) < 0.03


def test_what_a_mask_hides_is_no_source(plain):
    """A body whose right leg is hidden: nothing matches there."""
    body, trousers = figure.body(), figure.trousers()
    x = figure.rest(body)[:, 0]
    builders.paint(body, hidden=np.where(x < -0.01, 1.0, np.nan))
    modifier = body.modifiers.new("Mask", "MASK")
    modifier.vertex_group, modifier.invert_vertex_group = "hidden", True
    matched = plain(body, trousers).garments[0].matched
    assert matched < plain(figure.body(), figure.trousers("Other")).garments[0].matched / 1.8


def test_the_pose_takes_no_part(plain):
    """The same bits from a posed body and from one at rest; and the pose is as it was."""
    body, first, second = figure.body(), figure.trousers("First"), figure.trousers("Second")
    body.modifiers.new("Smooth", "SMOOTH").factor = 0
    plain(body, first, add_armature=False)
    figure.turn(body.find_armature(), "Leg.L", 40)
    before = body.find_armature().pose.bones["Leg.L"].matrix_basis.copy()
    report = plain(body, second, add_armature=False)
    assert builders.weights(first) == builders.weights(second)
    assert "is posed" in said(report)
    assert body.find_armature().pose.bones["Leg.L"].matrix_basis == before
    assert body.find_armature().data.pose_position == "POSE"


@pytest.mark.parametrize("kind", ["ARRAY", "CLOTH", "REMESH"])
def test_what_cannot_be_taken_into_account_is_named(plain, kind):
    body, trousers = figure.body(), figure.trousers()
    trousers.modifiers.new("Odd", kind)
    assert "modifier Odd of Trousers" in said(plain(body, trousers))
    assert trousers.modifiers["Odd"].show_viewport
