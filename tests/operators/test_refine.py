"""Refinement in Blender: correctives against the solver, their removal, the cache's playback, the preview's traces."""

import importlib
import json

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


def tube(around=16, along=24, reach=2.0):
    """A capped tube of radius 0.25 along x, with two bones. Cells are a share of the size: a long tube has few."""
    x, angle = np.linspace(-reach, reach, along + 1), np.arange(around) * 2 * np.pi / around
    positions = [(u, 0.25 * np.cos(a), 0.25 * np.sin(a)) for u in x for a in angle] + [(-reach, 0, 0), (reach, 0, 0)]
    faces, ends = [], (len(positions) - 2, len(positions) - 1)
    for j in range(around):
        k = (j + 1) % around
        faces += [(i * around + j, (i + 1) * around + j, (i + 1) * around + k, i * around + k) for i in range(along)]
        faces += [(ends[0], j, k), (ends[1], along * around + k, along * around + j)]
    obj = builders.mesh("Limb", positions, faces)
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    upper, lower = (rig.data.edit_bones.new(name) for name in ("Upper", "Lower"))
    upper.head, upper.tail, lower.head, lower.tail = (-reach, 0, 0), (0, 0, 0), (0, 0, 0), (reach, 0, 0)
    lower.parent = upper
    bpy.ops.object.mode_set(mode="OBJECT")
    t = np.clip((np.array([p[0] for p in positions]) + 0.25) / 0.5, 0, 1)
    t = t * t * (3 - 2 * t)
    builders.paint(obj, Upper=1 - t, Lower=t)
    obj.modifiers.new("Armature", "ARMATURE").object = rig
    rig.pose.bones["Lower"].rotation_mode = "QUATERNION"
    builders.select(obj)
    return obj, rig


def part(addon, name):
    """A module of the add-on."""
    return importlib.import_module(f"{addon.__name__}.{name}")


def turn(rig, axis, degrees):
    from mathutils import Quaternion

    rig.pose.bones["Lower"].rotation_quaternion = Quaternion(axis, np.radians(degrees))
    bpy.context.view_layer.update()


def shown(obj):
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    positions = np.empty(len(evaluated.data.vertices) * 3, np.float32)
    evaluated.data.vertices.foreach_get("co", positions)
    return positions.reshape(-1, 3)


def solver(addon, obj):
    """The native object as the operators make it, and the present pose."""
    character = part(addon, "refine.character")
    read = character.read(obj)
    return read.refiner(part(addon, "refine.params").RefineParams()), lambda: character.pose(obj, read)


@pytest.mark.parametrize("preserve_volume", [False, True])
def test_correctives_match_the_solver(addon, preserve_volume):
    obj, rig = tube()
    obj.modifiers["Armature"].use_deform_preserve_volume = preserve_volume
    refiner, pose = solver(addon, obj)
    assert bpy.ops.skinwright.bake_correctives(samples=4, twist=np.radians(90)) == {"FINISHED"}
    worst = {}
    for axis, degrees in [((1, 0, 0), 60), ((1, 0, 0), -120), ((0, 0, 1), 90), ((0, 1, 0), 45)]:
        turn(rig, axis, degrees)
        worst[axis, degrees] = np.linalg.norm(shown(obj) - refiner.solve(pose(), quality="bake"), axis=1).max()
    assert max(worst.values()) < 0.01, worst
    between = {}
    for degrees in (45, 75, 105):
        turn(rig, (1, 0, 0), degrees)
        between[degrees] = np.linalg.norm(shown(obj) - refiner.solve(pose(), quality="bake"), axis=1).max()
    assert max(between.values()) < 0.03, between


def test_keys_share_a_pose_and_ask_for_no_permission(addon):
    obj, rig = tube()
    bpy.ops.skinwright.bake_correctives(samples=3, twist=0)
    drivers = obj.data.shape_keys.animation_data.drivers
    assert all(curve.driver.is_simple_expression and curve.driver.is_valid for curve in drivers)
    turn(rig, (0.6, 0, 0.8), 80)
    values = [key.value for key in obj.data.shape_keys.key_blocks[1:]]
    assert sum(values) == pytest.approx(1, abs=1e-4)
    turn(rig, (1, 0, 0), 0)
    assert max(key.value for key in obj.data.shape_keys.key_blocks[1:]) < 1e-6


def test_removing_leaves_no_trace(addon):
    obj, _ = tube()
    before = set(obj.keys()), [m.name for m in obj.modifiers]
    bpy.ops.skinwright.bake_correctives(samples=2)
    record = json.loads(obj["skinwright_refine"])
    assert record["keys"] and all(c["pairs_after"] <= c["pairs_before"] for c in record["certificates"])
    assert all(abs(c["volume_after"]) < 0.05 for c in record["certificates"])
    assert bpy.ops.skinwright.remove_correctives() == {"FINISHED"}
    assert obj.data.shape_keys is None
    assert (set(obj.keys()), [m.name for m in obj.modifiers]) == before


@pytest.mark.parametrize("keys", [(), ("Basis", "Smile")])
def test_a_pin_would_hide_the_keys(addon, keys):
    obj, _ = tube()
    for name in keys:
        obj.shape_key_add(name=name)
    obj.show_only_shape_key = True
    with pytest.raises(RuntimeError, match="Limb shows one shape key alone: take the pin off"):
        bpy.ops.skinwright.bake_correctives(samples=1)
    assert [key.name for key in obj.data.shape_keys.key_blocks] == list(keys) if keys else not obj.data.shape_keys


def test_other_keys_and_drivers_stay(addon):
    obj, _ = tube()
    obj.shape_key_add(name="Basis")
    smile = obj.shape_key_add(name="Smile")
    smile.driver_add("value").driver.expression = "0.5"
    bpy.ops.skinwright.bake_correctives(samples=1)
    bpy.ops.skinwright.bake_correctives(samples=1)
    bpy.ops.skinwright.remove_correctives()
    assert [key.name for key in obj.data.shape_keys.key_blocks] == ["Basis", "Smile"]
    assert len(obj.data.shape_keys.animation_data.drivers) == 1


@pytest.mark.parametrize("kind", ["PC2", "MDD"])
def test_a_cache_plays_what_the_solver_says(addon, tmp_path, kind):
    obj, rig = tube()
    for frame, degrees in ((1, 0), (4, 110)):
        turn(rig, (1, 0, 0), degrees)
        rig.pose.bones["Lower"].keyframe_insert("rotation_quaternion", frame=frame)
    refiner, pose = solver(addon, obj)
    path = tmp_path / f"limb.{kind.lower()}"
    done = bpy.ops.skinwright.bake_refined_cache(filepath=str(path), kind=kind, frame_start=1, frame_end=4)
    assert done == {"FINISHED"}
    for frame in (2, 4):
        bpy.context.scene.frame_set(frame)
        np.testing.assert_allclose(shown(obj), refiner.solve(pose(), quality="bake"), atol=2e-6)
    assert bpy.ops.skinwright.remove_refined_cache() == {"FINISHED"}
    assert [m.type for m in obj.modifiers] == ["ARMATURE"]


def stretch_time(rig):
    bpy.context.scene.render.frame_map_new = 200


def show_at_rest(rig):
    rig.data.pose_position = "REST"


@pytest.mark.parametrize(("change", "sentence"), [(stretch_time, "stretches time"), (show_at_rest, "Pose Position")])
def test_what_a_cache_could_not_play(addon, tmp_path, change, sentence):
    obj, rig = tube()
    change(rig)
    path = tmp_path / "limb.pc2"
    with pytest.raises(RuntimeError, match=sentence):
        bpy.ops.skinwright.bake_refined_cache(filepath=str(path), frame_start=1, frame_end=2)
    assert not path.exists()
    assert [m.type for m in obj.modifiers] == ["ARMATURE"]


@pytest.mark.parametrize("parented", [False, True])
def test_the_preview_goes_where_the_object_goes(addon, parented):
    obj, rig = tube()
    obj.delta_location = (0, 0, 1)
    before = set(bpy.data.objects.keys())
    bpy.ops.skinwright.live_refine()
    (copy,) = [other for other in bpy.data.objects if other.name not in before]
    if parented:
        obj.parent, rig.location, rig.scale = rig, (5, 0, 0), (2, 2, 2)
    else:
        obj.location, obj.rotation_euler = (0, 3, 0), (0.5, 0, 1)
    bpy.context.view_layer.update()
    np.testing.assert_allclose(copy.matrix_world, obj.matrix_world, atol=1e-6)
    bpy.ops.skinwright.live_refine()


def test_the_preview_follows_and_leaves_no_trace(addon):
    obj, rig = tube()
    refiner, pose = solver(addon, obj)
    objects, meshes, keys = set(bpy.data.objects.keys()), set(bpy.data.meshes.keys()), set(obj.keys())
    rest = builders.weights(obj), shown(obj).copy()
    assert bpy.ops.skinwright.live_refine() == {"FINISHED"}
    turn(rig, (1, 0, 0), 100)
    (copy,) = [other for other in bpy.data.objects if other.name not in objects]
    np.testing.assert_allclose(shown(copy), refiner.solve(pose(), quality="live"), atol=1e-6)
    assert obj.hide_get()
    assert bpy.ops.skinwright.live_refine() == {"FINISHED"}
    assert (set(bpy.data.objects.keys()), set(bpy.data.meshes.keys()), set(obj.keys())) == (objects, meshes, keys)
    assert not obj.hide_get()
    turn(rig, (1, 0, 0), 0)
    assert builders.weights(obj) == rest[0]
    np.testing.assert_array_equal(shown(obj), rest[1])


def test_the_preview_ends_when_its_mesh_goes_and_is_never_saved(addon, tmp_path):
    obj, rig = tube()
    bpy.ops.skinwright.live_refine()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"), copy=True)
    with bpy.data.libraries.load(str(tmp_path / "saved.blend")) as (found, _):
        assert sorted(found.objects) == ["Limb", "Rig"]
    assert len(bpy.data.objects) == 3
    bpy.data.objects.remove(obj)
    turn(rig, (1, 0, 0), 50)
    assert sorted(bpy.data.objects.keys()) == ["Rig"]


def test_a_garment_follows(addon):
    obj, rig = tube()
    garment = obj.copy()
    garment.data = obj.data.copy()
    garment.name = "Sleeve"
    garment.data.transform(((1, 0, 0, 0), (0, 1.04, 0, 0), (0, 0, 1.04, 0), (0, 0, 0, 1)))
    bpy.context.collection.objects.link(garment)
    builders.select(garment, obj)
    bpy.ops.skinwright.live_refine()
    turn(rig, (1, 0, 0), 90)
    preview_object = part(addon, "scene.preview_object")
    body, sleeve = (shown(preview_object.of(name)) for name in ("Limb", "Sleeve"))
    skinned = shown(garment)
    assert np.linalg.norm(sleeve - skinned, axis=1).max() > 0.02
    moved = sleeve - skinned, body - shown(obj)
    assert np.abs(moved[0] - moved[1]).max() < 0.02
    bpy.ops.skinwright.live_refine()


def test_refusals_are_sentences(addon):
    obj, _ = tube()
    obj.data.vertices[5].co.x = float("nan")
    with pytest.raises(RuntimeError, match="not a number"):
        bpy.ops.skinwright.bake_correctives()
    obj.data.vertices[5].co.x = 0
    for vertex in obj.data.vertices:
        vertex.co.z = 0
    with pytest.raises(RuntimeError, match="encloses nothing"):
        bpy.ops.skinwright.bake_correctives()
    assert obj.data.shape_keys is None


@pytest.mark.parametrize("kind", ["glb", "fbx"])
def test_keys_survive_export(addon, tmp_path, kind):
    obj, _ = tube()
    bpy.ops.skinwright.bake_correctives(samples=1, twist=0)
    names = [key.name for key in obj.data.shape_keys.key_blocks[1:]]
    offsets = [np.ptp(key_offsets(obj, name), axis=0).max() for name in names]
    path = str(tmp_path / f"limb.{kind}")
    if kind == "glb":
        bpy.ops.export_scene.gltf(filepath=path, export_morph=True)
    else:
        bpy.ops.export_scene.fbx(filepath=path, use_mesh_modifiers=False)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    (bpy.ops.import_scene.gltf if kind == "glb" else bpy.ops.import_scene.fbx)(filepath=path)
    (found,) = [other for other in bpy.data.objects if other.type == "MESH" and other.data.shape_keys]
    assert [key.name for key in found.data.shape_keys.key_blocks[1:]] == names
    again = [np.ptp(key_offsets(found, name), axis=0).max() for name in names]
    scale = found.matrix_world.to_scale()[0]
    np.testing.assert_allclose(np.array(again) * scale, offsets, rtol=0.02)


def key_offsets(obj, name):
    """(V, 3) what a key adds to the Basis."""
    keys, values = obj.data.shape_keys, []
    for key in (keys.key_blocks[name], keys.reference_key):
        values.append(np.empty(3 * len(key.data), np.float32))
        key.data.foreach_get("co", values[-1])
    return (values[0] - values[1]).reshape(-1, 3)


def bent(rig, frames=((1, 0), (4, 110))):
    """Bend the limb over these frames."""
    for frame, degrees in frames:
        turn(rig, (1, 0, 0), degrees)
        rig.pose.bones["Lower"].keyframe_insert("rotation_quaternion", frame=frame)


def fatter_by_key(obj):
    obj.shape_key_add(name="Basis")
    fat = obj.shape_key_add(name="Fat")
    for point in fat.data:
        point.co.y *= 1.3
        point.co.z *= 1.3
    fat.value = 1


def fatter_by_modifier(obj):
    obj.modifiers.new("Fat", "DISPLACE").strength = 0.08
    obj.modifiers.move(1, 0)


@pytest.mark.parametrize("fatter", [fatter_by_key, fatter_by_modifier])
def test_the_shape_that_is_shown_is_refined(addon, tmp_path, fatter):
    obj, rig = tube()
    bent(rig)
    fatter(obj)
    bpy.context.scene.frame_set(1)
    expected = shown(obj)
    bpy.ops.skinwright.live_refine()
    np.testing.assert_allclose(shown(part(addon, "scene.preview_object").of("Limb")), expected, atol=1e-3)
    bpy.ops.skinwright.live_refine()
    bpy.ops.skinwright.bake_refined_cache(filepath=str(tmp_path / "a.pc2"), frame_start=1, frame_end=4)
    np.testing.assert_allclose(shown(obj), expected, atol=1e-3)


def test_animated_shape_keys_are_named(addon, tmp_path):
    obj, rig = tube()
    bent(rig)
    fatter_by_key(obj)
    bake = {"filepath": str(tmp_path / "a.pc2"), "frame_start": 1, "frame_end": 1}
    bpy.ops.skinwright.bake_refined_cache(**bake)
    assert not addon.reporting.last.warnings
    obj.data.shape_keys.key_blocks["Fat"].keyframe_insert("value", frame=1)
    bpy.ops.skinwright.bake_refined_cache(**bake)
    assert "Limb has animated shape keys" in addon.reporting.last.warnings[0]


@pytest.mark.parametrize("scale", [1.0, 1.1])
def test_a_mesh_that_is_inside_out_is_refined_as_the_right_one(addon, scale):
    """Of size 1 the lattice of such a mesh was a few cells, and of 1.1 there was none."""
    obj, rig = tube()
    for vertex in obj.data.vertices:
        vertex.co *= scale
    turn(rig, (1, 0, 0), 90)
    found = []
    for _ in range(2):
        refiner, pose = solver(addon, obj)
        found.append(refiner.solve(pose(), quality="live"))
        obj.data.flip_normals()
    np.testing.assert_allclose(*found, atol=0.01)  # its quads are cut along the other diagonals


@pytest.mark.parametrize("kind", ["SOLIDIFY", "MASK", "WELD", "SCREW", "MIRROR"])
def test_a_cache_that_could_not_be_played_is_refused(tmp_path, kind):
    obj, rig = tube()
    bent(rig)
    obj.modifiers.new("First", kind)
    obj.modifiers.move(1, 0)
    path = tmp_path / "a.pc2"
    with pytest.raises(RuntimeError, match="Limb has .*First before its armature"):
        bpy.ops.skinwright.bake_refined_cache(filepath=str(path), frame_start=1, frame_end=2)
    assert not path.exists() and len(obj.modifiers) == 2


def test_the_half_that_a_mirror_makes_is_not_refined_as_the_other(tmp_path):
    obj, _ = tube()
    obj.modifiers.new("Half", "MIRROR")
    obj.modifiers.move(1, 0)
    for operator in (bpy.ops.skinwright.bake_correctives, bpy.ops.skinwright.live_refine):
        with pytest.raises(RuntimeError, match="Limb has the modifier Half before its armature"):
            operator()


class TestForeignFiles:
    """Baking costs nobody a file; baking again replaces what was baked."""

    def test_a_certificate_replaces_a_certificate_only(self, tmp_path):
        tube()
        path = tmp_path / "certificate.json"
        path.write_text("my notes")
        with pytest.raises(RuntimeError, match="certificate.json exists and is not a report"):
            bpy.ops.skinwright.bake_correctives(samples=1, filepath=str(path))
        assert path.read_text() == "my notes" and bpy.data.objects["Limb"].data.shape_keys is None
        path.unlink()
        for _ in range(2):
            bpy.ops.skinwright.bake_correctives(samples=1, filepath=str(path))
        assert json.loads(path.read_text())

    def test_a_cache_replaces_a_cache_only(self, tmp_path):
        tube()
        path = tmp_path / "scene.blend"
        path.write_bytes(b"BLENDER")
        with pytest.raises(RuntimeError, match=r"scene.blend exists already"):
            bpy.ops.skinwright.bake_refined_cache(filepath=str(path), kind="PC2", frame_start=1, frame_end=2)
        assert path.read_bytes() == b"BLENDER"

    def test_a_cache_replaces_its_own_only(self, tmp_path):
        obj, rig = tube()
        bent(rig)
        path = tmp_path / "cloth.pc2"
        path.write_bytes(b"POINTCACHE2 of another program")
        bake = {"filepath": str(path), "frame_start": 1, "frame_end": 2}
        with pytest.raises(RuntimeError, match=r"cloth.pc2 exists already"):
            bpy.ops.skinwright.bake_refined_cache(**bake)
        assert path.read_bytes() == b"POINTCACHE2 of another program" and len(obj.modifiers) == 1
        assert bpy.ops.skinwright.bake_refined_cache(**bake, overwrite=True) == {"FINISHED"}
        assert bpy.ops.skinwright.bake_refined_cache(**bake) == {"FINISHED"}
        bpy.ops.skinwright.remove_refined_cache()
        assert bpy.ops.skinwright.bake_refined_cache(**bake) == {"FINISHED"}

    def test_no_cache_is_taken_from_another_object(self, tmp_path):
        obj, rig = tube()
        bent(rig)
        bake = {"filepath": str(tmp_path / "limb.pc2"), "frame_start": 1, "frame_end": 2}
        bpy.ops.skinwright.bake_refined_cache(**bake)
        content = (tmp_path / "limb.pc2").read_bytes()
        other = obj.copy()
        other.data, other.name = obj.data.copy(), "Other"
        bpy.context.collection.objects.link(other)
        builders.select(other)
        for overwrite in (False, True):
            with pytest.raises(RuntimeError, match=r"limb.pc2 is played by Limb"):
                bpy.ops.skinwright.bake_refined_cache(**bake, overwrite=overwrite)
        assert (tmp_path / "limb.pc2").read_bytes() == content


def test_objects_of_libraries_may_have_the_same_names(addon, tmp_path):
    """The armature is the one that the modifier names, not the local one that is called so."""
    tube()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"), copy=True)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    local, rig = tube()
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, here):
        here.objects = ["Limb", "Rig"]
    linked = next(obj for obj in here.objects if obj.type == "MESH")
    for obj in here.objects:
        bpy.context.collection.objects.link(obj)
    turn(rig, (1, 0, 0), 90)
    character = part(addon, "refine.character")
    assert np.allclose(character.pose(linked, character.read(linked)), np.eye(4))
    assert not np.allclose(character.pose(local, character.read(local)), np.eye(4))
    builders.select(linked)
    assert bpy.ops.skinwright.live_refine() == {"FINISHED"}
    (copy,) = [obj for obj in bpy.data.objects if obj.get("skinwright_preview_of")]
    assert np.abs(shown(copy) - shown(linked)).max() < 0.01
    bpy.ops.skinwright.live_refine()


def test_a_character_of_a_linked_collection_is_previewed(addon, tmp_path):
    obj, rig = tube()
    collection = bpy.data.collections.new("Character")
    bpy.context.scene.collection.children.link(collection)
    for part_ in (obj, rig):
        collection.objects.link(part_)
        bpy.context.scene.collection.objects.unlink(part_)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"), copy=True)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, here):
        here.collections = ["Character"]
    bpy.context.scene.collection.children.link(here.collections[0])
    limb = next(obj for obj in bpy.data.objects if obj.type == "MESH")
    builders.select(limb)
    assert bpy.ops.skinwright.live_refine() == {"FINISHED"}
    assert part(addon, "scene.preview_object").of("Limb").visible_get() and not limb.visible_get()
    bpy.ops.skinwright.live_refine()
    assert limb.visible_get() and part(addon, "scene.preview_object").of("Limb") is None


def test_bones_of_the_command_line_are_those_of_the_armature(addon, tmp_path, capsys):
    tube()
    command = addon.headless.command_line.refine
    assert command(["correctives", "--object", "Limb", "--bone", "Lower", "--bone", "Elbow"]) == 1
    assert "Rig has no bone Elbow" in capsys.readouterr().err
    assert bpy.data.objects["Limb"].data.shape_keys is None
    assert command(["remove", "--object", "Limb", "--report", str(tmp_path / "report.json")]) == 0
    assert "0 corrective keys" in json.loads((tmp_path / "report.json").read_text())["sentence"]
