"""The operator: it writes what the native function answers, and respects what the artist has."""

import json

import builders
import figure
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")
BONES = figure.BONES


@pytest.fixture
def rig(scene):
    return figure.rig()


@pytest.fixture
def legs(rig):
    """A block with two legs, not bound to anything, moved and turned: the bones are in another object's space."""
    parts = []
    for x, z, size in ((0, 1.15, (0.4, 0.25, 0.35)), (0.12, 0.5, (0.15, 0.2, 1.0)), (-0.12, 0.5, (0.15, 0.2, 1.0))):
        bpy.ops.mesh.primitive_cylinder_add(vertices=16, radius=0.5, depth=1, location=(x, 0, z), scale=size)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.subdivide(number_cuts=6)
        bpy.ops.object.mode_set(mode="OBJECT")
        parts.append(bpy.context.object)
    builders.select(*parts)
    bpy.context.view_layer.objects.active = parts[0]
    bpy.ops.object.join()
    obj = bpy.context.object
    obj.name = "Legs"
    bpy.ops.object.transform_apply(location=True, rotation=True, scale=True)
    return obj


def run(obj, rig, **settings):
    builders.select(obj, rig)
    bpy.context.view_layer.objects.active = rig
    assert bpy.ops.skinwright.automatic_weights(**settings) == {"FINISHED"}


def arrays(obj, rig):
    """World positions, triangles and segments by a way of the test's own."""
    positions = np.array([vertex.co for vertex in obj.data.vertices], np.float32)
    obj.data.calc_loop_triangles()
    triangles = np.array([t.vertices[:] for t in obj.data.loop_triangles], np.uint32)
    into = obj.matrix_world.inverted() @ rig.matrix_world
    ends = [[into @ rig.data.bones[name].head_local, into @ rig.data.bones[name].tail_local] for name in BONES]
    return positions, triangles, np.array(ends, np.float32)


def test_the_result_is_the_native_functions(native, legs, rig):
    run(legs, rig, resolution=64)
    expected = native.automatic_weights(*arrays(legs, rig), [-1, 0, 1, 0, 3], resolution=64).weights.to_dense()
    np.testing.assert_allclose(np.nan_to_num(builders.dense(legs, BONES)), expected, atol=1e-6)
    assert [m.object for m in legs.modifiers if m.type == "ARMATURE"] == [rig]


@pytest.mark.parametrize("method", ["HEAT", "GEODESIC", "EUCLIDEAN"])
def test_every_vertex_is_weighted_and_sides_stay_apart(legs, rig, method):
    run(legs, rig, method=method, resolution=64)
    weights = np.nan_to_num(builders.dense(legs, BONES))
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-5)
    x, z = np.array([(v.co.x, v.co.z) for v in legs.data.vertices]).T
    foot = (z < 0.2) & (x > 0)
    assert weights[foot, BONES.index("Shin.L")].min() > 0.9
    assert weights[foot, BONES.index("Shin.R")].max() < 0.1


def test_locked_groups_keep_their_weights(legs, rig):
    z = np.array([vertex.co.z for vertex in legs.data.vertices])
    builders.paint(legs, Hips=np.where(z > 0.8, 0.25, np.nan), pin=0.5)
    legs.vertex_groups["Hips"].lock_weight = True
    run(legs, rig, resolution=64)
    weights = np.nan_to_num(builders.dense(legs, [*BONES, "pin"]))
    np.testing.assert_array_equal(weights[:, 0], np.where(z > 0.8, np.float32(0.25), 0))
    np.testing.assert_allclose(weights[:, :5].sum(axis=1), 1, atol=1e-5)
    assert (weights[:, 5] == 0.5).all()


def test_only_selected_vertices_change(legs, rig):
    builders.paint(legs, Hips=1.0)
    for vertex in legs.data.vertices:
        vertex.select = vertex.co.z < 0.5
    run(legs, rig, selected_only=True, resolution=64)
    selected = np.array([vertex.select for vertex in legs.data.vertices])
    weights = np.nan_to_num(builders.dense(legs, BONES))
    assert (weights[~selected] == [1, 0, 0, 0, 0]).all()
    assert weights[selected, 0].max() < 0.5


def test_refusals_are_sentences_and_write_nothing(legs, rig):
    for bone in rig.data.bones:
        bone.use_deform = False
    with pytest.raises(RuntimeError, match="has no bone that deforms Legs"):
        run(legs, rig)
    assert not legs.vertex_groups and not legs.modifiers
    builders.select(legs)
    with pytest.raises(RuntimeError, match="Legs has no armature"):
        bpy.ops.skinwright.automatic_weights()


def test_the_command_does_the_same(addon, legs, rig, tmp_path, capsys):
    report = tmp_path / "report.json"
    arguments = ["autoskin", "--target", "Legs", "--armature", rig.name, "--resolution", "64", "--report", str(report)]
    assert addon.headless.command_line.main(arguments) == 0
    weights = np.nan_to_num(builders.dense(legs, BONES))
    run(legs, rig, resolution=64)
    np.testing.assert_array_equal(np.nan_to_num(builders.dense(legs, BONES)), weights)
    assert f"{len(legs.data.vertices)} vertices have weights for 5 bones" in capsys.readouterr().out
    assert json.loads(report.read_text())["meshes"][0]["bones"] == 5
    assert addon.headless.command_line.main(["autoskin", "--target", "Nobody"]) == 1
