"""scene.armature: which armature, which bones, and where a modifier goes."""

import builders
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")


@pytest.fixture
def armature(addon, scene):
    return addon.scene.armature


def test_find(armature):
    obj, rig, other = builders.grid("Garment", 3), builders.rig("Rig"), builders.rig("Other")
    assert armature.find(obj) is None
    obj.parent = other
    assert armature.find(obj) is None
    obj.parent_type = "ARMATURE"
    assert armature.find(obj) == other
    obj.modifiers.new("Empty", "ARMATURE")
    off = obj.modifiers.new("Off", "ARMATURE")
    off.object, off.show_viewport = other, False
    obj.modifiers.new("Armature", "ARMATURE").object = rig
    assert armature.find(obj) == rig
    assert len(armature.modifiers(obj)) == 2


def test_bones(armature):
    rig = builders.rig()
    assert armature.deform_bones(rig) == {"Arm.L", "Arm.R"}
    builders.select(rig)
    bpy.ops.object.mode_set(mode="POSE")
    bpy.ops.pose.select_all(action="DESELECT")
    bone = rig.pose.bones["Arm.R"]
    (bone if hasattr(bone, "select") else bone.bone).select = True
    assert armature.selected_bones(rig) == {"Arm.R"}
    bpy.ops.object.mode_set(mode="OBJECT")


def test_is_posed(armature):
    rig = builders.rig()
    assert not armature.is_posed(rig)
    rig.pose.bones["Arm.R"].location.x = 1
    bpy.context.view_layer.update()
    assert armature.is_posed(rig)
    rig.data.pose_position = "REST"
    assert not armature.is_posed(rig)


def test_attach_goes_after_mirrors_and_before_the_rest(addon, armature):
    obj, rig = builders.grid("Garment", 3), builders.rig()
    for kind in ("MIRROR", "SUBSURF"):
        obj.modifiers.new(kind, kind)
    body = builders.body(3, rig)
    addon.scene.attaching.attach(obj, body)
    assert [m.type for m in obj.modifiers] == ["MIRROR", "ARMATURE", "SUBSURF"]
    assert armature.find(obj) == rig


def test_attach_takes_the_settings_of_the_sources_modifiers(addon, armature):
    """A body with two modifiers, each on a part of it, as some exporters make for fingers."""
    body, obj = builders.body(3), builders.grid("Garment", 3)
    rig = body.find_armature()
    first = body.modifiers[0]
    first.vertex_group, first.invert_vertex_group, first.use_deform_preserve_volume = "pin", True, True
    second = body.modifiers.new("Fingers", "ARMATURE")
    second.object, second.vertex_group, second.use_multi_modifier = rig, "pin", True
    builders.paint(obj, pin=0.5)
    addon.scene.attaching.attach(obj, body)
    settings = [[getattr(m, name) for name in armature.BINDING] for m in obj.modifiers]
    assert settings == [[getattr(m, name) for name in armature.BINDING] for m in body.modifiers]


def test_attach_to_a_body_that_is_only_parented(addon):
    body, obj = builders.body(3), builders.grid("Garment", 3)
    rig = body.find_armature()
    body.modifiers.clear()
    body.parent, body.parent_type = rig, "ARMATURE"
    addon.scene.attaching.attach(obj, body)
    assert [m.object for m in obj.modifiers] == [rig]


def test_rounding_of_an_importer_is_no_pose(armature):
    rig = builders.rig()
    rig.pose.bones["Arm.L"].rotation_quaternion = (1, 2e-6, 0, 0)
    bpy.context.view_layer.update()
    assert not armature.is_posed(rig)
    rig.pose.bones["Arm.L"].rotation_quaternion = (1, 2e-3, 0, 0)
    bpy.context.view_layer.update()
    assert armature.is_posed(rig)


def test_what_constraints_do_is_a_pose_too(armature):
    rig, goal = builders.rig(), bpy.data.objects.new("Goal", None)
    bpy.context.collection.objects.link(goal)
    rig.pose.bones["Arm.L"].constraints.new("COPY_LOCATION").target = goal
    goal.location = (0, 0, 1)
    bpy.context.view_layer.update()
    assert armature.is_posed(rig)
