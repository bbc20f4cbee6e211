"""Mirrored strokes and masks, the explanation of a vertex, stepping through poses, the panel's last result."""

from importlib import import_module

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
mathutils = pytest.importorskip("mathutils", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")
PACKAGE = "bl_ext.user_default.skinwright"
BONES = ("Hip", "Leg.L", "Leg.R", "Foot.L", "Foot.R")


@pytest.fixture
def rig(scene):
    """Two legs along x, the left one bent, the right one straight."""
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    scene.collection.objects.link(rig)
    builders.select(rig)
    bpy.ops.object.mode_set(mode="EDIT")
    ends = {"Hip": (0, 0.1), "Leg.L": (0.2, 0.6), "Leg.R": (-0.2, -0.6), "Foot.L": (0.6, 1), "Foot.R": (-0.6, -1)}
    for name, (head, tail) in ends.items():
        bone = rig.data.edit_bones.new(name)
        bone.head, bone.tail = (head, 0, 0), (tail, 0, 0)
        parent = {"L": "Leg.L" if name[0] == "F" else "Hip", "R": "Leg.R" if name[0] == "F" else "Hip"}.get(name[-1])
        bone.parent = rig.data.edit_bones.get(parent) if parent else None
    bpy.ops.object.mode_set(mode="OBJECT")
    turn = mathutils.Matrix.Rotation(np.radians(50), 4, "X")
    rig.pose.bones["Foot.L"].matrix_basis = turn
    bpy.context.view_layer.update()
    return rig


@pytest.fixture
def body(rig):
    obj = builders.grid("Body", 13)
    x = np.array([vertex.co.x for vertex in obj.data.vertices])
    shares = {"Hip": 1.2 - np.abs(x), "Leg.L": (x + 0.4).clip(0), "Leg.R": (0.4 - x).clip(0)}
    shares |= {"Foot.L": (x - 0.1).clip(0), "Foot.R": (-x - 0.1).clip(0)}
    total = sum(shares.values())
    builders.paint(obj, **{name.replace(".", "__"): share / total for name, share in shares.items()})
    obj.modifiers.new("Armature", "ARMATURE").object = rig
    builders.select(obj)
    return obj


def rest(obj):
    return np.array([vertex.co for vertex in obj.data.vertices], np.float32)


def posed(obj):
    bpy.context.view_layer.update()
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return np.array([vertex.co for vertex in evaluated.vertices], np.float32)


def mirrored(weights):
    return weights[:, [0, 2, 1, 4, 3]]


def test_a_mirrored_stroke_leaves_both_sides_alike(body):
    """Though only the left leg is bent."""
    session_module = import_module(f"{PACKAGE}.sculpt.session")
    partner = import_module(f"{PACKAGE}.scene.symmetry").partners(rest(body))
    assert (partner >= 0).all() and (partner[partner] == np.arange(169)).all()
    before = builders.dense(body, BONES)
    session = session_module.SculptSession(body, session_module.SculptOptions(mirror=True))
    session.open()
    touched = np.flatnonzero((rest(body)[:, 0] > 0.5) & (rest(body)[:, 1] > 0)).astype(np.uint32)
    states = [builders.dense(body, BONES)]
    for offset in ((0, 0.02, 0.05), (0, 0.03, -0.02)):
        session.sculpt(touched, posed(body)[touched] + np.array(offset, np.float32))
        states.append(builders.dense(body, BONES))
        np.testing.assert_allclose(states[-1][partner], mirrored(states[-1]), atol=2e-6)
    assert np.abs(states[1] - before)[partner[touched]].max() > 0.01
    assert session.stroke_count == 2
    assert session.undo() and session.stroke_count == 1
    np.testing.assert_array_equal(builders.dense(body, BONES), states[1])
    assert session.redo()
    np.testing.assert_array_equal(builders.dense(body, BONES), states[2])
    assert session.undo() and session.undo() and not session.undo()
    np.testing.assert_array_equal(builders.dense(body, BONES), states[0])


def test_without_the_other_sides_bones_mirroring_is_refused(body):
    session_module = import_module(f"{PACKAGE}.sculpt.session")
    body.vertex_groups.remove(body.vertex_groups["Foot.R"])
    with pytest.raises(ValueError, match="Not every bone of Body has its other side"):
        session_module.SculptSession(body, session_module.SculptOptions(mirror=True))


@pytest.mark.parametrize(("action", "side"), [("MIRROR_POSITIVE", 1), ("MIRROR_NEGATIVE", -1)])
def test_a_mirrored_mask(scene, body, action, side):
    source = builders.grid("Source", 4)
    builders.paint(source, Hip=1.0)
    scene.skinwright.transfer.source = source
    builders.select(body)
    group = body.vertex_groups.new(name="Match Mask")
    body.skinwright.mask_group = group.name
    values = np.random.default_rng(1).random(169).astype(np.float32)
    for i, value in enumerate(values.tolist()):
        group.add([i], value, "REPLACE")
    assert bpy.ops.skinwright.edit_match_mask(action=action) == {"FINISHED"}
    found = builders.dense(body, ["Match Mask"])[:, 0]
    place = {tuple(np.round(position, 4)): i for i, position in enumerate(rest(body))}
    for (x, y, z), i in place.items():
        there = place[tuple(np.round((-x, y, z), 4) + 0.0)] if x else i
        assert found[i] == values[there if x * side < 0 else i]


class TestWhy:
    """One vertex near, one far, one that faces away, one masked."""

    @pytest.fixture
    def coat(self, scene, body, rig):
        scene.skinwright.transfer.source = body
        rig.data.pose_position = "REST"
        coat = builders.grid("Coat", 5)
        for vertex in coat.data.vertices:
            vertex.co.z = 0.01 if vertex.co.x < 0.4 else 0.9
        builders.paint(coat, Hip=0.75, Foot__L=0.25)
        coat.modifiers.new("Armature", "ARMATURE").object = rig
        builders.select(coat)
        return coat

    def ask(self, coat, vertex):
        for other in coat.data.vertices:
            other.select = other.index == vertex
        assert bpy.ops.skinwright.explain_vertex() == {"FINISHED"}
        return import_module(f"{PACKAGE}.match.explain").current

    def test_near_and_far(self, coat):
        near, far = (min(range(25), key=lambda i: s * coat.data.vertices[i].co.x) for s in (1, -1))
        found = self.ask(coat, near)
        assert found.vertex == near and "it matches" in found.verdict
        assert found.distance == pytest.approx(0.01, abs=1e-5)
        np.testing.assert_allclose(np.subtract(found.position, found.closest), (0, 0, 0.01), atol=1e-5)
        assert found.weights == [("Hip", 0.75), ("Foot.L", 0.25)]
        found = self.ask(coat, far)
        assert "0.9 from the source, and Distance allows" in found.verdict
        reporting = import_module(f"{PACKAGE}.reporting")
        assert reporting.last.title == "Why?" and "Follows Hip 0.750, Foot.L 0.250" in reporting.last.facts

    def test_the_mask(self, coat):
        group = coat.vertex_groups.new(name="M")
        group.add([3], 0.0, "REPLACE")
        coat.skinwright.mask_group = "M"
        assert self.ask(coat, 3).verdict == "the mask says to inpaint"

    def test_the_worst_bend_is_the_one_blender_shows_too(self, coat, rig):
        """Weights that change from bone to bone: the bend named stretches an edge as far as Blender's does."""
        rng = np.random.default_rng(2)
        coat.vertex_groups.clear()
        foot = rng.random(25)
        builders.paint(coat, Hip=1 - foot, Foot__L=foot)
        found = self.ask(coat, 12).worst
        assert found.startswith("Foot.L turned by ") and "times as long" in found
        rig.data.pose_position = "POSE"
        degrees, axis = int(found.split("by ")[1].split("°")[0]), found.split("about ")[1][0]
        head = rig.data.bones["Foot.L"].head_local
        turn = mathutils.Matrix.Rotation(np.radians(degrees), 4, axis)
        about = mathutils.Matrix.Translation(head) @ turn @ mathutils.Matrix.Translation(-head)
        rig.pose.bones["Foot.L"].matrix = about @ rig.data.bones["Foot.L"].matrix_local
        before, after = rest(coat), posed(coat)
        edges = [edge.vertices[:] for edge in coat.data.edges if 12 in edge.vertices]
        ratio = [np.linalg.norm(after[a] - after[b]) / np.linalg.norm(before[a] - before[b]) for a, b in edges]
        worst = max(ratio, key=lambda r: abs(np.log(r)))
        assert float(found.split("gets ")[1].split(" ")[0]) == pytest.approx(worst, abs=0.006)

    def test_nothing_selected(self, coat):
        for vertex in coat.data.vertices:
            vertex.select = False
        with pytest.raises(RuntimeError, match="No vertex of Coat is selected"):
            bpy.ops.skinwright.explain_vertex()


def test_stepping_through_keyed_poses(scene, body, rig):
    for frame in (3, 10, 24):
        rig.pose.bones["Leg.L"].keyframe_insert("rotation_quaternion", frame=frame)
    scene.frame_set(5)
    seen = []
    for step in (1, 1, 1, -1, -1):
        bpy.ops.skinwright.step_pose(step=step)
        seen.append(scene.frame_current)
    assert seen == [10, 24, 3, 24, 10]


def test_the_source_is_picked_by_being_active(scene, body):
    assert bpy.ops.skinwright.active_as_source() == {"FINISHED"}
    assert scene.skinwright.transfer.source == body
    body.vertex_groups.clear()
    assert not bpy.ops.skinwright.active_as_source.poll()


def test_an_overlay_that_cannot_be_shown_says_why(scene, body):
    reporting = import_module(f"{PACKAGE}.reporting")
    scene.skinwright.transfer.source = None
    with pytest.raises(RuntimeError, match="Pick the body"):
        bpy.ops.skinwright.show_overlay(kind="MATCH")
    assert reporting.last.failed and scene.skinwright.overlay.kind == "NONE"
    bpy.ops.skinwright.show_overlay(kind="STRETCH")
    assert scene.skinwright.overlay.kind == "STRETCH"
    bpy.ops.skinwright.forget_result()
    assert reporting.last is None
