"""Check Weights on rigs whose bones are not free, its poses, and what it shows."""

import json

import builders
import figure
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


@pytest.fixture
def check(addon):
    def call(obj, source=None, **settings):
        module = addon.check.weight_check
        return module.check(obj, source, addon.check.params.CheckParams(**settings))

    return call


def counts(result):
    return {fault.name: count for fault, count in result.counts().items()}


def in_shreds(obj):
    """Every other ring of vertices follows the other end of the leg."""
    ring = np.arange(len(obj.data.vertices)) // 24 % 2
    weights = np.zeros((len(ring), 5))
    weights[ring == 0, 1] = weights[ring == 1, 2] = 1
    obj.vertex_groups.clear()
    figure.paint(obj, weights)


def controls(rig, kind):
    """Tie the deform bones to controls in one of the usual ways."""
    if kind == "plain":
        return
    if kind == "IK":
        goal = bpy.data.objects.new("Goal", None)
        bpy.context.collection.objects.link(goal)
        for side, x in (("L", 0.12), ("R", -0.12)):
            constraint = rig.pose.bones[f"Shin.{side}"].constraints.new("IK")
            constraint.target, constraint.chain_count = goal, 2
            goal.location = (x, 0, 0)
        return
    if kind == "copied":
        leader = figure.rig(name="Leader")
        for bone in rig.pose.bones:
            constraint = bone.constraints.new("COPY_TRANSFORMS")
            constraint.target, constraint.subtarget = leader, bone.name
    if kind in ("generated", "flat"):
        builders.select(rig)
        bpy.ops.object.mode_set(mode="EDIT")
        edit = rig.data.edit_bones
        for name in figure.BONES:
            control = edit.new(f"ORG-{name}")
            control.head, control.tail, control.use_deform = edit[name].head, edit[name].tail, False
        for name in figure.BONES:
            parent = edit[name].parent
            edit[f"ORG-{name}"].parent = edit[f"ORG-{parent.name}"] if parent else None
        for name in figure.BONES:
            edit[name].parent = edit[f"ORG-{name}"].parent if kind == "generated" else None
        bpy.ops.object.mode_set(mode="OBJECT")
        for name in figure.BONES:
            constraint = rig.pose.bones[name].constraints.new("COPY_TRANSFORMS")
            constraint.target, constraint.subtarget = rig, f"ORG-{name}"


KINDS = ["plain", "IK", "copied", "generated", "flat"]


class TestRigs:
    """Whatever ties the bones to controls, the verdict is that of a plain rig."""

    @pytest.fixture
    def verdicts(self, check):
        def of(kind, spoil):
            rig = figure.rig(name=f"Rig {kind}")
            body, trousers = figure.body(rig), figure.trousers()
            figure.paint(trousers, figure.weights_at(figure.rest(trousers)))
            figure.bind(trousers, rig)
            spoil(trousers)
            controls(rig, kind)
            bpy.context.view_layer.update()
            result = check(trousers, body)
            return counts(result), result.poses

        return of

    @pytest.mark.parametrize("kind", KINDS[1:])
    @pytest.mark.parametrize("spoil", [lambda obj: None, in_shreds], ids=["sound", "in shreds"])
    def test_equal_verdicts(self, verdicts, kind, spoil):
        assert verdicts(kind, spoil) == verdicts("plain", spoil)

    def test_the_shreds_are_found(self, verdicts):
        found, _ = verdicts("generated", in_shreds)
        assert found["TORN"] > 500 and verdicts("generated", lambda obj: None)[0]["TORN"] == 0

    def test_rigify(self, check):
        """A leg on a generated rig, and the same leg on a plain copy of its bones."""
        bpy.ops.preferences.addon_enable(module="rigify")
        bpy.ops.object.armature_basic_human_metarig_add()
        meta = bpy.context.object
        bpy.ops.pose.rigify_generate()
        rig = next(o for o in bpy.context.scene.objects if o.type == "ARMATURE" and o != meta)
        names = [b.name for b in rig.data.bones if b.use_deform and b.name.startswith(("DEF-thigh.L", "DEF-shin.L"))]
        ends = {n: (rig.data.bones[n].head_local.copy(), rig.data.bones[n].tail_local.copy()) for n in names}
        plain = figure.bones({n: (*ends[n], names[i - 1] if i else None) for i, n in enumerate(names)}, "Plain")
        top, foot = np.array(ends[names[0]][0]), np.array(ends[names[-1]][1])
        positions, faces = figure.tube(0, 0, 1, 0.08)
        positions = np.c_[positions[:, :2], 0 * positions[:, 2]] + top + (foot - top) * positions[:, 2:]
        verdicts = []
        for armature in (rig, plain):
            for torn in (False, True):
                leg = builders.mesh("Leg", positions, faces)
                middles = np.array([(np.array(a) + np.array(b)) / 2 for a, b in ends.values()])
                weights = np.exp(-np.square(np.linalg.norm(positions[:, None] - middles, axis=2) / 0.12))
                if torn:
                    weights = weights[np.arange(len(weights)) // 24 % 2 * 240]
                figure.paint(leg, weights / weights.sum(axis=1, keepdims=True), names)
                figure.bind(leg, armature)
                verdicts.append(counts(check(leg, poses="RANGE")))
        assert verdicts[:2] == verdicts[2:]
        assert verdicts[0]["TORN"] == 0 < verdicts[1]["TORN"]

    def test_nothing_in_the_scene_changes(self, check):
        rig = figure.rig()
        body = figure.body(rig)
        figure.turn(rig, "Leg.L", 30)
        before = [bone.matrix_basis.copy() for bone in rig.pose.bones]
        frame, selected = bpy.context.scene.frame_current, [v.select for v in body.data.vertices]
        check(body)
        assert [bone.matrix_basis for bone in rig.pose.bones] == before and rig.data.pose_position == "POSE"
        assert bpy.context.scene.frame_current == frame and [v.select for v in body.data.vertices] == selected


class TestWhatIsLeftOut:
    """A verdict about weights that something else overrules says so."""

    @pytest.fixture
    def trousers(self):
        trousers = figure.trousers()
        figure.paint(trousers, figure.weights_at(figure.rest(trousers)))
        figure.bind(trousers, figure.rig())
        return trousers

    def test_nothing(self, check, trousers):
        assert check(trousers).tested.endswith("deform bones alone, blended linearly")

    def test_envelopes(self, check, trousers):
        trousers.modifiers[0].use_bone_envelopes = True
        assert check(trousers).tested.endswith("without bone envelopes")

    def test_modifiers_that_overrule(self, check, trousers):
        modifier = trousers.modifiers.new("Edit", "VERTEX_WEIGHT_EDIT")
        modifier.vertex_group = "Leg.L"
        trousers.modifiers.move(1, 0)
        assert check(trousers).tested.endswith("without the modifier Edit, which overrules the weights")

    def test_mirrored_halves(self, check, trousers):
        trousers.modifiers.new("Mirror", "MIRROR")
        trousers.modifiers.move(1, 0)
        assert check(trousers).tested.endswith("without what the modifier Mirror adds")


class TestOpen:
    """Vertices at one place at rest that a pose takes apart."""

    @pytest.fixture
    def split(self):
        """The left leg cut at the knee, both sides with the same weights."""
        positions, faces = figure.tube(0.12, 0, 1, 0.1)
        ring = np.arange(24) + 24 * 10
        faces = [[i + 264 if i in ring and min(face) >= 240 else int(i) for i in face] for face in faces]
        double = np.concatenate([positions, positions[ring]])
        obj = builders.mesh("Cut", double, [[i if i < 504 else 504 + i - 504 for i in face] for face in faces])
        figure.paint(obj, figure.weights_at(double))
        figure.bind(obj, figure.rig())
        return obj

    def test_equal_weights_stay_together(self, check, split):
        assert counts(check(split))["OPEN"] == 0

    @pytest.mark.parametrize("several", [1, 5])
    def test_others_open(self, check, split, several):
        copies = list(range(504, 504 + several))
        for name in figure.BONES:
            split.vertex_groups[name].remove(copies)
        split.vertex_groups["Hips"].add(copies, 1.0, "REPLACE")
        result = check(split)
        assert counts(result)["OPEN"] == 2 * several
        assert result.worst is not None and result.worst.name in result.sentence()


class TestPoses:
    """Built-in and the artist's own."""

    def test_built_in_ones_are_said(self, check):
        body = figure.body()
        names = [pose["pose"] for pose in check(body).poses]
        assert "squat" in names and "stride" in names and any("level 2" in name for name in names)
        assert "range of motion and whole body" in check(body).sentence()
        assert [pose["pose"] for pose in check(body, poses="BODY").poses] == [n for n in names if "level" not in n]

    def test_legs_point_where_the_pose_says(self, addon):
        """Sitting, thighs go forward and shins hang down."""
        skeleton = addon.scene.skeleton.read([figure.rig()])
        plan = addon.check.body_plan.find(skeleton)
        sit = next(p for p in addon.check.poses.whole_body(skeleton, plan) if p.name == "sit")
        for side in "LR":
            thigh, shin = (skeleton.names.index(f"{bone}.{side}") for bone in ("Leg", "Shin"))
            directions = {
                bone: sit.pose_from_rest[bone][:3, :3] @ (skeleton.tails[bone] - skeleton.heads[bone])
                for bone in (thigh, shin)
            }
            assert directions[thigh][1] < -0.45 and abs(directions[thigh][2]) < 0.1
            assert directions[shin][2] < -0.45
            knee = sit.pose_from_rest[thigh] @ [*skeleton.tails[thigh], 1]
            assert knee == pytest.approx(sit.pose_from_rest[shin] @ [*skeleton.heads[shin], 1])

    @pytest.mark.parametrize(
        ("name", "role", "side"),
        [
            ("mixamorig:LeftUpLeg", "thigh", "L"),
            ("mixamorig:LeftLeg", "leg", "L"),
            ("mixamorig:RightForeArm", "forearm", "R"),
            ("mixamorig:RightArm", "upper_arm", "R"),
            ("J_Bip_R_LowerLeg", "shin", "R"),
            ("CC_Base_L_Calf", "shin", "L"),
            ("lShldrBend", "upper_arm", "L"),
            ("lForearmBend", "forearm", "L"),
            ("左ひざ", "shin", "L"),
            ("右腕", "upper_arm", "R"),
            ("左足首", "foot", "L"),
            ("DEF-thigh.L.001", "thigh", "L"),
            ("upperleg01.R", "thigh", "R"),
            ("calf_l", "shin", "L"),
            ("Bip001 R UpperArm", "upper_arm", "R"),
            ("DEF-spine.002", "trunk", ""),
            ("Head", "head", ""),
        ],
    )
    def test_roles_by_name(self, addon, name, role, side):
        assert (addon.check.body_plan.role_of(name), addon.check.body_plan.side_of(name)) == (role, side)

    def test_marked_frames(self, check):
        body = figure.body()
        rig = body.modifiers[0].object
        for frame, degrees in ((1, 0), (10, 60)):
            figure.turn(rig, "Leg.L", degrees)
            rig.pose.bones["Leg.L"].keyframe_insert("rotation_quaternion", frame=frame)
        for name, frame in (("rest", 1), ("kick", 10)):
            bpy.context.scene.timeline_markers.new(name, frame=frame)
        assert [p["pose"] for p in check(body, poses="MARKERS").poses] == ["rest (frame 1)", "kick (frame 10)"]

    def test_the_pose_library(self, check):
        body = figure.body()
        rig = body.modifiers[0].object
        figure.turn(rig, "Shin.L", 170)
        rig.pose.bones["Shin.L"].keyframe_insert("rotation_quaternion", frame=1)
        action = rig.animation_data.action
        action.name = "Bent"
        action.asset_mark()
        rig.animation_data_clear()
        rig.pose.bones["Shin.L"].matrix_basis.identity()
        rig.pose.bones["Shin.L"].rotation_quaternion = (1, 0, 0, 0)
        bpy.context.view_layer.update()
        in_shreds(body)
        result = check(body, poses="LIBRARY")
        assert [p["pose"] for p in result.poses] == ["Bent"] and counts(result)["TORN"]
        assert tuple(rig.pose.bones["Shin.L"].rotation_quaternion) == (1, 0, 0, 0)

    @pytest.mark.parametrize(("poses", "sentence"), [("MARKERS", "no markers"), ("LIBRARY", "no pose assets")])
    def test_where_there_are_none(self, check, addon, poses, sentence):
        with pytest.raises(addon.scene.error.SceneError, match=sentence):
            check(figure.body(), poses=poses)


class TestShown:
    """The worst pose, and the offenders over the mesh."""

    @pytest.fixture
    def torn(self):
        body = figure.body()
        in_shreds(body)
        builders.select(body)
        return body

    def test_the_selection_stays(self, torn):
        for vertex in torn.data.vertices:
            vertex.select = vertex.index < 3
        bpy.ops.skinwright.check_weights()
        assert [v.index for v in torn.data.vertices if v.select] == [0, 1, 2]

    def test_the_worst_pose_is_taken(self, addon, torn):
        bpy.ops.skinwright.check_weights()
        worst = addon.check.shown.of(torn).worst
        assert bpy.ops.skinwright.show_worst_pose() == {"FINISHED"}
        rig, skeleton = torn.modifiers[0].object, addon.check.shown.of(torn).bones
        now = addon.scene.armature.world_pose([rig], skeleton)
        assert now == pytest.approx(worst.pose_from_rest, abs=1e-4)

    def test_bones_that_do_not_obey_are_left_as_they_are(self, torn):
        rig = torn.modifiers[0].object
        controls(rig, "copied")
        builders.select(torn)
        bpy.ops.skinwright.check_weights()
        before = [bone.matrix_basis.copy() for bone in rig.pose.bones]
        with pytest.raises(RuntimeError, match="follow constraints"):
            bpy.ops.skinwright.show_worst_pose()
        assert [bone.matrix_basis for bone in rig.pose.bones] == before

    def test_nothing_to_show_before_a_check(self, addon, torn):
        addon.check.shown.forget()
        assert not bpy.ops.skinwright.show_worst_pose.poll()

    def test_the_overlay_has_every_fault(self, addon, torn):
        bpy.ops.skinwright.check_weights()
        result = addon.check.shown.of(torn)
        picture = addon.overlay.picture.picture(bpy.context, "FAULTS", addon.transfer.TransferParams())
        assert np.array_equal(picture.values > 0, result.any_fault())
        assert addon.overlay.colours.of_values("FAULTS", picture.values).shape == (len(picture.values), 3)
        assert result.worst.name in picture.note


def test_a_transfer_reports_before_and_after(scene, tmp_path):
    body, trousers = figure.body(), figure.trousers()
    figure.bind(trousers, body.modifiers[0].object)
    in_shreds(trousers)
    scene.skinwright.transfer.source = body
    builders.select(trousers)
    assert bpy.ops.skinwright.transfer_weights(compare=True) == {"FINISHED"}


def test_figures_before_and_after(addon):
    body, trousers = figure.body(), figure.trousers()
    figure.bind(trousers, body.modifiers[0].object)
    in_shreds(trousers)
    steps = addon.transfer.steps(bpy.context, body, [trousers], addon.transfer.TransferParams())
    report = addon.jobs.wait(addon.operators.comparison.compared(steps, body, [trousers], 0))
    figures = report.comparison["Trousers"]
    assert figures["before"]["torn"] > 500 and figures["after"]["torn"] == 0
    assert f"torn {figures['before']['torn']} before, 0 after" in report.sentence()
    json.dumps(report.to_json())
