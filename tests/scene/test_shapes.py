"""The three ways to look at a shape: what each takes in, and that looking leaves no trace."""

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")


@pytest.fixture
def shapes(addon, scene):
    return addon.scene.shapes


def target(shapes, obj, look):
    with shapes.looked_at([obj], look):
        return shapes.read_target(obj, look)


def source(shapes, obj, look, names=()):
    with shapes.looked_at([obj], look):
        return shapes.read_source(obj, look, list(names))


def raised(obj, value=0.5):
    """Give it a shape key that lifts it by `value`."""
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="Up")
    for point in key.data:
        point.co.z += 1
    key.value = value
    return key


def posed(obj, height=2):
    """Let a bone that is lifted carry it."""
    rig = builders.rig(bones=("a",))
    builders.paint(obj, a=1.0)
    obj.modifiers.new("Armature", "ARMATURE").object = rig
    rig.pose.bones["a"].location = (0, height, 0)
    bpy.context.view_layer.update()
    return rig


def displaced(obj):
    modifier = obj.modifiers.new("Displace", "DISPLACE")
    modifier.strength, modifier.mid_level = 1, 0
    return modifier


@pytest.mark.parametrize(("look", "height"), [("REST", 0), ("AS_SHOWN", 1.5), ("CURRENT", 3.5)])
def test_what_each_look_takes_in(shapes, look, height):
    """A shape key of a half, a modifier of one, a pose of two."""
    obj = builders.grid("Garment", 3)
    raised(obj)
    displaced(obj)
    rig = posed(obj)
    assert target(shapes, obj, look).geometry.positions[:, 2] == pytest.approx(height)
    assert source(shapes, obj, look)[0].geometry.positions[:, 2] == pytest.approx(height)
    assert rig.data.pose_position == "POSE" and rig.pose.bones["a"].location.y == 2


def test_the_place_in_the_world_is_that_of_the_rest_pose_too(shapes):
    """What hangs on a bone is looked at where the bone is at rest."""
    obj, rig = builders.grid("Button", 3), builders.rig(bones=("a",))
    obj.parent, obj.parent_type, obj.parent_bone = rig, "BONE", "a"
    bpy.context.view_layer.update()
    raised(obj, 0.25)
    at_rest = target(shapes, obj, "AS_SHOWN").geometry.positions
    rig.pose.bones["a"].location = (0, 2, 0)
    bpy.context.view_layer.update()
    assert target(shapes, obj, "AS_SHOWN").geometry.positions == pytest.approx(at_rest)
    assert np.ptp(target(shapes, obj, "CURRENT").geometry.positions - at_rest, axis=0) == pytest.approx(0, abs=1e-6)
    assert np.linalg.norm(target(shapes, obj, "CURRENT").geometry.positions[0] - at_rest[0]) == pytest.approx(2)


@pytest.mark.parametrize("kind", ["SUBSURF", "MIRROR", "SOLIDIFY", "ARRAY", "NODES", "DECIMATE", "MASK"])
def test_targets_keep_their_own_vertices(shapes, kind):
    """Modifiers that change the topology are switched off for the reading, and are on again afterwards."""
    obj = builders.grid("Garment", 4)
    displaced(obj)
    modifier = obj.modifiers.new("Changes", kind)
    off = obj.modifiers.new("Off", "SUBSURF")
    off.show_viewport = False
    geometry = target(shapes, obj, "AS_SHOWN").geometry
    assert len(geometry.positions) == 16
    assert geometry.positions[:, 2] == pytest.approx(1)
    assert modifier.show_viewport and not off.show_viewport


@pytest.mark.parametrize(("kind", "unseen"), [("SUBSURF", []), ("ARRAY", ["Changes"]), ("REMESH", ["Changes"])])
def test_a_shape_that_no_vertex_stands_for_is_named(shapes, kind, unseen):
    obj = builders.grid("Garment", 4)
    obj.modifiers.new("Changes", kind)
    assert target(shapes, obj, "AS_SHOWN").unseen == unseen


def test_sources_have_the_vertices_that_their_modifiers_leave(shapes):
    """Half a grid under a Mirror: the other half has the other side's weights."""
    obj = builders.grid("Body", 4)
    for vertex in obj.data.vertices:
        vertex.co.x += 1
    builders.paint(obj, Arm__L=0.75, Arm__R=np.nan)
    obj.modifiers.new("Mirror", "MIRROR")
    shape, rows = source(shapes, obj, "AS_SHOWN", ["Arm.L", "Arm.R"])
    x = shape.geometry.positions[:, 0]
    assert len(x) == 28 and x.min() == pytest.approx(-2) and len(rows.indptr) == 29
    of_left = {bool(x[i] > 1e-3): set(rows.bones[rows.indptr[i] : rows.indptr[i + 1]]) for i in range(28) if x[i]}
    assert of_left == {True: {0}, False: {1}}


def test_hidden_parts_of_a_source_are_left_out(shapes):
    obj = builders.grid("Body", 4)
    builders.paint(obj, hide=[1.0] * 8 + [np.nan] * 8)
    modifier = obj.modifiers.new("Mask", "MASK")
    modifier.vertex_group, modifier.invert_vertex_group = "hide", True
    shape, rows = source(shapes, obj, "AS_SHOWN", ["hide"])
    assert len(shape.geometry.positions) == 8 and not rows.values.size


@pytest.mark.parametrize("hidden", ["hide_viewport", "hide_set", "excluded"])
def test_hidden_objects_are_seen_all_the_same(shapes, hidden):
    obj = builders.grid("Garment", 3)
    displaced(obj)
    if hidden == "hide_viewport":
        obj.hide_viewport = True
    elif hidden == "hide_set":
        obj.hide_set(True)
    else:
        bpy.context.collection.objects.unlink(obj)
    bpy.context.view_layer.update()
    names = set(bpy.data.objects.keys())
    assert target(shapes, obj, "AS_SHOWN").geometry.positions[:, 2] == pytest.approx(1)
    assert source(shapes, obj, "AS_SHOWN")[0].geometry.positions[:, 2] == pytest.approx(1)
    assert set(bpy.data.objects.keys()) == names and not [o for o in bpy.data.objects if o.name != "Garment"]


@pytest.mark.parametrize(
    ("prepare", "used"),
    [
        (lambda obj, key: None, True),
        (lambda obj, key: setattr(key, "value", 0), False),
        (lambda obj, key: setattr(key, "mute", True), False),
        (lambda obj, key: (setattr(key, "value", 0), key.driver_add("value")), True),
        (lambda obj, key: (setattr(key, "value", 0), setattr(obj, "show_only_shape_key", True)), True),
    ],
    ids=["value", "zero", "muted", "driven", "pinned"],
)
def test_shape_keys_in_use(shapes, prepare, used):
    obj = builders.grid("Body", 3)
    key = raised(obj)
    obj.active_shape_key_index = 1
    prepare(obj, key)
    assert shapes.keys_in_use(obj) == used
