"""Our linear blend skinning puts every vertex where Blender's Armature modifier does."""

import itertools

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
mathutils = pytest.importorskip("mathutils", reason="needs the bpy wheel")

BONES = ("Hip", "Knee", "Toe")


def chain(name: str = "Rig") -> bpy.types.Object:
    """Three bones along x, each hanging on the one before."""
    rig = builders.rig(name, bones=BONES, controls=())
    bpy.ops.object.mode_set(mode="EDIT")
    for before, after in itertools.pairwise(BONES):
        rig.data.edit_bones[after].parent = rig.data.edit_bones[before]
    bpy.ops.object.mode_set(mode="OBJECT")
    return rig


def pose_from_rest(obj: bpy.types.Object, rig: bpy.types.Object) -> np.ndarray:
    """(B, 4, 4) in the mesh's space: world^-1 rig pose rest^-1 rig^-1 world."""
    to_rig = rig.matrix_world.inverted() @ obj.matrix_world
    moved = [rig.pose.bones[bone].matrix @ rig.data.bones[bone].matrix_local.inverted() for bone in BONES]
    return np.array([to_rig.inverted() @ m @ to_rig for m in moved])


def random_weights(count: int) -> np.ndarray:
    """Rows that sum to one, to less, to more, to next to nothing, and to nothing."""
    rng = np.random.default_rng(4)
    weights = rng.dirichlet(np.full(3, 0.5), count)
    weights[1::5] *= 0.2
    weights[2::5] = rng.random((len(weights[2::5]), 3))
    weights[3::5] = 0
    weights[4::15] = [0, 0.00009, 0]
    weights[9::15] = [0, 0.00011, 0]
    return weights.astype(np.float32)


@pytest.mark.parametrize("place", ["together", "apart"])
def test_every_vertex_is_where_blender_puts_it(native, scene, place):
    obj, rig = builders.grid("Body", 12), chain()
    obj.modifiers.new("Armature", "ARMATURE").object = rig
    weights = random_weights(len(obj.data.vertices))
    builders.paint(obj, **{bone: weights[:, j] for j, bone in enumerate(BONES)})
    if place == "apart":
        obj.matrix_world = mathutils.Matrix.LocRotScale((1, 2, 3), mathutils.Euler((0.3, 0.4, 0.5)), (1, -2, 0.5))
        rig.matrix_world = mathutils.Matrix.LocRotScale((-1, 0, 2), mathutils.Euler((1, 0, 2)), (2, 2, 2))
    for index, bone in enumerate(rig.pose.bones):
        bone.rotation_mode = "XYZ"
        bone.rotation_euler = (0.4 + index, -0.7, 0.3 * index)
        bone.location, bone.scale = (0.1, 0.2 * index, 0), (1, 1.2, 0.9)
    bpy.context.view_layer.update()

    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    rest, posed = (np.array([v.co for v in data.vertices]) for data in (obj.data, evaluated))
    ours = native.linear_blend(rest, native.Weights.from_dense(weights), pose_from_rest(obj, rig))
    np.testing.assert_allclose(ours, posed, atol=5e-6)
    assert np.abs(posed - rest).max() > 0.5
    stays = weights.sum(axis=1) < 0.0001
    assert stays.sum() > 10
    np.testing.assert_allclose(posed[stays], rest[stays], atol=1e-6)


@pytest.mark.parametrize("scale", [(1, 1, 1), (1, 1.3, 0.8)])
def test_dual_quaternions_are_preserve_volume(native, scene, scale):
    obj, rig = builders.grid("Body", 12), chain()
    modifier = obj.modifiers.new("Armature", "ARMATURE")
    modifier.object, modifier.use_deform_preserve_volume = rig, True
    weights = random_weights(len(obj.data.vertices))
    builders.paint(obj, **{bone: weights[:, j] for j, bone in enumerate(BONES)})
    for index, bone in enumerate(rig.pose.bones):
        bone.rotation_mode = "XYZ"
        bone.rotation_euler = (1.4 + index, -0.7, 2.3 * index)
        bone.location, bone.scale = (0.1, 0.2 * index, 0), scale
    bpy.context.view_layer.update()

    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    rest, posed = (np.array([v.co for v in data.vertices]) for data in (obj.data, evaluated))
    bones = np.array([rig.data.bones[bone].matrix_local for bone in BONES])
    sparse = native.Weights.from_dense(weights)
    ours = native.dual_quaternion_blend(rest, sparse, pose_from_rest(obj, rig), rest_bones=bones)
    np.testing.assert_allclose(ours, posed, atol=1e-5)
    linear = native.linear_blend(rest, sparse, pose_from_rest(obj, rig))
    assert np.abs(posed - linear).max() > 0.05
