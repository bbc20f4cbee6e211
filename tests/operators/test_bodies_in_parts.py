"""Several sources as one body, several targets of which some fail, only some groups, names of sides."""

import builders
import figure
import numpy as np
import pytest
from transferring import said

Matrix = pytest.importorskip("mathutils", reason="needs the bpy wheel").Matrix
bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


def overall(name="Overall"):
    return builders.mesh(
        name,
        *figure.joined(
            figure.tube(0.12, 0.05, 0.97, (0.088, 0.106)),
            figure.tube(-0.12, 0.05, 0.97, (0.088, 0.106)),
            figure.tube(0, 0.95, 1.29, (0.25, 0.21), 48, 10),
        ),
    )


class TestBody:
    """A body in several meshes."""

    @pytest.fixture
    def parts(self, plain):
        """Legs and torso of one body, which itself is gone, and what the whole body gives an overall."""
        whole, reference = figure.body(), overall("Reference")
        plain(whole, reference, add_armature=False)
        rig = whole.modifiers[0].object
        legs = figure.part(whole, "Legs", lambda centre: centre[2] < 0.93)
        torso = figure.part(whole, "Torso", lambda centre: centre[2] >= 0.93)
        for obj in (legs, torso):
            figure.bind(obj, rig)
        expected = builders.dense(reference, figure.BONES)
        for obj in (whole, reference):
            bpy.data.objects.remove(obj)
        return legs, torso, expected

    @pytest.mark.parametrize("scope", ["PARTS", "ARMATURE", "COLLECTION"])
    def test_parts_are_one_body(self, plain, parts, scope):
        legs, _, expected = parts
        target = overall()
        bpy.context.view_layer.update()
        report = plain(legs, target, source_scope=scope)
        assert report.source == "Legs + Torso"
        assert builders.dense(target, figure.BONES) == pytest.approx(expected, abs=1e-3)

    @pytest.mark.parametrize("shaped", ["key", "lattice", "half legs", "half torso"])
    def test_parts_continue_each_other_as_they_are_shown(self, plain, parts, shaped):
        """The raw meshes have no border in common: a key or a lattice brings one to its place, or it is a half."""
        legs, torso, expected = parts
        if shaped == "key":
            legs.shape_key_add(name="Basis", from_mix=False)
            legs.shape_key_add(name="Fitted", from_mix=False).value = 1
            for point in legs.data.shape_keys.key_blocks["Basis"].data:
                point.co.z -= 0.4
        elif shaped == "lattice":
            cage = bpy.data.objects.new("Cage", bpy.data.lattices.new("Cage"))
            bpy.context.collection.objects.link(cage)
            cage.scale = (4, 4, 4)
            for point in cage.data.points:
                point.co_deform.z += 0.1
            legs.data.transform(Matrix.Translation((0, 0, -0.4)))
            legs.modifiers.new("Cage", "LATTICE").object = cage
            legs.modifiers.move(1, 0)
        else:
            obj = legs if shaped == "half legs" else torso
            left = figure.part(obj, "Left", lambda centre: centre[0] >= 0)
            for modifier in (left.modifiers.new("Mirror", "MIRROR"), figure.bind(left, obj.modifiers[0].object)):
                modifier.show_render = True
            bpy.data.objects.remove(obj)
            legs, torso = (left, torso) if shaped == "half legs" else (legs, left)
        target = overall()
        assert plain(legs, target).source == f"{legs.name} + {torso.name}"
        assert np.abs(builders.dense(target, figure.BONES) - expected).mean() < 0.02

    def test_the_source_alone(self, plain, parts):
        legs, _, expected = parts
        target = overall()
        assert plain(legs, target, source_scope="OBJECT").source == "Legs"
        assert np.abs(builders.dense(target, figure.BONES) - expected).max() > 0.5

    def test_a_copy_of_the_body_is_no_part_of_it(self, plain):
        body = figure.body()
        twin = body.copy()
        twin.data = body.data.copy()
        bpy.context.collection.objects.link(twin)
        bpy.context.view_layer.update()
        assert plain(body, overall()).source == "Body"

    def test_other_clothes_are_no_part_of_it(self, plain):
        body, shirt = figure.body(), figure.trousers("Shirt")
        plain(body, shirt)
        bpy.context.view_layer.update()
        assert plain(body, overall()).source == "Body"

    def test_parts_that_are_hidden_are_left_out(self, plain, parts):
        legs, torso, _ = parts
        torso.hide_set(True)
        assert plain(legs, overall()).source == "Legs"

    def test_what_follows_another_armature_is_refused(self, plain, addon, parts):
        legs, torso, _ = parts
        torso.modifiers[0].object = figure.rig(name="Other")
        bpy.context.view_layer.update()
        target = overall()
        with pytest.raises(addon.scene.error.SceneError, match="Torso is deformed by Other and Legs is not"):
            plain(legs, target, source_scope="COLLECTION")
        assert not target.vertex_groups

    def test_weights_unite_by_name(self, plain, parts):
        """The torso has its groups in another order, and one the legs lack."""
        legs, torso, expected = parts
        weights = builders.dense(torso, figure.BONES)
        torso.vertex_groups.clear()
        figure.paint(torso, weights[:, ::-1], figure.BONES[::-1])
        legs.vertex_groups.remove(legs.vertex_groups["Hips"])
        target = overall()
        bpy.context.view_layer.update()
        plain(legs, target)
        high = figure.rest(target)[:, 2] > 1.0
        assert builders.dense(target, figure.BONES)[high] == pytest.approx(expected[high], abs=1e-3)


class TestSeveralTargets:
    """One of many fails."""

    @pytest.fixture
    def targets(self, scene):
        body = figure.body()
        scene.skinwright.transfer.source = body
        good = [
            builders.mesh(f"Band{i}", *figure.tube(0.12, 0.1 * i, 0.1 * i + 0.05, 0.088 + 0.002 * i)) for i in range(4)
        ]
        bad = [builders.mesh(name, *figure.tube(5 + i, 0, 0.1, 0.05)) for i, name in enumerate(("Prop", "Crate"))]
        broken = builders.mesh("Broken", *figure.tube(0.12, 0.2, 0.3, 0.1))
        broken.data.vertices[0].co.x = float("nan")
        bpy.context.view_layer.update()
        return body, good, [*bad, broken]

    SETTINGS = {"island_policy": "skip"}

    def test_every_culprit_is_named_and_nothing_is_written(self, plain, addon, targets):
        body, good, bad = targets
        with pytest.raises(addon.scene.error.SceneError) as caught:
            plain(body, *good, *bad, **self.SETTINGS)
        assert all(name in str(caught.value) for name in ("Prop", "Crate", "Broken"))
        assert not any(obj.vertex_groups or obj.modifiers for obj in (*good, *bad))

    def test_the_others_go_ahead_on_demand(self, plain, targets):
        body, good, bad = targets
        report = plain(body, *good, *bad, skip_failing=True, **self.SETTINGS)
        assert [garment.target for garment in report.garments] == [obj.name for obj in good]
        assert len(report.failures) == 3 and all(obj.name in said(report) for obj in bad)
        assert all(builders.dense(obj, figure.BONES).sum(1) == pytest.approx(1, abs=1e-6) for obj in good)
        assert not any(obj.vertex_groups for obj in bad)

    def test_if_all_fail_there_is_nothing_to_skip(self, plain, addon, targets):
        body, _, bad = targets
        with pytest.raises(addon.scene.error.SceneError, match="Prop.*Crate"):
            plain(body, *bad, skip_failing=True, **self.SETTINGS)

    def test_by_the_operator(self, targets):
        _, good, bad = targets
        builders.select(*good, *bad)
        with pytest.raises(RuntimeError, match="(?s)Prop.*Crate"):
            bpy.ops.skinwright.transfer_weights(island_policy="SKIP")
        assert bpy.ops.skinwright.transfer_weights(island_policy="SKIP", skip_failing=True) == {"FINISHED"}


class TestSums:
    """Rows of deforming weights sum to 1 whatever the choice of groups."""

    @pytest.fixture
    def worn(self):
        body, trousers = figure.body(), figure.trousers()
        old = np.tile([0, 0.7, 0, 0.3, 0], (len(trousers.data.vertices), 1))
        figure.paint(trousers, old)
        return body, trousers

    def choose(self, body, bones):
        rig = body.modifiers[0].object
        builders.select(rig)
        for bone in rig.pose.bones:
            (bone if bpy.app.version >= (5, 0, 0) else bone.bone).select = bone.name in bones

    def test_selected_bones(self, plain, worn):
        body, trousers = worn
        self.choose(body, ["Shin.L", "Shin.R"])
        plain(body, trousers, groups="BONE_SELECT")
        rows, truth = builders.dense(trousers, figure.BONES), figure.weights_at(figure.rest(trousers))
        assert rows.sum(1) == pytest.approx(1, abs=1e-6)
        assert rows[:, [2, 4]] == pytest.approx(truth[:, [2, 4]], abs=0.05)
        makes_room = rows[:, 1] > 1e-6
        assert rows[makes_room, 3] / rows[makes_room, 1] == pytest.approx(3 / 7, rel=1e-4)

    def test_the_active_group(self, plain, worn):
        body, trousers = worn
        body.vertex_groups.active = body.vertex_groups["Hips"]
        plain(body, trousers, groups="ACTIVE")
        assert builders.dense(trousers, figure.BONES).sum(1) == pytest.approx(1, abs=1e-6)

    @pytest.mark.parametrize("groups", ["BONE_SELECT", "ACTIVE"])
    def test_locks_make_no_room(self, plain, worn, groups):
        body, trousers = worn
        self.choose(body, ["Shin.L"])
        body.vertex_groups.active = body.vertex_groups["Shin.L"]
        trousers.vertex_groups["Leg.R"].lock_weight = True
        plain(body, trousers, groups=groups)
        rows = builders.dense(trousers, figure.BONES)
        assert rows.sum(1) == pytest.approx(1, abs=1e-6) and (rows[:, 3] == np.float32(0.3)).all()

    @pytest.mark.parametrize("settings", [{"mix_factor": 0.5}, {"max_influences": 2}])
    def test_with_mixing_and_a_limit(self, plain, worn, settings):
        body, trousers = worn
        self.choose(body, ["Shin.L", "Hips"])
        plain(body, trousers, groups="BONE_SELECT", **settings)
        assert builders.dense(trousers, figure.BONES).sum(1) == pytest.approx(1, abs=1e-6)

    def test_bones_of_the_garments_own(self, plain):
        """Skirt bones that the body lacks keep their weights, and the body's fill the rest."""
        body, skirt = figure.body(), figure.skirt()
        figure.bind(skirt, figure.bones({"Skirt": ((0.3, 0, 0.8), (0.3, 0, 0.4), None)}, "Skirt Rig"))
        own = np.where(figure.rest(skirt)[:, 2] < 0.6, 0.8, 0)
        figure.paint(skirt, own[:, None], ["Skirt"])
        report = plain(body, skirt)
        rows = builders.dense(skirt, [*figure.BONES, "Skirt"])
        assert rows.sum(1) == pytest.approx(1, abs=1e-6) and rows[:, -1] == pytest.approx(own)
        assert "keeps its weights in 1 groups of bones Body lacks (Skirt" in said(report)


class TestSides:
    """Left and right by the names of the usual rigs."""

    NAMES = {
        "VRoid": ("J_Bip_L_UpperLeg", "J_Bip_R_UpperLeg"),
        "Mixamo": ("mixamorig:LeftUpLeg", "mixamorig:RightUpLeg"),
        "MMD": ("左足", "右足"),
        "Character Creator": ("CC_Base_L_Thigh", "CC_Base_R_Thigh"),
        "Daz": ("lThighBend", "rThighBend"),
        "3ds Max": ("Bip001 L Thigh", "Bip001 R Thigh"),
        "XPS": ("leg left thigh", "leg right thigh"),
        "Valve": ("ValveBiped.Bip01_L_Thigh", "ValveBiped.Bip01_R_Thigh"),
        "Unreal": ("thigh_l", "thigh_r"),
        "Blender": ("thigh.L", "thigh.R"),
        "no names": ("bone_017", "bone_042"),
    }

    def character(self, left, right):
        rig = figure.rig({"Leg.L": left, "Leg.R": right})
        return figure.body(rig, ["Hips", left, "Shin.L", right, "Shin.R"])

    @pytest.mark.parametrize("kind", NAMES)
    def test_the_opposite_is_found(self, addon, kind):
        left, right = self.NAMES[kind]
        rig = self.character(left, right).modifiers[0].object
        found = addon.scene.sides.opposites(rig, [left, right, "Hips"])
        assert found == {left: right, right: left, "Hips": "Hips"}

    def test_words_that_only_look_like_sides(self, addon):
        names = ["Bright", "Cleft", "upright", "Eyelid", "Collar", "Roll", "Lever", "右腕捩", "Hips"]
        rig = figure.bones({name: ((i, 1, 0), (i, 1, 1), None) for i, name in enumerate(names, 1)})
        assert addon.scene.sides.opposites(rig, names) == {name: name for name in names}

    @pytest.mark.parametrize("kind", NAMES)
    def test_partner_groups_are_made_and_a_mirror_that_cannot_work_is_named(self, plain, kind):
        left, right = self.NAMES[kind]
        body = self.character(left, right)
        boot = builders.mesh("Boot", *figure.tube(0.12, 0.55, 0.85, 0.1))
        boot.modifiers.new("Mirror", "MIRROR")
        report = plain(body, boot)
        assert {left, right} <= {group.name for group in boot.vertex_groups}
        works = bpy.utils.flip_name(left) == right
        assert ("Mirror" in said(report)) != works

    def test_symmetrize(self, plain):
        """Bits are equal across the middle, left and right exchanged, though body and mesh are not symmetric."""
        body, skirt = figure.body(), figure.skirt()
        body.vertex_groups["Leg.L"].add(list(range(len(body.data.vertices))), 0.3, "ADD")
        plain(body, skirt)
        lopsided = builders.dense(skirt, figure.BONES)
        plain(body, skirt, symmetrize=True)
        rows, positions = builders.dense(skirt, figure.BONES), figure.rest(skirt)
        other = np.linalg.norm(positions[:, None] * [-1, 1, 1] - positions[None], axis=2).argmin(axis=1)
        flipped = [0, 3, 4, 1, 2]
        assert np.array_equal(rows, rows[other][:, flipped])
        assert not np.allclose(lopsided, lopsided[other][:, flipped], atol=1e-4)
        assert rows.sum(1) == pytest.approx(1, abs=1e-6)
        assert rows == pytest.approx((lopsided + lopsided[other][:, flipped]) / 2, abs=1e-6)

    def test_symmetrize_on_a_mesh_with_split_seams(self, plain):
        body, skirt = figure.body(), figure.skirt()
        positions = figure.rest(skirt)
        faces = [list(polygon.vertices) for polygon in skirt.data.polygons]
        split = builders.mesh(
            "Split", np.concatenate([positions[f] for f in faces]), np.arange(4 * len(faces)).reshape(-1, 4)
        )
        plain(body, split, symmetrize=True)
        rows, positions = builders.dense(split, figure.BONES), figure.rest(split).round(5)
        places = {}
        for i, position in enumerate(positions):
            places.setdefault(tuple(position + 0.0), []).append(i)
        pairs = [(i, places[(-x + 0.0, y, z)][0]) for (x, y, z), group in places.items() for i in group]
        mine, theirs = np.array(pairs).T
        assert rows[mine] == pytest.approx(rows[theirs][:, [0, 3, 4, 1, 2]], abs=1e-6)
