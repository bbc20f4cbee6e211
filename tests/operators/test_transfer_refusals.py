"""What the transfer refuses, in a sentence and before anything is written; and what it warns of."""

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
    obj = builders.grid("Coat", 5, size=1.8, z=0.02)
    builders.paint(obj, Arm__L=0.5, pin=0.25)
    builders.select(obj)
    return obj


def state(*objects):
    """All that a transfer might change."""
    return [
        (
            builders.weights(obj) if obj.type == "MESH" else None,
            [(group.name, group.lock_weight) for group in obj.vertex_groups],
            [modifier.name for modifier in obj.modifiers],
            obj.mode,
            obj.data.name,
        )
        for obj in objects
    ]


def refused(match, *targets, **settings):
    """The operator refuses and leaves the targets as they were."""
    before = state(*targets)
    with pytest.raises(RuntimeError, match=match):
        bpy.ops.skinwright.transfer_weights(**settings)
    assert state(*targets) == before


class TestPoll:
    """Why the button is grey."""

    def test_no_source(self, scene, coat):
        scene.skinwright.transfer.source = None
        refused("Pick the body to transfer from", coat)

    def test_nothing_selected(self, body, coat):
        builders.select()
        refused("Select the meshes to transfer to", coat)

    def test_only_the_source_selected(self, body, coat):
        builders.select(body)
        refused("Select the meshes to transfer to", coat)

    def test_only_other_things_selected(self, body, coat):
        builders.select(body.find_armature())
        refused("Select the meshes to transfer to", coat)

    def test_other_modes(self, body, coat):
        bpy.ops.object.mode_set(mode="SCULPT")
        refused("Go to Object, Edit or Weight Paint mode", coat)
        bpy.ops.object.mode_set(mode="OBJECT")

    def test_no_native_module(self, addon, coat, monkeypatch):
        monkeypatch.setattr(addon.native, "_module", None)
        monkeypatch.setattr(addon.native, "_import_error", "No module named 'skinwright_native'")
        addon.native.problem.cache_clear()
        refused("native module of Skinwright cannot be loaded", coat)
        addon.native.problem.cache_clear()

    def test_another_version_of_the_native_module(self, addon, coat, monkeypatch):
        monkeypatch.setattr(addon.native, "addon_version", lambda: "99.0.0")
        addon.native.problem.cache_clear()
        refused("restart Blender", coat)
        addon.native.problem.cache_clear()


class TestSource:
    """Bodies that have nothing to give."""

    def test_no_groups(self, body, coat):
        body.vertex_groups.clear()
        refused("Body has no vertex groups", coat)

    def test_no_armature(self, body, coat):
        body.modifiers.clear()
        refused("Body has no armature .* All Groups", coat)

    def test_no_group_of_a_bone(self, body, coat):
        for name in BONES:
            body.vertex_groups.remove(body.vertex_groups[name])
        refused("No vertex group of Body has the name of a deform bone of Rig", coat)

    def test_no_bone_selected(self, body, coat):
        armature = body.find_armature()
        builders.select(armature)
        bpy.ops.object.mode_set(mode="POSE")
        bpy.ops.pose.select_all(action="DESELECT")
        bpy.ops.object.mode_set(mode="OBJECT")
        builders.select(coat)
        refused("selected deform bone", coat, groups="BONE_SELECT")

    def test_no_faces(self, scene, coat):
        cloud = builders.mesh("Cloud", [(0, 0, 0), (1, 0, 0)], [])
        builders.paint(cloud, Arm__L=1.0)
        cloud.modifiers.new("Armature", "ARMATURE").object = bpy.data.objects["Rig"]
        scene.skinwright.transfer.source = cloud
        refused("Cloud has no faces", coat)

    def test_flattened(self, body, coat):
        body.scale.z = 0
        refused("Body is scaled to nothing", coat)

    def test_weights_that_are_not_numbers(self, body, coat):
        body.vertex_groups["Arm.R"].add([3], float("nan"), "REPLACE")
        refused("Body has a weight that is not a number at vertex 3 in group Arm.R", coat)

    def test_coordinates_that_are_not_numbers(self, body, coat):
        body.data.vertices[7].co.x = float("nan")
        refused("Body has a coordinate that is not a number at vertex 7", coat)

    def test_no_weights_at_all(self, body, coat):
        for group in body.vertex_groups:
            group.remove(range(len(body.data.vertices)))
        refused("(?i)body|coat", coat)

    def test_not_a_mesh(self, addon, plain, body, coat):
        with pytest.raises(addon.scene.error.SceneError, match="Rig is not a mesh"):
            plain(body.find_armature(), coat)


class TestTarget:
    """Garments that can take nothing."""

    @pytest.mark.parametrize("method", ["PAPER", "CONFIDENCE"])
    def test_too_far_away(self, body, coat, method):
        coat.location.z = 50
        refused("Coat: .*distance", coat, method=method)

    def test_no_vertices(self, body, coat):
        builders.select(builders.mesh("Empty", [], []))
        refused("Empty has no faces", bpy.data.objects["Empty"])

    def test_flattened(self, body, coat):
        coat.scale.x = 0
        refused("Coat is scaled to nothing", coat)

    def test_coordinates_that_are_not_numbers(self, body, coat):
        coat.data.vertices[7].co.x = float("nan")
        with pytest.raises(RuntimeError, match="Coat has a coordinate that is not a number at vertex 7"):
            bpy.ops.skinwright.transfer_weights()

    def test_locked_groups_that_sum_to_more_than_one(self, body, coat):
        builders.paint(coat, Arm__R=0.75)
        for group in coat.vertex_groups:
            group.lock_weight = True
        refused("locked groups of Coat sum to more than 1 at 25 vertices", coat)

    def test_one_bad_target_keeps_all_from_being_written(self, body, coat):
        far = builders.grid("Far", 4, z=50)
        builders.select(coat, far)
        refused("Far: ", coat, far)

    def test_shared_with_another_target(self, body, coat):
        twin = coat.copy()
        bpy.context.collection.objects.link(twin)
        builders.select(coat, twin)
        refused("share one mesh", coat, twin)

    def test_shared_with_the_source(self, body, coat):
        twin = body.copy()
        bpy.context.collection.objects.link(twin)
        builders.select(twin)
        refused("share one mesh", twin)

    def test_source_and_target_at_once(self, addon, plain, body):
        with pytest.raises(addon.scene.error.SceneError, match="source and target at once"):
            plain(body, body)

    def test_no_targets(self, addon, plain, body):
        with pytest.raises(addon.scene.error.SceneError, match="nothing to transfer to"):
            plain(body)

    def test_a_curve(self, addon, plain, body):
        curve = bpy.data.objects.new("Curve", bpy.data.curves.new("Curve", "CURVE"))
        with pytest.raises(addon.scene.error.SceneError, match="Curve is not a mesh"):
            plain(body, curve)


@pytest.mark.parametrize("flaw", [float("nan"), -0.5, 0.5])
def test_an_answer_that_is_no_set_of_weights_is_not_written(addon, body, coat, monkeypatch, flaw):
    real = addon.native.Job.result

    def flawed(*arguments, **keywords):
        transfer, rows = real(*arguments, **keywords)
        values = rows.values.copy()
        values[rows.indptr[7]] += flaw
        return transfer, rows._replace(values=values)

    monkeypatch.setattr(addon.native.Job, "result", flawed)
    refused("Coat: the answer is no set of weights", coat)


class TestLinked:
    """Data of other files: a linked body may give, a linked garment cannot take."""

    @pytest.fixture
    def library(self, body, coat, tmp_path, scene):
        path = tmp_path / "library.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        with bpy.data.libraries.load(str(path), link=True) as (_, into):
            into.objects = ["Body", "Coat"]
        for obj in into.objects:
            bpy.context.collection.objects.link(obj)
        return into.objects

    def test_a_linked_target_is_refused(self, library):
        bpy.context.scene.skinwright.transfer.source, coat = library
        builders.select(coat)
        refused("Coat is linked from .*library.blend", coat)

    def test_a_local_object_of_a_linked_mesh_is_refused(self, library):
        bpy.context.scene.skinwright.transfer.source, coat = library
        local = bpy.data.objects.new("Local", coat.data)
        bpy.context.collection.objects.link(local)
        builders.select(local)
        refused("Local is linked from .*library.blend", local)

    def test_a_linked_source_gives(self, library):
        bpy.context.scene.skinwright.transfer.source = library[0]
        local = builders.grid("Local", 5, size=1.8, z=0.02)
        builders.select(local)
        bpy.ops.skinwright.transfer_weights()
        assert builders.dense(local, BONES).sum(1) == pytest.approx(1, abs=1e-6)


class TestWarnings:
    """Done, but look."""

    def warnings(self, report):
        return " | ".join(report.all_warnings())

    def test_none_in_the_ordinary_case(self, plain, body, coat):
        assert self.warnings(plain(body, coat)) == ""

    def test_shared_mesh(self, plain, body, coat):
        twin = coat.copy()
        bpy.context.collection.objects.link(twin)
        assert f"shares its mesh with {twin.name}" in self.warnings(plain(body, coat))
        assert builders.weights(twin) == builders.weights(coat)

    def test_single_user(self, plain, body, coat):
        twin = coat.copy()
        bpy.context.collection.objects.link(twin)
        before = builders.weights(twin)
        assert self.warnings(plain(body, coat, make_single_user=True)) == ""
        assert coat.data != twin.data
        assert builders.weights(twin) == before != builders.weights(coat)

    def test_apart(self, plain, body, coat):
        coat.location.z = 0.5
        bpy.context.view_layer.update()
        assert "hardly overlap" in self.warnings(plain(body, coat, max_distance=1.0))

    def test_posed_armature(self, plain, body, coat):
        body.find_armature().pose.bones["Arm.L"].location.x = 0.1
        bpy.context.view_layer.update()
        assert "is posed" in self.warnings(plain(body, coat))
        assert self.warnings(plain(body, coat)) == "", "the coat has the armature now"

    def test_several_armatures_are_all_used(self, plain, body, coat):
        second = builders.rig("Second", bones=("pin",))
        body.modifiers.new("Second", "ARMATURE").object = second
        assert "armature" not in self.warnings(plain(body, coat))
        assert [m.object for m in coat.modifiers] == [bpy.data.objects["Rig"], second]
        assert builders.dense(coat, [*BONES, "pin"]).sum(1) == pytest.approx(1, abs=1e-6)
        assert builders.dense(coat, ["pin"]).any()

    def test_bones_missing_on_the_targets_armature(self, plain, body, coat):
        other = builders.rig("Other", bones=("Arm.L",))
        coat.modifiers.new("Armature", "ARMATURE").object = other
        assert "Other, which deforms Coat, lacks 1 of the bones, Arm.R" in self.warnings(plain(body, coat))

    def test_weights_of_bones_the_source_lacks(self, plain, body, coat):
        rig = builders.rig("Coat Rig", bones=(*BONES, "Tail"))
        coat.modifiers.new("Armature", "ARMATURE").object = rig
        builders.paint(coat, Tail=[0.5] + [np.nan] * 24)
        assert "keeps its weights in 1 groups of bones Body lacks (Tail" in self.warnings(plain(body, coat))
        assert builders.weights(coat)[0]["Tail"] == 0.5

    def test_shear(self, plain, body, coat):
        parent = bpy.data.objects.new("Parent", None)
        bpy.context.collection.objects.link(parent)
        parent.scale.x = 2
        coat.parent, coat.rotation_euler.z = parent, 0.5
        bpy.context.view_layer.update()
        assert "shears Coat" in self.warnings(plain(body, coat))

    def test_mirroring_without_vertex_groups(self, plain, body, coat):
        coat.modifiers.new("Mirror", "MIRROR").use_mirror_vertex_groups = False
        assert "Vertex Groups is off in the modifier Mirror of Coat" in self.warnings(plain(body, coat))

    def test_unnormalised_source(self, plain, body, coat):
        body.vertex_groups["Arm.L"].add([0, 1], 0.5, "ADD")
        for name in BONES:
            body.vertex_groups[name].remove([5])
        warnings = self.warnings(plain(body, coat))
        assert "2 vertices of Body have weights that do not sum to 1" in warnings
        assert "1 vertices of Body have no weights" in warnings
        assert builders.dense(coat, BONES).sum(1) == pytest.approx(1, abs=1e-6)


def test_an_object_without_a_place_in_the_scene(plain, body):
    """Scripts may name objects that are in no collection: at rest nothing needs the scene."""
    loose = bpy.data.objects.new("Loose", builders.grid("Made", 4).data.copy())
    plain(body, loose)
    assert builders.dense(loose, BONES).sum(1) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("locked", [False, True])
def test_a_mask_that_would_be_overwritten(coat, locked):
    """It would steer once and be gone; a locked group stays."""
    coat.skinwright.mask_group = "Arm.L"
    coat.vertex_groups["Arm.L"].lock_weight = locked
    if locked:
        assert bpy.ops.skinwright.transfer_weights() == {"FINISHED"}
    else:
        refused("The mask of Coat is its group Arm.L, which would be overwritten", coat)
