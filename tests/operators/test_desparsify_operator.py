"""The desparsify operator: members of weight 0, locks, groups that are no bones, subsets, refusals."""

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")
BONES = ("Arm.L", "Arm.R", "Leg.L", "Leg.R", "Head")


@pytest.fixture
def body(scene):
    """A grid that follows one bone a vertex, Head on the way to nobody; group `pin` is no bone, Control deforms not."""
    rig = builders.rig(bones=BONES)
    obj = builders.grid("Body", 10)
    x, y = np.array([vertex.co[:2] for vertex in obj.data.vertices]).T
    quarter = (x > 0) + 2 * (y > 0)
    only = np.where(quarter[:, None] == np.arange(4), 1.0, np.nan)
    builders.paint(obj, **{name.replace(".", "__"): only[:, j] for j, name in enumerate(BONES[:4])}, pin=x * x / 2)
    builders.paint(obj, Control=np.where(x > 0, 0.7, np.nan))
    obj.modifiers.new("Armature", "ARMATURE").object = rig
    builders.select(obj)
    return obj


def members(obj):
    """Names of the deform bones of each vertex."""
    return [{name for name in row if name in BONES} for row in builders.weights(obj)]


@pytest.mark.parametrize("method", ["SURFACE", "HOP"])
@pytest.mark.parametrize("n", [2, 4])
def test_every_vertex_gets_n_bones_and_the_shape_stays(body, method, n):
    before = builders.weights(body)
    assert bpy.ops.skinwright.desparsify(n=n, method=method) == {"FINISHED"}
    after = builders.weights(body)
    assert all(len(row) == n for row in members(body)) or method == "HOP"
    for old, new in zip(before, after, strict=True):
        assert {name: new[name] for name in old} == old
        assert all(new[name] == 0 for name in new.keys() - old.keys())


def test_surface_gives_the_nearest_regions(body):
    bpy.ops.skinwright.desparsify(n=2)
    obj = body
    corner = np.argmin([vertex.co.x + vertex.co.y / 4 for vertex in obj.data.vertices])
    assert members(obj)[corner] == {"Arm.L", "Leg.L"} or members(obj)[corner] == {"Arm.L", "Arm.R"}
    middle_left = np.argmin([abs(vertex.co.x + 1) + abs(vertex.co.y + 0.1) for vertex in obj.data.vertices])
    assert members(obj)[middle_left] == {"Arm.L", "Leg.L"}


def test_surplus_is_dropped_smallest_first_and_the_rest_fills_up(body):
    builders.paint(body, Head=np.where(np.arange(100) < 50, 0.25, np.nan))
    body.vertex_groups["Head"].lock_weight = False
    bpy.ops.skinwright.desparsify(n=1)
    assert all(len(row) == 1 for row in members(body))
    assert all(row["Arm.L"] == 1 for row in builders.weights(body) if "Arm.L" in row)


def test_locked_groups_keep_their_weights_and_gain_nobody(body):
    builders.paint(body, Head=np.where(np.arange(100) < 50, 0.25, np.nan))
    body.vertex_groups["Head"].lock_weight = True
    before = builders.dense(body, ["Head"])
    bpy.ops.skinwright.desparsify(n=4)
    np.testing.assert_array_equal(builders.dense(body, ["Head"]), before)
    assert sum("Head" in row for row in members(body)) == 50
    np.testing.assert_allclose(builders.dense(body, BONES).sum(axis=1), 1, atol=1e-6)


def test_only_selected_vertices(body):
    chosen = np.arange(100) % 3 == 0
    body.data.vertices.foreach_set("select", chosen)
    before = builders.weights(body)
    bpy.ops.skinwright.desparsify(n=3, subset="SELECTED")
    after = builders.weights(body)
    assert all((old == new) == (not touched) for old, new, touched in zip(before, after, chosen, strict=True))


def test_from_edit_and_weight_paint_mode(body):
    for mode in ("EDIT", "WEIGHT_PAINT"):
        bpy.ops.object.mode_set(mode=mode)
        n = 3 if mode == "EDIT" else 4
        assert bpy.ops.skinwright.desparsify(n=n) == {"FINISHED"}
        assert bpy.context.object.mode == mode
        bpy.ops.object.mode_set(mode="OBJECT")
        assert all(len(row) == n for row in members(body))


def test_the_active_group_stays_active_and_missing_groups_come(body):
    body.vertex_groups.remove(body.vertex_groups["Leg.R"])
    body.vertex_groups.active_index = 1
    bpy.ops.skinwright.desparsify(n=5)
    assert body.vertex_groups.active_index == 1
    assert set(BONES) - {"Leg.R", "Head"} <= {group.name for group in body.vertex_groups}


def test_refusals_write_nothing(body):
    before = builders.weights(body)
    body.modifiers.clear()
    with pytest.raises(RuntimeError, match="Body has no armature to take bones from"):
        bpy.ops.skinwright.desparsify()
    rig = bpy.data.objects["Rig"]
    body.modifiers.new("Armature", "ARMATURE").object = rig
    for bone in rig.data.bones:
        bone.use_deform = False
    with pytest.raises(RuntimeError, match="Rig, which deforms Body, has no bone that deforms"):
        bpy.ops.skinwright.desparsify()
    for bone in rig.data.bones:
        bone.use_deform = True
    body.data.clear_geometry()
    body.data.from_pydata([(0, 0, 0), (1, 0, 0)], [(0, 1)], [])
    with pytest.raises(RuntimeError, match="Body has no faces"):
        bpy.ops.skinwright.desparsify()
    assert len(before) == 100
    builders.select(rig)
    with pytest.raises(RuntimeError, match="Select the meshes to desparsify"):
        bpy.ops.skinwright.desparsify()
