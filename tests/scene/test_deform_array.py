"""Views of Blender's memory agree with its API, do not touch what shares the memory, and refuse what they mistrust."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

PACKAGE = "bl_ext.user_default.skinwright"
N = 500


@pytest.fixture
def deform_array(scene):
    return import_module(f"{PACKAGE}.scene.deform_array")


@pytest.fixture
def mesh(scene):
    """Vertex i has i % 5 influences."""
    import bpy

    mesh = bpy.data.meshes.new("Mesh")
    mesh.vertices.add(N)
    obj = bpy.data.objects.new("Object", mesh)
    for g in range(4):
        group = obj.vertex_groups.new(name=f"Group {g}")
        for i in range(N):
            if i % 5 > g:
                group.add([i], (i + 1) / (N + 1 + g), "REPLACE")
    return mesh


def by_api(mesh):
    return [(i, member.group, member.weight) for i, vertex in enumerate(mesh.vertices) for member in vertex.groups]


def by_array(array):
    rows = np.repeat(np.arange(len(array.indptr) - 1), np.diff(array.indptr))
    return list(zip(rows.tolist(), array.groups().tolist(), array.weights().tolist(), strict=True))


def test_this_blender_is_trusted(deform_array):
    assert deform_array.find_layout() is not None


def test_reading_agrees_with_the_api(deform_array, mesh):
    assert by_array(deform_array.open_array(mesh, np.arange(N))) == by_api(mesh)


def test_chosen_vertices_come_in_their_order(deform_array, mesh):
    array = deform_array.open_array(mesh, np.array([8, 3]))
    assert array.groups().tolist() == [0, 1, 2, 0, 1, 2]
    assert array.weights()[:3].tolist() == [member.weight for member in mesh.vertices[8].groups]


def test_a_mesh_without_weights_has_no_entries(deform_array, scene):
    import bpy

    mesh = bpy.data.meshes.new("Bare")
    mesh.vertices.add(3)
    assert deform_array.open_array(mesh, np.arange(3)).indptr.tolist() == [0, 0, 0, 0]


def test_writing_is_seen_by_the_api(deform_array, mesh):
    array = deform_array.open_array(mesh, np.arange(N))
    wanted = np.linspace(0, 1, len(array.entries), dtype=np.float32)
    array.set_weights(wanted)
    assert [weight for _, _, weight in by_api(mesh)] == wanted.tolist()


def test_writing_does_not_reach_a_copy_that_shares_the_weights(deform_array, mesh):
    copy = mesh.copy()
    before = by_api(mesh)
    array = deform_array.open_array(mesh, np.arange(N))
    array.set_weights(np.zeros(len(array.entries), np.float32))
    assert by_api(copy) == before


def test_unsharing_gives_an_array_of_its_own_and_tells_nobody(deform_array, mesh):
    import bpy

    def address(mesh):
        return deform_array.find_deform_layer(mesh.as_pointer(), deform_array.find_layout())

    before, updates = by_api(mesh), []
    copy = mesh.copy()
    bpy.context.collection.objects.link(bpy.data.objects["Object"])
    bpy.context.view_layer.update()
    assert address(mesh) == address(copy)
    bpy.app.handlers.depsgraph_update_post.append(lambda *_: updates.append("update"))
    deform_array.unshare(mesh)
    bpy.context.view_layer.update()
    bpy.app.handlers.depsgraph_update_post.pop()
    assert address(mesh) != address(copy)
    assert by_api(mesh) == before == by_api(copy) and not updates


def test_a_mesh_struct_that_does_not_fit_is_refused(deform_array, mesh, monkeypatch):
    true = deform_array.find_layout()
    wrong = replace(true, mesh_n_vertices=true.mesh_n_vertices + 4)
    monkeypatch.setattr(deform_array, "find_layout", lambda: wrong)
    assert deform_array.open_array(mesh, np.arange(N)) is None


def test_weights_that_are_elsewhere_are_refused(deform_array, mesh, monkeypatch):
    monkeypatch.setattr(deform_array, "find_deform_layer", lambda _address, _layout: 0)
    assert deform_array.open_array(mesh, np.arange(N)) is None


def test_a_changed_struct_is_refused(deform_array, monkeypatch):
    dna = deform_array.parse_dna(deform_array.write_a_file())
    dna["MDeformWeight"] = {"def_nr": 0, "weight": 8, "size": 16}
    monkeypatch.setattr(deform_array, "parse_dna", lambda _file: dna)
    assert deform_array.find_layout.__wrapped__() is None


@pytest.mark.parametrize("trusted", [True, False], ids=["array", "api"])
def test_vertex_groups_are_the_same_either_way(deform_array, mesh, monkeypatch, trusted):
    import bpy

    vertex_groups = import_module(f"{PACKAGE}.scene.vertex_groups")
    rows = import_module(f"{PACKAGE}.csr").Rows
    if not trusted:
        monkeypatch.setattr(deform_array, "open_array", lambda _mesh, _indices: None)
    obj = bpy.data.objects["Object"]
    new = rows(np.array([0, 2, 2, 3], np.uint32), np.array([0, 1, 1], np.uint32), np.array([0.25, 0.75, 1], np.float32))
    untouched = by_api(mesh)
    vertex_groups.write(obj, ["Group 3", "New"], new, np.array([4, 9, 0]))
    new_index = obj.vertex_groups["New"].index
    expected = {entry[:2]: entry[2] for entry in untouched}
    del expected[9, 3]
    expected |= {(4, 3): 0.25, (4, new_index): 0.75, (0, new_index): 1.0}
    assert {entry[:2]: entry[2] for entry in by_api(mesh)} == expected
