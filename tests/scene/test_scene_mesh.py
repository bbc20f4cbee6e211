"""scene.mesh: world space, winding, evaluated shapes, and modes."""

from math import radians

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
from mathutils import Matrix, Vector  # noqa: E402  (there is no mathutils without bpy)


@pytest.fixture
def mesh(addon, scene):
    return addon.scene.mesh


@pytest.fixture
def scene_error(addon):
    return addon.scene.error.SceneError


def normals(geometry):
    a, b, c = (geometry.positions[geometry.triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def test_positions_are_in_the_world(mesh):
    obj = builders.grid("Garment", 4)
    parent = bpy.data.objects.new("Parent", None)
    obj.parent = parent
    parent.matrix_world = Matrix.Translation((1, 2, 3)) @ Matrix.Rotation(radians(30), 4, "X")
    obj.matrix_local = Matrix.Diagonal((2, 3, 4, 1))
    bpy.context.view_layer.update()
    expected = [obj.matrix_world @ v.co for v in obj.data.vertices]
    geometry = mesh.read(obj)
    assert geometry.positions.dtype == np.float32 and geometry.triangles.dtype == np.uint32
    assert geometry.positions == pytest.approx(np.array(expected), abs=1e-6)


def test_polygons_become_triangles(mesh):
    obj = builders.mesh("Pentagon", [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 3, 0), (0, 2, 0)], [(0, 1, 2, 3, 4)])
    geometry = mesh.read(obj)
    assert len(geometry.triangles) == 3
    assert normals(geometry)[:, 2].sum() / 2 == pytest.approx(5)


@pytest.mark.parametrize(
    "faces",
    [
        [(0, 1, 2), (3, 2, 1)],
        [(0, 1, 3, 2)],
        [(0, 1, 2), (1, 4, 3, 2)],
        [(0, 1, 2, 3), (0, 1, 4), (1, 2, 4), (3, 4, 2)],
    ],
    ids=["triangles", "a quad", "both", "mostly triangles"],
)
def test_triangles_are_blenders(mesh, faces):
    obj = builders.mesh("Faces", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 1)], faces)
    obj.data.calc_loop_triangles()
    wanted = [list(triangle.vertices) for triangle in obj.data.loop_triangles]
    assert mesh.triangles(obj).tolist() == wanted
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    assert mesh.triangles(obj).tolist() == wanted


@pytest.mark.parametrize("scale", [(-1, 1, 1), (1, 1, -2), (-1, -3, -1)])
def test_mirrored_objects_keep_their_outside(mesh, scale):
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    cube.scale = scale
    bpy.context.view_layer.update()
    geometry = mesh.read(cube)
    centres = geometry.positions[geometry.triangles].mean(axis=1)
    assert (np.einsum("ij,ij->i", normals(geometry), centres) > 0).all()


def test_rest_ignores_modifiers_pose_and_shape_keys(mesh):
    obj = builders.body(4)
    obj.find_armature().pose.bones["Arm.L"].location = (0, 3, 0)
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="Up")
    for point in key.data:
        point.co.z += 1
    key.value = 1
    obj.active_shape_key_index = 1
    bpy.context.view_layer.update()
    assert mesh.read(obj).positions[:, 2] == pytest.approx(0)


def test_scale_of_zero_is_refused(mesh, scene_error):
    obj = builders.grid("Garment", 3)
    obj.scale.y = 0
    bpy.context.view_layer.update()
    with pytest.raises(scene_error, match="Garment is scaled to nothing"):
        mesh.read(obj)


def test_tiny_scales_are_not_nothing(mesh):
    obj = builders.grid("Garment", 3)
    obj.scale = (1e-4, 1e-4, 1e-4)
    bpy.context.view_layer.update()
    assert np.ptp(mesh.read(obj).positions[:, 0]) == pytest.approx(2e-4)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_coordinate_that_is_not_finite_is_named(mesh, scene_error, bad):
    obj = builders.grid("Garment", 3)
    positions = np.zeros(27, np.float32)
    positions[16] = bad
    obj.data.attributes["position"].data.foreach_set("vector", positions)
    with pytest.raises(scene_error, match="Garment .* vertex 5"):
        mesh.read(obj)


@pytest.mark.parametrize("positions", [[], [(0, 0, 0), (1, 0, 0)]])
def test_a_mesh_without_faces_is_refused(mesh, scene_error, positions):
    with pytest.raises(scene_error, match="Garment has no faces"):
        mesh.read(builders.mesh("Garment", positions, []))


def test_shear(mesh):
    parent = bpy.data.objects.new("Parent", None)
    parent.scale = (1, 3, 1)
    obj = builders.grid("Garment", 3)
    obj.parent = parent
    bpy.context.collection.objects.link(parent)
    bpy.context.view_layer.update()
    assert not mesh.is_sheared(obj)
    obj.rotation_euler.z = radians(30)
    bpy.context.view_layer.update()
    assert mesh.is_sheared(obj)


def test_object_mode_leaves_and_restores_edit_mode(mesh):
    """With three selected meshes of which two are edited, the same two are edited again afterwards."""
    a, b, c = (builders.grid(name, 3) for name in "abc")
    builders.select(a, b)
    bpy.ops.object.mode_set(mode="EDIT")
    c.select_set(True)
    with mesh.object_mode(bpy.context):
        assert [obj.mode for obj in (a, b, c)] == ["OBJECT"] * 3
    assert [obj.mode for obj in (a, b, c)] == ["EDIT", "EDIT", "OBJECT"]
    assert all(obj.select_get() for obj in (a, b, c))
    assert bpy.context.view_layer.objects.active == b
    bpy.ops.object.mode_set(mode="OBJECT")


def test_object_mode_restores_after_an_error(mesh):
    a = builders.grid("a", 3)
    builders.select(a)
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(KeyError), mesh.object_mode(bpy.context):
        raise KeyError
    assert a.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")


def test_selected_and_other_users(mesh):
    obj = builders.grid("Garment", 3)
    select = np.arange(9) % 2 == 0
    obj.data.vertices.foreach_set("select", select)
    other = bpy.data.objects.new("Other", obj.data)
    assert mesh.selected(obj).tolist() == select.tolist()
    assert mesh.other_users(obj) == [other.name]


def test_painting_with_a_face_mask_its_faces_are_selected(mesh):
    obj = builders.grid("Garment", 3)
    obj.data.vertices.foreach_set("select", np.zeros(9, bool))
    builders.select(obj)
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
    obj.data.use_paint_mask = True
    obj.data.polygons.foreach_set("select", [False, True, False, False])
    assert np.flatnonzero(mesh.selected(obj)).tolist() == [1, 2, 4, 5]
    obj.data.use_paint_mask = False
    obj.data.vertices.foreach_set("select", np.arange(9) == 8)
    assert np.flatnonzero(mesh.selected(obj)).tolist() == [8]
    bpy.ops.object.mode_set(mode="OBJECT")


def test_size(mesh):
    assert mesh.read(builders.grid("Garment", 3, size=3.0)).size == pytest.approx(Vector((3, 3, 0)))
