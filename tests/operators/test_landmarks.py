"""Landmarks: vertices that are picked and empties that are moved, down to what the library is told."""

import builders
import numpy as np
import pytest
from limbs import ARM, error_of, limb, truth

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


@pytest.fixture
def pair():
    """Source rig and its mesh with weights, target rig and its mesh; the source is picked."""
    man, (arm,) = limb("Man")
    shares = truth(arm, 3.0)
    builders.paint(arm, **{name.replace(".", "__"): shares[:, j] for j, name in enumerate(ARM)})
    _, (small,) = limb("Child", length=2.0, radius=0.25, at=(4, 1, 0))
    settings = bpy.context.scene.skinwright.retarget
    settings.source, settings.method = man, "BIHARMONIC"
    return arm, small


def pick(obj, vertex):
    builders.select(obj)
    obj.data.polygons.foreach_set("select", np.zeros(len(obj.data.polygons), bool))
    obj.data.edges.foreach_set("select", np.zeros(len(obj.data.edges), bool))
    obj.data.vertices.foreach_set("select", np.arange(len(obj.data.vertices)) == vertex)
    return bpy.ops.skinwright.landmark_pick()


def test_two_picked_vertices_are_one_landmark(pair):
    settings = bpy.context.scene.skinwright.retarget
    for k, (source, target) in enumerate([(0, 12), (120, 130)]):
        pick(pair[0], source)
        assert settings.landmarks[k].target is None
        pick(pair[1], target)
    assert settings.given_landmarks() == (("Man 0", 0, "Child 0", 12), ("Man 0", 120, "Child 0", 130))


def test_without_a_selected_vertex_nothing_is_added(pair):
    with pytest.raises(RuntimeError, match="Man 0 has no selected vertex"):
        pick(pair[0], -1)
    assert not bpy.context.scene.skinwright.retarget.landmarks


def test_empties_stand_for_the_nearest_vertex(pair, addon):
    settings = bpy.context.scene.skinwright.retarget
    builders.select(pair[1])
    assert bpy.ops.skinwright.landmark_add() == {"FINISHED"}
    entry = settings.landmarks[0]
    for obj, empty, vertex in ((pair[0], entry.source, 77), (pair[1], entry.target, 31)):
        empty.location = obj.matrix_world @ obj.data.vertices[vertex].co * 1.001
    bpy.context.view_layer.update()
    params = addon.retarget.RetargetParams(landmarks=settings.given_landmarks())
    read = addon.retarget.inputs.read_pair(bpy.context, settings.source, [pair[1]], params)
    assert read.landmarks.tolist() == [[77, 31]]


def test_removing_landmarks_removes_only_the_empties_that_were_made(pair):
    settings = bpy.context.scene.skinwright.retarget
    mine = bpy.data.objects.new("Mine", None)
    bpy.context.collection.objects.link(mine)
    builders.select(pair[1])
    bpy.ops.skinwright.landmark_add()
    bpy.ops.skinwright.landmark_add()
    settings.landmarks[0].source = mine
    bpy.ops.skinwright.landmark_remove(which="ALL")
    assert not settings.landmarks
    assert [obj.name for obj in bpy.data.objects if obj.type == "EMPTY"] == ["Landmark 1 Source", "Mine"]


def test_landmarks_reach_the_library_and_their_number_is_reported(pair, addon, monkeypatch):
    settings = bpy.context.scene.skinwright.retarget
    counts = []
    complete = addon.operators.retarget_weights.SKINWRIGHT_OT_retarget_weights.complete
    monkeypatch.setattr(
        addon.operators.retarget_weights.SKINWRIGHT_OT_retarget_weights,
        "complete",
        lambda self, context, report: counts.append(report.landmarks) or complete(self, context, report),
    )
    for with_landmarks in (False, True):
        if with_landmarks:
            for vertex in (0, 100, 250):
                pick(pair[0], vertex), pick(pair[1], vertex)
        builders.select(pair[1])
        assert bpy.ops.skinwright.retarget_weights(method="BIHARMONIC") == {"FINISHED"}
        assert error_of(pair[1], ARM, 2.0).mean() < 0.06
    assert counts[1] == counts[0] + 3
    assert settings.landmarks[0].name == "Landmark 1"


def test_a_landmark_on_a_foreign_mesh_is_a_sentence(pair):
    settings = bpy.context.scene.skinwright.retarget
    entry = settings.landmarks.add()
    cube = builders.grid("Cube", 2)
    entry.put("source", cube, 0)
    entry.put("target", pair[1], 0)
    builders.select(pair[1])
    with pytest.raises(RuntimeError, match="A landmark names Cube, which is neither an empty nor a mesh of Man Rig"):
        bpy.ops.skinwright.retarget_weights(method="BIHARMONIC")
