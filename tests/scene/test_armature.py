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


def test_attach_goes_after_mirrors_and_before_the_rest(armature):
    obj, rig = builders.grid("Garment", 3), builders.rig()
    for kind in ("MIRROR", "SUBSURF"):
        obj.modifiers.new(kind, kind)
    armature.attach(obj, rig)
    assert [m.type for m in obj.modifiers] == ["MIRROR", "ARMATURE", "SUBSURF"]
    assert armature.find(obj) == rig
