"""Each fault is found where it was made, and only there; poses, frames and weights are as before."""

import json
import math

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")


@pytest.fixture
def garment(scene):
    """A grid half a unit above a body that bends in the middle; the same weights on both."""
    rig = builders.rig(bones=("Left", "Right"), controls=())
    for bone, x in (("Left", -1), ("Right", 0)):
        bpy.context.view_layer.objects.active = rig
        bpy.ops.object.mode_set(mode="EDIT")
        edit_bone = rig.data.edit_bones[bone]
        edit_bone.head, edit_bone.tail = (x, 0, 0), (x + 1, 0, 0)
        bpy.ops.object.mode_set(mode="OBJECT")
    objects = []
    for name, z in (("Body", 0.0), ("Coat", 0.05)):
        obj = builders.grid(name, 11, z=z)
        t = np.clip(np.array([v.co.x for v in obj.data.vertices]) * 2 + 0.5, 0, 1)
        builders.paint(obj, Left=np.where(t < 1, 1 - t, np.nan), Right=np.where(t > 0, t, np.nan))
        obj.modifiers.new("Armature", "ARMATURE").object = rig
        objects.append(obj)
    scene.skinwright.transfer.source = objects[0]
    builders.select(objects[1])
    return objects[1]


def check(tmp_path, **settings):
    path = tmp_path / "check.json"
    assert bpy.ops.skinwright.check_weights(filepath=str(path), **settings) == {"FINISHED"}
    (result,) = json.loads(path.read_text())
    return result


def faulty(result):
    return {name: fault["first"] for name, fault in result["faults"].items() if fault["vertices"]}


def test_good_weights_have_no_numeric_fault(garment, tmp_path):
    assert not {"unweighted", "unnormalised", "over_limit", "torn"} & faulty(check(tmp_path)).keys()


def test_faults_of_numbers(garment, tmp_path):
    garment.vertex_groups["Left"].remove([0])
    garment.vertex_groups["Left"].add([1], 0.5, "REPLACE")
    for name in "abcd":
        garment.vertex_groups.new(name=name)
    found = faulty(check(tmp_path, max_influences=1))
    assert found["unweighted"] == [0]
    assert found["unnormalised"] == [1]
    x = np.array([v.co.x for v in garment.data.vertices])
    assert found["over_limit"] == np.flatnonzero(np.abs(x) < 0.24).tolist()


def test_a_vertex_left_behind_tears_its_edges(garment, tmp_path):
    garment.vertex_groups["Right"].remove([10])
    garment.vertex_groups["Left"].add([10], 1.0, "REPLACE")
    found = faulty(check(tmp_path, angle=math.radians(90)))
    assert found["torn"] == [9, 10, 21]


def test_penetration_is_measured_against_rest(garment, tmp_path):
    """A sheet of other weights than the body below it goes through the body where that bends away."""
    assert "penetrating" not in faulty(check(tmp_path, angle=math.radians(20)))
    for index in range(len(garment.data.vertices)):
        garment.vertex_groups["Right"].remove([index])
        garment.vertex_groups["Left"].add([index], 1.0, "REPLACE")
    assert "penetrating" in faulty(check(tmp_path, angle=math.radians(20)))


def test_the_offenders_are_selected(garment, tmp_path):
    garment.vertex_groups["Left"].remove([0, 11])
    check(tmp_path, select="UNWEIGHTED")
    assert [v.index for v in garment.data.vertices if v.select] == [0, 11]
    assert [tuple(sorted(e.vertices)) for e in garment.data.edges if e.select] == [(0, 11)]


def test_pose_and_weights_are_as_before(garment, tmp_path):
    bone = bpy.data.objects["Rig"].pose.bones["Right"]
    bone.rotation_mode, bone.rotation_euler, bone.location = "XYZ", (0.1, 0.2, 0.3), (0.01, 0, 0)
    before = tuple(bone.rotation_euler), tuple(bone.location), tuple(bone.rotation_quaternion), tuple(bone.scale)
    weights = builders.weights(garment)
    assert len(check(tmp_path)["poses"]) == 5
    assert (*map(tuple, (bone.rotation_euler, bone.location, bone.rotation_quaternion, bone.scale)),) == before
    assert builders.weights(garment) == weights


def test_keyframes(garment, tmp_path):
    bone = bpy.data.objects["Rig"].pose.bones["Right"]
    bone.rotation_mode = "XYZ"
    for frame, angle in ((1, 0.0), (10, 1.0), (25, -1.0)):
        bone.rotation_euler[2] = angle
        bone.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_set(7)
    result = check(tmp_path, poses="ACTION")
    assert [pose["pose"] for pose in result["poses"]] == ["frame 1", "frame 10", "frame 25"]
    assert bpy.context.scene.frame_current == 7


def test_without_keyframes_or_armature_it_says_so(garment):
    with pytest.raises(RuntimeError, match="no keyframes"):
        bpy.ops.skinwright.check_weights(poses="ACTION")
    garment.modifiers.clear()
    with pytest.raises(RuntimeError, match="no armature"):
        bpy.ops.skinwright.check_weights()


def test_a_report_never_costs_a_file(garment, tmp_path):
    blend, other = tmp_path / "open.blend", tmp_path / "other.json"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    other.write_text('{"mine": 1}')
    before = blend.read_bytes()
    with pytest.raises(RuntimeError, match="used twice"):
        bpy.ops.skinwright.check_weights(filepath=str(blend), overwrite=True)
    with pytest.raises(RuntimeError, match="is not a report"):
        bpy.ops.skinwright.check_weights(filepath=str(other))
    assert blend.read_bytes() == before and other.read_text() == '{"mine": 1}'
    bpy.ops.skinwright.check_weights(filepath=str(other), overwrite=True)
    assert len(check(tmp_path)["poses"]) == len(check(tmp_path)["poses"])  # our own is replaced


def test_the_limit_is_that_of_the_transfer(garment, tmp_path):
    garment.vertex_groups["Left"].add(range(121), 0.5, "REPLACE")
    garment.vertex_groups["Right"].add(range(121), 0.5, "REPLACE")
    for limit, found in ((0, 0), (1, 121), (2, 0)):
        bpy.context.scene.skinwright.transfer.max_influences = limit
        assert check(tmp_path)["faults"]["over_limit"]["vertices"] == found
