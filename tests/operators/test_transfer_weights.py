"""The operator: it writes what the native function answers, and respects what the artist has."""

from math import radians

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
BONES = ["Arm.L", "Arm.R"]

pytestmark = pytest.mark.usefixtures("native", "scene")


@pytest.fixture
def body(scene):
    obj = builders.body()
    scene.skinwright.transfer.source = obj
    return obj


@pytest.fixture
def coat(body):
    obj = builders.grid("Coat", 9, size=1.8, z=0.02)
    builders.select(obj)
    return obj


def run(**settings):
    assert bpy.ops.skinwright.transfer_weights(**settings) == {"FINISHED"}


def arrays(obj):
    """World positions and triangles by a way of the test's own."""
    positions = np.array([obj.matrix_world @ v.co for v in obj.data.vertices], np.float32)
    obj.data.calc_loop_triangles()
    return positions, np.array([t.vertices[:] for t in obj.data.loop_triangles], np.uint32)


def native_answer(native, source, target, **params):
    weights = native.Weights.from_dense(builders.dense(source, BONES).astype(np.float32))
    transfer = native.transfer_weights(*arrays(source), weights, *arrays(target), **params)
    return transfer.weights.to_dense()


def test_confidence_is_the_native_functions(native, body, coat):
    coat.rotation_euler.x = radians(5)
    coat.location.z = 0.1
    bpy.context.view_layer.update()
    run(method="CONFIDENCE", softness=1.2)
    expected = native_answer(native, body, coat, method="confidence", softness=1.2)
    # The add-on hands over quads as fans, whose spacing is another.
    np.testing.assert_allclose(builders.dense(coat, BONES), expected, atol=3e-4)
    other = native_answer(native, body, coat)
    assert np.abs(expected - other).max() > 1e-3


@pytest.mark.parametrize("method", ["PAPER", "CONFIDENCE"])
def test_locks_and_mask_hold_with_every_method(body, coat, method):
    builders.paint(coat, **{"Arm.L": [0.25] * 81, "Match Mask": [0.0] * 40 + [1.0] * 41})
    coat.vertex_groups["Arm.L"].lock_weight = True
    coat.skinwright.mask_group = "Match Mask"
    run(method=method)
    written = builders.dense(coat, BONES)
    np.testing.assert_allclose(written[:, 0], 0.25, atol=1e-6)
    np.testing.assert_allclose(written.sum(axis=1), 1, atol=1e-5)


def test_the_result_is_the_native_functions(native, body, coat):
    coat.rotation_euler.x = radians(5)
    coat.location.z = 0.1
    bpy.context.view_layer.update()
    run(relative_max_distance=0.03, max_normal_angle=radians(20), relative_smoothness_length=0.1, max_influences=2)
    expected = native_answer(
        native,
        body,
        coat,
        relative_max_distance=0.03,
        max_normal_angle=radians(20),
        relative_smoothness_length=0.1,
        max_influences=2,
    )
    assert builders.dense(coat, BONES) == pytest.approx(expected, abs=1e-6)
    assert builders.dense(coat, BONES).sum(1) == pytest.approx(1, abs=1e-6)


def test_absolute_lengths(native, body, coat):
    coat.location.z = 0.1
    bpy.context.view_layer.update()
    run(distance_mode="ABSOLUTE", max_distance=0.125, smoothness_mode="ABSOLUTE", smoothness_length=0.5)
    expected = native_answer(native, body, coat, max_distance=0.125, smoothness_length=0.5)
    assert builders.dense(coat, BONES) == pytest.approx(expected, abs=1e-6)


def test_other_groups_stay_and_stale_weights_go(body, coat):
    builders.paint(coat, cloth_pin=0.25, Arm__L=0.5, Arm__R=0.5)
    coat.vertex_groups["Arm.R"].add([0, 1, 2], 1.0, "REPLACE")
    left = [v.index for v in body.data.vertices if v.co.x < 0]
    body.vertex_groups["Arm.L"].remove(left)
    body.vertex_groups["Arm.R"].add(left, 1.0, "REPLACE")
    run()
    rows = builders.weights(coat)
    assert all(row["cloth_pin"] == 0.25 for row in rows)
    assert "pin" not in coat.vertex_groups
    far_left = [row for v, row in zip(coat.data.vertices, rows, strict=True) if v.co.x < -0.5]
    assert far_left and all("Arm.L" not in row and row["Arm.R"] == pytest.approx(1) for row in far_left)


def test_missing_groups_come_with_their_mirror_partner(body):
    for name in BONES:
        body.vertex_groups[name].remove(range(len(body.data.vertices)))
    body.vertex_groups["Arm.L"].add(range(len(body.data.vertices)), 1.0, "REPLACE")
    glove = builders.grid("Glove", 4, size=0.5, z=0.01)
    builders.select(glove)
    run()
    assert {group.name for group in glove.vertex_groups} == {"Arm.L", "Arm.R"}
    assert not builders.dense(glove, ["Arm.R"]).any()


def test_armature_modifier_only_where_there_is_none(body, coat):
    run(add_armature=False)
    assert not coat.modifiers
    run()
    run()
    assert [m.object for m in coat.modifiers] == [body.find_armature()]


def test_mirrored_target_faces_the_same_way(body, coat):
    """A negative scale turns the winding over, but not the outside."""
    run()
    expected = builders.dense(coat, BONES).reshape(9, 9, 2)[:, ::-1].reshape(81, 2)
    coat.scale = (-1, 1, 1)
    run(match_flipped_normals=False)
    assert builders.dense(coat, BONES) == pytest.approx(expected, abs=1e-5)


def test_modifiers_before_the_armature(body, coat):
    """Weights are solved for the original vertices, whatever the stack makes of them."""
    run()
    expected = builders.dense(coat, BONES)
    for kind in ("MIRROR", "SUBSURF", "SOLIDIFY"):
        coat.modifiers.new(kind, kind)
    run(geometry="CURRENT")
    assert builders.dense(coat, BONES) == pytest.approx(expected, abs=1e-5)
    assert all(m.show_viewport for m in coat.modifiers)


def test_half_a_garment_under_a_mirror(body):
    """The Mirror modifier finds the partner groups and turns left weights into right ones."""
    t = [float(v.co.x > 0.3) for v in body.data.vertices]
    for vertex, value in enumerate(t):
        body.vertex_groups["Arm.L"].add([vertex], value, "REPLACE")
        body.vertex_groups["Arm.R"].add([vertex], 1 - value, "REPLACE")
    glove = builders.grid("Glove", 5, size=0.4, z=0.01)
    for vertex in glove.data.vertices:
        vertex.co.x += 0.7
    modifier = glove.modifiers.new("Mirror", "MIRROR")
    modifier.use_clip = modifier.use_mirror_merge = False
    builders.select(glove)
    run()
    assert [m.type for m in glove.modifiers] == ["MIRROR", "ARMATURE"]
    bone = body.find_armature().pose.bones["Arm.R"]
    bone.location.y = 5
    evaluated = glove.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    heights = {v.co.x > 0: v.co.z for v in evaluated.vertices}
    assert heights[True] == pytest.approx(0.01) and heights[False] == pytest.approx(5.01)


def test_current_geometry_follows_the_pose(body, coat):
    """A coat modelled on the posed body matches it as posed, and not at rest."""
    for bone in body.find_armature().pose.bones:
        bone.location.y = 3  # along the bone, up
    coat.location.z = 3
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="Coat.*matched"):
        run()
    run(geometry="CURRENT")
    assert builders.dense(coat, BONES).sum(1) == pytest.approx(1, abs=1e-6)


class TestGroups:
    """Which groups are written."""

    def test_deform_bones(self, body, coat):
        run(groups="BONE_DEFORM")
        assert {group.name for group in coat.vertex_groups} == set(BONES)

    def test_all_carries_fields_by_themselves(self, body, coat):
        run(groups="ALL")
        x = np.array([v.co.x for v in coat.data.vertices]) / 2 + 0.5
        assert builders.dense(coat, BONES).sum(1) == pytest.approx(1, abs=1e-6)
        assert builders.dense(coat, ["pin"])[:, 0] == pytest.approx(x * x, abs=5e-3)

    def test_selected_bones(self, body, coat):
        armature = body.find_armature()
        builders.select(armature)
        bpy.ops.object.mode_set(mode="POSE")
        bpy.ops.pose.select_all(action="DESELECT")
        bone = armature.pose.bones["Arm.R"]
        (bone if hasattr(bone, "select") else bone.bone).select = True
        bpy.ops.object.mode_set(mode="OBJECT")
        builders.select(coat)
        run(groups="BONE_SELECT")
        assert builders.dense(coat, ["Arm.R"])[:, 0] == pytest.approx(1), "nothing else is there to fill the rest"
        coat.vertex_groups["Arm.L"].add(range(81), 0.25, "REPLACE")
        run(groups="BONE_SELECT")
        x = np.array([v.co.x for v in coat.data.vertices]) / 2 + 0.5
        assert builders.dense(coat, BONES) == pytest.approx(np.stack([x, 1 - x], axis=1), abs=1e-5)

    @pytest.mark.parametrize(("name", "others"), [("Arm.R", 1), ("pin", 2)])
    def test_active_group(self, body, coat, name, others):
        body.vertex_groups.active = body.vertex_groups[name]
        builders.paint(coat, Arm__L=0.125)
        run(groups="ACTIVE")
        x = np.array([v.co.x for v in coat.data.vertices]) / 2 + 0.5
        expected = 1 - x if name == "Arm.R" else x * x
        assert builders.dense(coat, [name])[:, 0] == pytest.approx(expected, abs=5e-3)
        room = x if name == "Arm.R" else 0.125 + 0 * x
        assert builders.dense(coat, ["Arm.L"])[:, 0] == pytest.approx(room, abs=1e-5)

    def test_without_an_armature_all_groups_are_bones(self, body, coat):
        body.modifiers.clear()
        body.vertex_groups.remove(body.vertex_groups["pin"])
        run(groups="ALL")
        assert builders.dense(coat, BONES).sum(1) == pytest.approx(1, abs=1e-6)
        assert not coat.modifiers


class TestLocks:
    """Locked groups are held fixed and the rest fills what they leave."""

    def test_the_rest_is_scaled_to_the_remainder(self, native, body, coat):
        builders.paint(coat, Arm__L=0.25)
        coat.vertex_groups["Arm.L"].lock_weight = True
        run()
        assert builders.dense(coat, BONES) == pytest.approx(np.array([[0.25, 0.75]] * 81), abs=1e-6)

    def test_bones_the_source_lacks_count_when_locked(self, body, coat):
        armature = builders.rig("Coat Rig", bones=(*BONES, "Tail"))
        coat.modifiers.new("Armature", "ARMATURE").object = armature
        builders.paint(coat, Tail=0.5)
        coat.vertex_groups["Tail"].lock_weight = True
        run()
        assert builders.dense(coat, ["Tail"]) == pytest.approx(0.5)
        assert builders.dense(coat, BONES).sum(1) == pytest.approx(0.5, abs=1e-6)

    def test_groups_that_are_no_bones_do_not_count(self, body, coat):
        builders.paint(coat, pin=1.0)
        coat.vertex_groups["pin"].lock_weight = True
        run(groups="ALL")
        assert builders.dense(coat, ["pin"]) == pytest.approx(1)
        assert builders.dense(coat, BONES).sum(1) == pytest.approx(1, abs=1e-6)

    def test_more_than_one_is_refused(self, body, coat):
        builders.paint(coat, Arm__L=0.75, Arm__R=0.5)
        for group in coat.vertex_groups:
            group.lock_weight = True
        with pytest.raises(RuntimeError, match="locked groups of Coat sum to more than 1 at 81 vertices"):
            run()

    def test_the_limit_counts_them(self, body, coat):
        builders.paint(coat, Arm__L=[0.25] + [np.nan] * 80)
        coat.vertex_groups["Arm.L"].lock_weight = True
        run(max_influences=1)
        rows = builders.dense(coat, BONES)
        assert ((rows > 0).sum(1) <= 1).all()
        assert rows[0].tolist() == [0.25, 0]


class TestMixing:
    """The mix factor."""

    def test_half(self, body, coat):
        run()
        new = builders.dense(coat, BONES)
        for name, value in zip(BONES, (1.0, 0.0), strict=True):
            coat.vertex_groups[name].add(range(81), value, "REPLACE")
        run(mix_factor=0.5)
        assert builders.dense(coat, BONES) == pytest.approx(0.5 * new + [0.5, 0], abs=1e-6)

    def test_nothing_changes_at_zero(self, body, coat):
        builders.paint(coat, Arm__L=0.25, Arm__R=0.75)
        run(mix_factor=0)
        assert builders.dense(coat, BONES) == pytest.approx(np.array([[0.25, 0.75]] * 81))

    def test_the_limit_holds_afterwards(self, body, coat):
        coat.modifiers.new("Armature", "ARMATURE").object = body.find_armature()
        builders.paint(coat, Arm__L=0.5, Arm__R=0.5)
        run(mix_factor=0.5, max_influences=1)
        rows = builders.dense(coat, BONES)
        assert ((rows > 0).sum(1) == 1).all()
        assert rows.sum(1) == pytest.approx(1)


def test_limit(body, coat):
    run(max_influences=1)
    rows = builders.dense(coat, BONES)
    assert ((rows > 0).sum(1) == 1).all()
    assert rows.sum(1) == pytest.approx(1)


def test_selected_vertices_only(body, coat):
    builders.paint(coat, Arm__L=0.125)
    select = np.arange(81) < 40
    coat.data.vertices.foreach_set("select", select)
    run(selected_only=True)
    rows = builders.dense(coat, BONES)
    assert rows[select].sum(1) == pytest.approx(1, abs=1e-6)
    assert np.array_equal(rows[~select], [[0.125, 0]] * 41)


class TestMask:
    """Each target's own mask steers the match."""

    def test_steer(self, native, plain, body, coat):
        mask = np.full(81, 1, np.uint8)
        mask[:20], mask[20:30] = 0, 2
        builders.paint(coat, Mask=np.array([0, 0.5, 1])[mask])
        coat.skinwright.mask_group = "Mask"
        report = plain(body, coat).garments[0]
        assert (report.matched, report.inpainted) == (61, 20)
        expected = native_answer(native, body, coat, mask=mask)
        assert builders.dense(coat, BONES) == pytest.approx(expected, abs=1e-6)
        assert "Mask" in report.kept_groups

    def test_painted_and_inverted(self, plain, body, coat):
        builders.paint(coat, Mask=[1.0] * 11 + [np.nan] * 70)
        coat.skinwright.mask_group, coat.skinwright.mask_reading = "Mask", "PAINTED"
        assert plain(body, coat).garments[0].inpainted == 11
        coat.skinwright.mask_invert = True
        assert plain(body, coat).garments[0].inpainted == 70

    def test_the_settings_mask_wins(self, addon, plain, body, coat):
        builders.paint(coat, Own=0.0, Other=[0.0] * 5 + [0.5] * 76)
        coat.skinwright.mask_group = "Own"
        assert plain(body, coat, mask=addon.transfer.Mask("Other")).garments[0].inpainted == 5

    def test_a_missing_group_is_an_error(self, body, coat):
        coat.skinwright.mask_group = "gone"
        with pytest.raises(RuntimeError, match="Coat has no vertex group gone"):
            run()


def test_islands_that_are_skipped_keep_their_weights(plain, body):
    near = [(x, y, 0.01) for x in (0, 0.2) for y in (0, 0.2)]
    far = [(x, y, 0.9) for x in (0, 0.2) for y in (0, 0.2)]
    obj = builders.mesh("Coat", near + far, [(0, 1, 3, 2), (4, 5, 7, 6)])
    builders.paint(obj, Arm__L=0.125)
    report = plain(body, obj, island_policy="skip", max_distance=0.1).garments[0]
    assert (report.matched, report.untouched) == (4, 4)
    rows = builders.dense(obj, BONES)
    assert rows[:4].sum(1) == pytest.approx(1, abs=1e-6)
    assert np.array_equal(rows[4:], [[0.125, 0]] * 4)
    plain(body, obj, island_policy="rigid", max_distance=0.1)
    assert builders.dense(obj, BONES).sum(1) == pytest.approx(1, abs=1e-6)


def test_several_targets_with_one_call(body, coat):
    belt = builders.grid("Belt", 5, size=0.5, z=0.01)
    builders.select(coat, body, belt)
    run()
    for obj in (coat, belt):
        assert builders.dense(obj, BONES).sum(1) == pytest.approx(1, abs=1e-6)
    assert "Armature" not in [m.name for m in body.modifiers][1:]


def test_shape_keys_stay(body, coat):
    coat.shape_key_add(name="Basis")
    coat.shape_key_add(name="Wide").data[4].co = (5, 5, 5)
    run()
    assert tuple(coat.data.shape_keys.key_blocks["Wide"].data[4].co) == (5, 5, 5)
    assert builders.dense(coat, BONES).sum(1) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("mode", ["EDIT", "WEIGHT_PAINT"])
def test_other_modes_work_and_come_back(body, coat, mode):
    bpy.ops.object.mode_set(mode=mode)
    run()
    assert coat.mode == mode
    bpy.ops.object.mode_set(mode="OBJECT")
    assert builders.dense(coat, BONES).sum(1) == pytest.approx(1, abs=1e-6)


def test_in_edit_mode_what_was_edited_counts(body, coat):
    import bmesh

    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(coat.data)
    bmesh.ops.delete(edited, geom=list(edited.verts)[:9], context="VERTS")
    bmesh.update_edit_mesh(coat.data)
    run()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert builders.dense(coat, BONES).shape == (72, 2)
    assert builders.dense(coat, BONES).sum(1) == pytest.approx(1, abs=1e-6)


@pytest.mark.skipif(bpy.app.background, reason="buttons need a window: Blender never invokes in the background")
def test_the_button_takes_the_panels_settings_and_scripts_their_own(scene, body, coat):
    scene.skinwright.transfer.max_influences = 1
    assert bpy.ops.skinwright.transfer_weights("INVOKE_DEFAULT") == {"FINISHED"}
    assert ((builders.dense(coat, BONES) > 0).sum(1) == 1).all()
    assert bpy.ops.skinwright.transfer_weights("INVOKE_DEFAULT", max_influences=2) == {"FINISHED"}
    assert ((builders.dense(coat, BONES) > 0).sum(1) == 2).any()


def test_frozen_it_does_nothing(body, coat):
    run(freeze=True)
    assert not coat.vertex_groups


def test_it_can_be_repeated(body, coat):
    """A second run over its own result gives the same bits."""
    run()
    first = builders.weights(coat)
    run()
    assert builders.weights(coat) == first


def test_undo(body, coat):
    if not bpy.ops.ed.undo.poll():
        pytest.skip("there is no undo without a window")
    bpy.ops.ed.undo_push()
    run()
    bpy.ops.ed.undo()
    assert not bpy.data.objects["Coat"].vertex_groups
