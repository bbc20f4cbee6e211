"""The operator: it writes what the native function answers, and respects what the artist has."""

import json

import builders
import figure
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
KDTree = pytest.importorskip("mathutils.kdtree", reason="needs the bpy wheel").KDTree

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


def test_selected_bones_are_written_and_the_others_make_room(legs, rig):
    run(legs, rig, resolution=64)
    full = np.nan_to_num(builders.dense(legs, BONES))
    legs.vertex_groups.clear()
    builders.paint(legs, Hips=0.75, Shin__R=0.25)
    for bone in rig.data.bones:
        builders.select_bone(rig, bone.name, bone.name in ("Leg.L", "Shin.L"))
    run(legs, rig, selected_bones=True, resolution=64)
    weights = np.nan_to_num(builders.dense(legs, BONES))
    np.testing.assert_allclose(weights[:, 1:3], full[:, 1:3], atol=1e-5)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-5)
    rest = 1 - full[:, 1:3].sum(axis=1)
    # The limit of four cuts nothing here: the old rows have two bones, the new ones two.
    np.testing.assert_allclose(weights[:, 0], 0.75 * rest, atol=1e-5)
    np.testing.assert_allclose(weights[:, 4], 0.25 * rest, atol=1e-5)


def test_a_mask_says_how_much_is_taken(legs, rig):
    run(legs, rig, resolution=64)
    full = np.nan_to_num(builders.dense(legs, BONES))
    legs.vertex_groups.clear()
    z = np.array([vertex.co.z for vertex in legs.data.vertices])
    share = np.where(z < 0.3, 1, np.where(z < 0.6, 0.5, 0))
    builders.paint(legs, Hips=1.0, Area=np.where(share > 0, share, np.nan))
    run(legs, rig, mask_group="Area", max_influences=0, resolution=64)
    weights = np.nan_to_num(builders.dense(legs, BONES))
    expected = share[:, None] * full + (1 - share)[:, None] * [1, 0, 0, 0, 0]
    np.testing.assert_allclose(weights, expected, atol=2e-4)
    np.testing.assert_array_equal(weights[share == 0], np.broadcast_to([1, 0, 0, 0, 0], ((share == 0).sum(), 5)))
    builders.select(legs, rig)
    with pytest.raises(RuntimeError, match="Legs has no vertex group Nothing to use as mask"):
        bpy.ops.skinwright.automatic_weights(mask_group="Nothing")


def test_mix_keeps_a_part_of_the_old_weights(legs, rig):
    run(legs, rig, resolution=64)
    full = np.nan_to_num(builders.dense(legs, BONES))
    legs.vertex_groups.clear()
    builders.paint(legs, Hips=1.0)
    run(legs, rig, mix_factor=0.25, max_influences=0, resolution=64)
    weights = np.nan_to_num(builders.dense(legs, BONES))
    np.testing.assert_allclose(weights, 0.25 * full + 0.75 * np.array([1, 0, 0, 0, 0]), atol=2e-4)


def test_symmetrize_makes_both_sides_alike(legs, rig):
    """Also if the rig itself is crooked."""
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    rig.data.edit_bones["Shin.L"].tail.y -= 0.1
    bpy.ops.object.mode_set(mode="OBJECT")
    run(legs, rig, resolution=64)
    partner = _nearest(legs, _points(legs) * [-1, 1, 1])
    mirrored = [0, 3, 4, 1, 2]
    crooked = np.nan_to_num(builders.dense(legs, BONES))
    assert np.abs(crooked[partner][:, mirrored] - crooked).max() > 1e-3
    run(legs, rig, symmetrize=True, resolution=64)
    weights = np.nan_to_num(builders.dense(legs, BONES))
    np.testing.assert_allclose(weights[partner][:, mirrored], weights, atol=1e-6)
    assert np.count_nonzero(weights, axis=1).max() <= 4


def _points(obj):
    return np.array([vertex.co for vertex in obj.data.vertices])


def _nearest(obj, places):
    """(n,) the vertices nearest to places (n, 3)."""
    tree = KDTree(len(obj.data.vertices))
    for vertex in obj.data.vertices:
        tree.insert(vertex.co, vertex.index)
    tree.balance()
    return np.array([tree.find(place)[1] for place in places])


def test_half_a_mesh_under_mirror_gets_the_whole_ones_weights(rig):
    """The half's border is no edge of the body, and the other side's bones are its own mirrored."""
    positions, faces = figure.joined(figure.tube(0, 0.9, 1.4, 0.25), figure.tube(0.12, 0, 0.95, 0.1))
    mirrored, other = figure.joined(figure.tube(-0.12, 0, 0.95, 0.1))
    right = mirrored[:, 0]
    whole = builders.mesh("Whole", np.concatenate([positions, mirrored]), faces + _shifted(other, len(positions)))
    assert right.max() < 0
    half = builders.mesh("Half", *_half(positions, faces))
    modifier = half.modifiers.new("Mirror", "MIRROR")
    modifier.merge_threshold = 1e-4
    run(whole, rig, resolution=64)
    run(half, rig, resolution=64)
    assert [m.type for m in half.modifiers] == ["MIRROR", "ARMATURE"]
    ours, theirs = (np.nan_to_num(builders.dense(obj, BONES)) for obj in (half, whole))
    same = _nearest(whole, _points(half))
    np.testing.assert_allclose(ours, theirs[same], atol=0.02)
    middle = np.abs([vertex.co.x for vertex in half.data.vertices]) < 1e-6
    np.testing.assert_allclose(ours[middle][:, [3, 4]], ours[middle][:, [1, 2]], atol=1e-5)


def _shifted(faces, start):
    return [[i + start for i in face] for face in faces]


def _half(positions, faces):
    """What lies at x >= 0."""
    kept = np.flatnonzero(positions[:, 0] > -1e-6)
    number = {int(i): k for k, i in enumerate(kept)}
    inner = [[number[i] for i in face] for face in faces if all(i in number for i in face)]
    return positions[kept] * np.where(np.abs(positions[kept, :1]) < 1e-6, [0, 1, 1], 1), inner


def test_meshes_that_continue_each_other_do_not_part(rig):
    """A leg cut in two objects: the copies of the cut's vertices move alike."""
    positions, faces = figure.tube(0.12, 0, 1.0, 0.1)
    z = positions[:, 2]
    parts = []
    for name, kept in (("Upper", z > 0.499), ("Lower", z < 0.501)):
        number = {int(i): k for k, i in enumerate(np.flatnonzero(kept))}
        inner = [[number[i] for i in face] for face in faces.tolist() if all(i in number for i in face)]
        parts.append(builders.mesh(name, positions[kept], inner))
    builders.select(*parts, rig)
    bpy.ops.skinwright.automatic_weights(resolution=64)
    upper, lower = (np.nan_to_num(builders.dense(obj, BONES)) for obj in parts)
    cut = [[v.index for v in obj.data.vertices if abs(v.co.z - 0.5) < 1e-4] for obj in parts]
    assert len(cut[0]) == 24
    np.testing.assert_array_equal(upper[cut[0]], lower[cut[1]])


def test_the_shape_that_is_shown_counts(native, legs, rig):
    """A shape key in use makes the legs what the bones were laid into; the pose does not count."""
    legs.shape_key_add(name="Basis")
    key = legs.shape_key_add(name="Tall")
    for vertex, point in zip(legs.data.vertices, key.data, strict=True):
        point.co = vertex.co * 1.4
    key.value = 1
    rig.scale = (1.4, 1.4, 1.4)
    rig.pose.bones["Leg.L"].rotation_mode = "XYZ"
    rig.pose.bones["Leg.L"].rotation_euler.x = 0.5
    bpy.context.view_layer.update()
    positions, triangles, segments = arrays(legs, rig)
    run(legs, rig, resolution=64)
    expected = native.automatic_weights(positions * 1.4, triangles, segments, [-1, 0, 1, 0, 3], resolution=64)
    off = np.abs(np.nan_to_num(builders.dense(legs, BONES)) - expected.weights.to_dense())
    assert np.percentile(off, 99) < 1e-3 and off.max() < 0.05  # a tie may fall either way
    run(legs, rig, geometry="REST", resolution=64)
    assert np.abs(np.nan_to_num(builders.dense(legs, BONES)) - expected.weights.to_dense()).max() > 0.1


def test_the_armature_carries_what_it_was_given(legs, rig):
    rig.location = (0.3, 0, 0)
    bpy.context.view_layer.update()
    before = legs.matrix_world.copy()
    run(legs, rig, resolution=64)
    bpy.context.view_layer.update()
    assert legs.parent == rig and legs.matrix_world == before
    legs.parent = None
    run(legs, rig, resolution=64)
    assert legs.parent is None, "it has its armature already"


def test_bad_input_is_named_and_nothing_is_written(legs, rig):
    good = builders.grid("Good")
    builders.select(good, legs, rig)
    sentences = []

    def refuse(match):
        with pytest.raises(RuntimeError, match=match) as caught:
            bpy.ops.skinwright.automatic_weights(resolution=64)
        sentences.append(str(caught.value))
        for obj in (good, legs):
            assert not obj.vertex_groups and not obj.modifiers and obj.parent is None

    at = legs.data.vertices[7].co.copy()
    legs.data.vertices[7].co.x = float("nan")
    refuse("Legs has a coordinate that is not a number at vertex 7")
    legs.data.vertices[7].co = at
    rig.scale = (1e-30, 1e-30, 1e-30)
    bpy.context.view_layer.update()
    refuse("Rig: bone Hips has no length")
    rig.scale, rig.location = (1, 1, 1), (400, 0, 0)
    bpy.context.view_layer.update()
    refuse("all bones lie outside of the mesh's bounding box")
    rig.location = (0, 0, 0)
    empty = bpy.data.objects.new("Empty", bpy.data.meshes.new("Empty"))
    bpy.context.collection.objects.link(empty)
    builders.select(good, empty, rig)
    refuse("Empty has no faces")
    builders.paint(legs, Hips=0.8, Leg__L=0.8)
    for name in ("Hips", "Leg.L"):
        legs.vertex_groups[name].lock_weight = True
    builders.select(good, legs, rig)
    with pytest.raises(RuntimeError, match="locked groups of Legs sum to more than 1"):
        bpy.ops.skinwright.automatic_weights(resolution=64)
    assert not good.vertex_groups


def test_the_entry_stands_in_the_parent_menu(addon):
    drawn = [entry.__name__ for entry in bpy.types.VIEW3D_MT_object_parent.draw._draw_funcs]
    assert "_automatic_weights" in drawn


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
    assert addon.headless.command_line.main(["autoskin", "--target", "Legs", "--armature", "Legs"]) == 1
    assert "Legs is no armature" in capsys.readouterr().err


def test_one_mesh_is_not_two_targets(addon, legs, rig):
    twin = bpy.data.objects.new("Twin", legs.data)
    bpy.context.scene.collection.objects.link(twin)
    builders.select(legs, twin, rig)
    with pytest.raises(RuntimeError, match="share one mesh and so its weights"):
        bpy.ops.skinwright.automatic_weights(resolution=32)
    assert not legs.vertex_groups and not legs.modifiers and not twin.modifiers
    run(legs, rig, resolution=32)
    assert "Legs shares its mesh with Twin, whose weights changed too" in addon.reporting.last.warnings


def test_what_keeps_the_weights_from_moving_the_mesh_is_named(addon, legs, rig):
    other = figure.rig()
    legs.modifiers.new("Armature", "ARMATURE").object = other
    run(legs, rig, resolution=32)
    assert any(f"is deformed by {other.name} and not by {rig.name}" in text for text in addon.reporting.last.warnings)
    legs.modifiers.clear()
    legs.parent, legs.parent_type, legs.parent_bone = rig, "BONE", "Hips"
    legs.matrix_parent_inverse = (rig.matrix_world @ rig.pose.bones["Hips"].matrix).inverted()
    run(legs, rig, resolution=32)
    assert any("is parented to the bone Hips of" in text for text in addon.reporting.last.warnings)


def test_a_mask_that_would_be_overwritten_is_refused(legs, rig):
    legs.vertex_groups.new(name="Leg.L").add([0, 1, 2], 0.5, "REPLACE")
    builders.select(legs, rig)
    with pytest.raises(RuntimeError, match="The mask of Legs is its group Leg.L, which would be overwritten"):
        bpy.ops.skinwright.automatic_weights(resolution=32, mask_group="Leg.L")
    assert [group.name for group in legs.vertex_groups] == ["Leg.L"]
