"""An armature for a mesh that has none: joints, what is made and what stays, the command, three presses in a row."""

import json
import subprocess
import sys
from pathlib import Path

import builders
import doll
import figure
import numpy as np
import pytest

Matrix = pytest.importorskip("mathutils", reason="needs the bpy wheel").Matrix
bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
bmesh = pytest.importorskip("bmesh", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")
SCRIPT = Path(__file__).resolve().parents[2] / "blender_scripts" / "embed_armature.py"
HEIGHT = 1.8


def bare(name, arm_length=0.7, lift=0.0):
    return builders.mesh(name, *doll.figure(arm_length, lift))


@pytest.fixture
def man(scene):
    """A doll in a T pose with bones and weights, away from the middle."""
    ends = doll.skeleton()
    parents = [doll.NAMES[p] if p >= 0 else None for p in doll.PARENTS]
    named = zip(doll.NAMES, ends, parents, strict=True)
    rig = figure.bones({name: (*segment.tolist(), parent) for name, segment, parent in named}, "Man Rig")
    body = bare("Man")
    rig.location = body.location = (3, 0, 0)
    bpy.context.view_layer.update()
    builders.select(body, rig)
    assert bpy.ops.skinwright.automatic_weights(resolution=64) == {"FINISHED"}
    scene.skinwright.retarget.source = rig
    return rig


def heads(rig):
    return np.array([rig.matrix_world @ rig.data.bones[name].head_local for name in doll.NAMES])


def embed(obj, **settings):
    builders.select(obj)
    assert bpy.ops.skinwright.embed_armature(**settings) == {"FINISHED"}
    return next(m.object for m in obj.modifiers if m.type == "ARMATURE")


@pytest.mark.parametrize("method, worst", [("TEMPLATE", 0.06), ("MEDIAL", 0.1)])
@pytest.mark.parametrize("arm_length, lift", [(0.6, 0.0), (0.7, -0.45)], ids=["T", "A"])
def test_joints_lie_where_they_belong(man, method, worst, arm_length, lift):
    """Also if the template stands in a T pose and the mesh in an A pose."""
    child = bare("Child", arm_length, lift)
    rig = embed(child, method=method)
    off = np.linalg.norm(heads(rig) - doll.skeleton(arm_length, lift)[:, 0], axis=1) / HEIGHT
    assert off.max() < worst and off.mean() < worst / 2, dict(zip(doll.NAMES, off.round(3).tolist(), strict=True))
    left = [name.endswith(".L") for name in doll.NAMES]
    right = [name.endswith(".R") for name in doll.NAMES]
    assert (heads(rig)[left, 0] > 0.03).all() and (heads(rig)[right, 0] < -0.03).all()
    np.testing.assert_allclose(heads(rig)[left] * [-1, 1, 1], heads(rig)[right], atol=0.02)


def by_a_key(obj):
    """The mesh itself is half as large, and a shape key in use makes it what it was."""
    obj.shape_key_add(name="Basis")
    real = obj.shape_key_add(name="Real")
    real.value = 1
    for points in (obj.data.vertices, obj.data.shape_keys.reference_key.data):
        for point in points:
            point.co *= 0.5


def by_a_mirror(obj):
    """One half of the mesh, and a Mirror modifier."""
    edited = bmesh.new()
    edited.from_mesh(obj.data)
    bmesh.ops.delete(edited, geom=[vertex for vertex in edited.verts if vertex.co.x < -1e-4], context="VERTS")
    edited.to_mesh(obj.data)
    obj.modifiers.new("Half", "MIRROR")
    obj.modifiers.move(len(obj.modifiers) - 1, 0)


@pytest.mark.parametrize("who", ["target", "template"])
@pytest.mark.parametrize("shaped", [by_a_key, by_a_mirror])
def test_the_shape_that_is_shown_counts(man, who, shaped):
    plain = embed(bare("Plain", 0.6))
    child = bare("Child", 0.6)
    shaped(child if who == "target" else bpy.data.objects["Man"])
    assert np.abs(heads(embed(child)) - heads(plain)).max() < 0.02 * HEIGHT


def test_nothing_that_is_there_is_changed(man):
    body, before = bpy.data.objects["Man"], heads(man)
    weights = builders.dense(body, doll.NAMES)
    child = bare("Child", 0.6)
    positions = figure.rest(child)
    rig = embed(child)
    assert rig.name == "Child Rig" and rig.data != man.data
    np.testing.assert_array_equal(heads(man), before)
    np.testing.assert_array_equal(builders.dense(body, doll.NAMES), weights)
    np.testing.assert_array_equal(figure.rest(child), positions)
    assert not child.vertex_groups and child.parent is None
    confidence = [bone["skinwright_confidence"] for bone in rig.pose.bones]
    assert len(confidence) == len(doll.NAMES) and 0 < min(confidence) <= max(confidence) <= 1
    assert [bone.parent.name if bone.parent else None for bone in rig.data.bones] == [
        bone.parent.name if bone.parent else None for bone in man.data.bones
    ]
    other = embed(bare("Unbound", 0.6), bind=True)
    assert other != rig


def test_refusals_are_sentences_and_make_nothing(man):
    objects = set(bpy.data.objects)
    flat = bpy.data.objects.new("Flat", bpy.data.meshes.new("Flat"))
    bpy.context.collection.objects.link(flat)
    builders.select(flat)
    with pytest.raises(RuntimeError, match="Flat has no faces"):
        bpy.ops.skinwright.embed_armature()
    bpy.data.objects.remove(flat)
    child = bare("Child", 0.6)
    child.data.vertices[3].co.z = float("nan")
    builders.select(child)
    with pytest.raises(RuntimeError, match="Child has a coordinate that is not a number at vertex 3"):
        bpy.ops.skinwright.embed_armature()
    bpy.data.objects.remove(child)
    point = builders.mesh("Point", [(0, 0, 0)] * 3, [(0, 1, 2)])
    builders.select(point)
    for method in ("TEMPLATE", "MEDIAL"):
        with pytest.raises(RuntimeError, match="All vertices of Point lie at one place"):
            bpy.ops.skinwright.embed_armature(method=method)
    bpy.data.objects.remove(point)
    man_body = bpy.data.objects["Man"]
    before = [tuple(vertex.co) for vertex in man_body.data.vertices]
    for vertex in man_body.data.vertices:
        vertex.co = (0, 0, 0)
    builders.select(bare("Child", 0.6))
    with pytest.raises(RuntimeError, match="All vertices of Man lie at one place"):
        bpy.ops.skinwright.embed_armature()
    for vertex, place in zip(man_body.data.vertices, before, strict=True):
        vertex.co = place
    bpy.data.objects.remove(bpy.data.objects["Child"])
    bpy.data.objects["Man"].vertex_groups.clear()
    builders.select(bare("Child", 0.6))
    with pytest.raises(RuntimeError, match="deforms no mesh that has weights"):
        bpy.ops.skinwright.embed_armature()
    bpy.data.objects.remove(bpy.data.objects["Child"])
    assert set(bpy.data.objects) == objects


def test_the_script_does_what_the_operator_does(addon, man, tmp_path):
    child = bare("Child", 0.6)
    blend, out, report = (tmp_path / name for name in ("in.blend", "out.blend", "report.json"))
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), copy=True)
    expected = heads(embed(child))
    arguments = ["--source", "Man Rig", "--target", "Child", "--save", str(out), "--report", str(report)]
    done = subprocess.run(
        [sys.executable, str(SCRIPT), str(blend), *arguments], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert "Child Rig: 11 bones placed" in done.stdout
    assert json.loads(report.read_text())["meshes"] == ["Child"]
    bpy.ops.wm.open_mainfile(filepath=str(out))
    np.testing.assert_array_equal(heads(bpy.data.objects["Child Rig"]), expected)
    assert addon.headless.command_line.main(["embed", "--source", "Man Rig", "--target", "Nobody"]) == 1
    assert addon.headless.command_line.main(["embed", "--source", "Man", "--target", "Child", "--bind", "false"]) == 0


def test_three_presses_take_a_bare_mesh_to_a_pose(man):
    """Embed, weights, refine: then a bent knee keeps its sides apart and its thickness."""
    child = bare("Child", 0.6, -0.3)
    builders.select(child)
    assert bpy.ops.skinwright.embed_armature() == {"FINISHED"}
    assert bpy.ops.skinwright.automatic_weights() == {"FINISHED"}
    rig = next(m.object for m in child.modifiers if m.type == "ARMATURE")
    rest = figure.rest(child)
    figure.turn(rig, "shin.L", 90)
    builders.select(child)
    plain = figure.shown(child)
    knee = heads(rig)[doll.NAMES.index("shin.L")]
    bpy.context.view_layer.objects.active = child
    assert bpy.ops.skinwright.bake_correctives(samples=3) == {"FINISHED"}
    refined = figure.shown(child)
    other_leg = (rest[:, 0] < -0.02) & (rest[:, 2] < 0.8)
    foot = (rest[:, 0] > 0.02) & (rest[:, 2] < 0.1)
    for shown in (plain, refined):
        assert np.isfinite(shown).all()
        assert np.abs(shown - rest)[other_leg].max() < 0.01
        assert np.linalg.norm(shown - rest, axis=1)[foot].min() > 0.3
    near = (np.linalg.norm(rest - knee, axis=1) < 0.12) & (rest[:, 0] > 0.02)
    assert near.any() and np.linalg.norm(refined - plain, axis=1)[near].max() > 1e-3
    assert child.data.shape_keys and len(child.data.shape_keys.key_blocks) > 1


def test_a_mesh_that_follows_another_armature_is_named(addon, man):
    child = bare("Child")
    figure.bind(child, figure.bones({"Old": ((0, 0, 0), (0, 0, 1), None)}, "Old Rig"))
    builders.select(child)
    assert bpy.ops.skinwright.embed_armature() == {"FINISHED"}
    assert "Child is deformed by Old Rig and not by Child Rig" in " ".join(addon.reporting.last.warnings)


@pytest.mark.parametrize("what", ["armature", "landmark"])
def test_what_is_new_finds_a_collection_though_the_active_one_is_linked(addon, man, what, tmp_path):
    library = bpy.data.collections.new("Library")
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {library})
    bpy.data.collections.remove(library)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
        wanted.collections = ["Library"]
    bpy.context.scene.collection.children.link(wanted.collections[0])
    child = bare("Child")
    layer = bpy.context.view_layer
    layer.active_layer_collection = layer.layer_collection.children["Library"]
    if what == "armature":
        made = embed(child)
    else:
        made = addon.scene.landmarks.add_empty(bpy.context, "Chin", child.location, 0.1)
    assert list(made.users_collection) == [bpy.context.scene.collection]


def test_a_template_whose_bones_lie_elsewhere_is_named(addon, man):
    """The scale of the rig was applied, and not that of its mesh."""
    for child in man.children:
        child.data.transform(Matrix.Scale(0.01, 4))
    builders.select(bare("Child"))
    bpy.ops.skinwright.embed_armature()
    assert "bones of Man Rig lie far from the meshes on it" in " ".join(addon.reporting.last.warnings)
