"""Retargeting between two characters of several meshes: what is written, what stays, undo of failures, refusals."""

import json

import builders
import figure
import numpy as np
import pytest
from limbs import ARM, error_of, limb, truth

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
bmesh = pytest.importorskip("bmesh", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


@pytest.fixture
def man():
    rig, meshes = limb("Man", part=10)
    for obj in meshes:
        shares = truth(obj, 3.0)
        builders.paint(obj, **{name.replace(".", "__"): shares[:, j] for j, name in enumerate(ARM)})
    bpy.context.scene.skinwright.retarget.source = rig
    return rig


@pytest.fixture
def child():
    return limb("Child", length=2.0, radius=0.25, around=16, along=30, at=(4, 1, 0), part=12)


def retarget(meshes, **settings):
    builders.select(*meshes)
    return bpy.ops.skinwright.retarget_weights(**settings)


# Of the Biharmonic method as it is on so coarse a limb in one piece.
@pytest.mark.parametrize(("method", "most"), [("SKELETON", 0.05), ("BIHARMONIC", 0.08)])
def test_all_meshes_of_the_target_get_the_weights(man, child, method, most):
    assert retarget(child[1], method=method) == {"FINISHED"}
    for obj in child[1]:
        assert error_of(obj, ARM, 2.0).mean() < most
        assert abs(builders.dense(obj, ARM).sum(1) - 1).max() < 1e-5


def test_meshes_that_are_being_edited_get_the_weights(man, child):
    builders.select(*child[1])
    bpy.ops.object.mode_set(mode="EDIT")
    assert bpy.ops.skinwright.retarget_weights() == {"FINISHED"}
    assert bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    for obj in child[1]:
        assert error_of(obj, ARM, 2.0).mean() < 0.05


def test_bones_of_other_names_are_paired(man):
    names = ("mixamorig:LeftArm", "mixamorig:LeftForeArm", "mixamorig:LeftHand")
    _, meshes = limb("Puppet", names)
    assert retarget(meshes) == {"FINISHED"}
    assert error_of(meshes[0], names, 3.0).mean() < 0.05


def test_the_bone_map_wins_and_can_be_edited(man, child, tmp_path):
    settings = bpy.context.scene.skinwright.retarget
    builders.select(*child[1])
    assert bpy.ops.skinwright.match_bones() == {"FINISHED"}
    assert [(entry.name, entry.source) for entry in settings.bone_map] == [(name, name) for name in ARM]
    settings.bone_map["Hand.L"].source = ""
    retarget(child[1])
    rows = builders.dense(child[1][1], ARM)
    assert not rows[:, 2].any()
    assert np.abs(rows[:, 1] - truth(child[1][1], 2.0)[:, 1:].sum(1)).mean() < 0.05
    path = str(tmp_path / "map.json")
    foreign = tmp_path / "notes.json"
    foreign.write_text("{}")
    with pytest.raises(RuntimeError, match="notes.json exists already"):
        bpy.ops.skinwright.bone_map_save(filepath=str(foreign))
    assert foreign.read_text() == "{}"
    for _ in range(2):
        assert bpy.ops.skinwright.bone_map_save(filepath=path) == {"FINISHED"}
    bpy.ops.skinwright.match_bones()
    assert settings.bone_map["Hand.L"].source == "Hand.L"
    assert bpy.ops.skinwright.bone_map_load(filepath=path) == {"FINISHED"}
    assert settings.bone_map["Hand.L"].source == ""


def test_several_characters_at_once(man, child):
    """Each by its own armature; the bone map of the panel holds for the one it was made for."""
    settings = bpy.context.scene.skinwright.retarget
    _, others = limb("Aunt", length=2.5, radius=0.28, around=14, at=(-4, 0, 0))
    builders.select(*others)
    bpy.ops.skinwright.match_bones()
    settings.bone_map["Hand.L"].source = ""
    assert retarget([*child[1], *others]) == {"FINISHED"}
    assert max(error_of(obj, ARM, 2.0).mean() for obj in child[1]) < 0.05
    assert not builders.dense(others[0], ARM)[:, 2].any()


def test_one_bad_character_of_several_stops_all(man, child):
    rig, others = limb("Aunt", at=(-4, 0, 0))
    for bone in rig.data.bones:
        bone.use_deform = False
    before = [builders.weights(obj) for obj in (*child[1], *others)]
    with pytest.raises(RuntimeError, match="Aunt Rig has no bone that deforms"):
        retarget([*child[1], *others])
    assert [builders.weights(obj) for obj in (*child[1], *others)] == before


def test_locked_groups_and_other_groups_stay(man, child):
    obj = child[1][0]
    builders.paint(obj, pin=0.3, Hand__L=0.25)
    obj.vertex_groups["Hand.L"].lock_weight = True
    assert retarget(child[1]) == {"FINISHED"}
    rows = builders.dense(obj, ["pin", "Hand.L"])
    assert np.allclose(rows, (0.3, 0.25))


def shaped_by_a_key(obj):
    """The mesh itself is half as long, and a shape key in use makes it what it was."""
    obj.shape_key_add(name="Basis")
    real = obj.shape_key_add(name="Real")
    real.value = 1
    for points in (obj.data.vertices, obj.data.shape_keys.reference_key.data):
        for point in points:
            point.co.z *= 0.5


@pytest.mark.parametrize("who", ["source", "target"])
def test_the_shape_that_is_shown_counts(man, child, who):
    expected = [truth(obj, 2.0) for obj in child[1]]
    for obj in child[1] if who == "target" else [o for o in bpy.data.objects if o.name.startswith("Man ")]:
        if obj.type == "MESH":
            shaped_by_a_key(obj)
    assert retarget(child[1], vertex_order=False) == {"FINISHED"}
    for obj, rows in zip(child[1], expected, strict=True):
        assert np.abs(builders.dense(obj, ARM) - rows).sum(1).mean() / 2 < 0.05


def test_half_a_source_under_mirror_gives_as_the_whole_one(scene):
    body = figure.body()
    other = figure.body()
    expected = builders.dense(other, figure.BONES)
    other.vertex_groups.clear()
    rig = body.modifiers[0].object
    for obj in (other, other.modifiers[0].object):
        obj.location.x += 3
    edited = bmesh.new()
    edited.from_mesh(body.data)
    bmesh.ops.delete(edited, geom=[vertex for vertex in edited.verts if vertex.co.x < -1e-4], context="VERTS")
    edited.to_mesh(body.data)
    body.modifiers.new("Half", "MIRROR")
    body.modifiers.move(1, 0)
    scene.skinwright.retarget.source = rig
    assert retarget([other], vertex_order=False) == {"FINISHED"}
    error = np.abs(builders.dense(other, figure.BONES) - expected).sum(1) / 2
    assert error.mean() < 0.01 and error.max() < 0.2


def test_a_landmark_that_is_nowhere_is_named(man, child):
    bpy.context.scene.skinwright.retarget.source = man
    builders.select(*child[1])
    for _ in range(3):
        bpy.ops.skinwright.landmark_add()
    empty = next(obj for obj in bpy.data.objects if obj.type == "EMPTY")
    empty.location.x = float("nan")
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match=f"The landmark {empty.name} is nowhere"):
        retarget(child[1], method="BIHARMONIC")


def test_an_empty_mesh_on_the_source_does_not_matter(man, child):
    nothing = builders.mesh("Nothing", [], [])
    nothing.vertex_groups.new(name=ARM[0])
    nothing.modifiers.new("Armature", "ARMATURE").object = man
    assert retarget(child[1]) == {"FINISHED"}


@pytest.mark.parametrize("who", ["source", "target"])
@pytest.mark.parametrize("method", ["SKELETON", "BIHARMONIC"])
def test_seams_of_the_file_do_not_matter(scene, method, who):
    """Vertices that coincide without a shared edge are one: as many seams as an exporter makes, and equal weights."""
    rig, (source,) = limb("Man")
    builders.paint(source, **{name.replace(".", "__"): truth(source, 3.0)[:, j] for j, name in enumerate(ARM)})
    scene.skinwright.retarget.source = rig
    _, (target,) = limb("Child", length=2.0, radius=0.25, around=16, along=30, at=(4, 1, 0))

    def rows():
        retarget([target], method=method, vertex_order=False)
        return builders.dense(target, ARM)

    expected = {tuple(v.co): row for v, row in zip(target.data.vertices, rows(), strict=True)}
    split = target if who == "target" else source
    edited = bmesh.new()
    edited.from_mesh(split.data)
    bmesh.ops.split_edges(edited, edges=list(edited.edges)[::3])
    edited.to_mesh(split.data)
    wanted = np.array([expected[tuple(vertex.co)] for vertex in target.data.vertices])
    assert np.abs(rows() - wanted).max() < 1e-3


@pytest.mark.parametrize("locked", [ARM[:1], ARM[1:], ARM])
def test_the_others_fill_what_locked_groups_leave(man, child, locked):
    """Also where the new weights are of locked bones alone: there the old ones make room."""
    obj = child[1][0]
    builders.paint(obj, **{name.replace(".", "__"): 0.9 / len(locked) for name in locked})
    for name in locked:
        obj.vertex_groups[name].lock_weight = True
    assert retarget(child[1], max_influences=3) == {"FINISHED"}
    rows = builders.dense(obj, ARM)
    assert np.allclose(rows[:, [ARM.index(name) for name in locked]], 0.9 / len(locked))
    free = [name for name in ARM if name not in locked]
    filled = truth(obj, 2.0)[:, [ARM.index(name) for name in free]].sum(1) > 0.05
    assert np.allclose(rows.sum(1)[filled], 1, atol=1e-5) and rows.sum(1).max() < 1 + 1e-5
    assert np.allclose(builders.dense(child[1][1], ARM).sum(1), 1, atol=1e-5)


def test_locked_groups_that_leave_nothing_are_named(man, child):
    obj = child[1][0]
    builders.paint(obj, Upper__L=0.7, Lower__L=0.7)
    for group in obj.vertex_groups:
        group.lock_weight = True
    before = builders.weights(obj)
    with pytest.raises(RuntimeError, match="locked groups of Child 0 sum to more than 1 at .* first is vertex 0"):
        retarget(child[1])
    assert builders.weights(obj) == before


def test_one_mesh_is_not_two_targets_nor_source_and_target(addon, man, child):
    target, (_, third) = child[1][0], limb("Third", length=2.0, at=(8, 1, 0))
    own, source = third[0].data, next(o for o in bpy.data.objects if o.name.startswith("Man ") and o.type == "MESH")
    for shared, objects in ((target.data, (target, third[0])), (source.data, (third[0],))):
        third[0].data = shared
        before = [builders.weights(obj) for obj in (source, target)]
        with pytest.raises(RuntimeError, match="share one mesh and so its weights"):
            retarget(objects)
        assert [builders.weights(obj) for obj in (source, target)] == before
    third[0].data = own
    twin = bpy.data.objects.new("Twin", own)
    bpy.context.scene.collection.objects.link(twin)
    retarget(third)
    assert any("shares its mesh with Twin" in warning for warning in addon.reporting.last.warnings)


def test_the_correspondence_is_shown(man, child):
    retarget(child[1], show_correspondence=True)
    for obj in child[1]:
        colors = np.empty(4 * len(obj.data.vertices), np.float32)
        obj.data.attributes["Correspondence"].data.foreach_get("color", colors)
        height = np.array([vertex.co.z for vertex in obj.data.vertices]) / 2.0
        assert np.abs(colors.reshape(-1, 4)[:, 2] - height).max() < 0.05


def test_the_scale_of_objects_does_not_matter(man, child):
    child[0].scale = (0.01, 0.01, 0.01)
    bpy.context.view_layer.update()
    retarget(child[1])
    assert max(error_of(obj, ARM, 2.0).mean() for obj in child[1]) < 0.05


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda man, child: child[1][0].modifiers.clear() or setattr(child[1][0], "parent", None), "has no armature"),
        (lambda man, child: [setattr(b, "use_deform", False) for b in child[0].data.bones], "no bone that deforms"),
        (lambda man, child: [o.vertex_groups.clear() for o in bpy.data.objects if o.name.startswith("Man ")
                             and o.type == "MESH"], "deforms no mesh that has weights"),
        (lambda man, child: [setattr(b, "name", f"x{i}") or setattr(b, "use_deform", i > 5)
                             for i, b in enumerate(man.data.bones)], "no bone that deforms"),
    ],
)  # fmt: skip
def test_refusals_name_the_object_and_write_nothing(man, child, spoil, sentence):
    spoil(man, child)
    before = [builders.weights(obj) for obj in child[1]]
    with pytest.raises(RuntimeError, match=sentence):
        retarget(child[1])
    assert [builders.weights(obj) for obj in child[1]] == before


def test_poll_says_what_is_missing(man, child):
    bpy.context.scene.skinwright.retarget.source = None
    builders.select(*child[1])
    assert not bpy.ops.skinwright.retarget_weights.poll()
    bpy.context.scene.skinwright.retarget.source = man
    builders.select(*[obj for obj in man.children if obj.type == "MESH"])
    assert not bpy.ops.skinwright.retarget_weights.poll()


def test_the_command_line_does_the_same(addon, man, child, tmp_path):
    report = tmp_path / "report.json"
    arguments = ["retarget", "--source", man.name, "--report", str(report)]
    for obj in child[1]:
        arguments += ["--target", obj.name]
    assert addon.headless.command_line.main(arguments) == 0
    assert max(error_of(obj, ARM, 2.0).mean() for obj in child[1]) < 0.05
    content = json.loads(report.read_text())
    assert content["matched"] > 0 and len(content["bone_map"]) == 3
    assert content["settings"]["method"] == "skeleton"
    settings = tmp_path / "settings.json"
    settings.write_text(json.dumps({"bone_map": {"Hand.L": "Nobody"}}))
    assert addon.headless.command_line.main([*arguments[:3], *arguments[5:], "--settings", str(settings)]) == 1
