"""All or nothing: whatever stops an operation, every part of an object that it may have changed comes back."""

from importlib import import_module

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
from mathutils import Matrix  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene")


@pytest.fixture
def object_state(addon):
    return import_module(f"{addon.__name__}.scene.object_state")


@pytest.fixture
def coat():
    """A grid with groups, keys, three modifiers, a constraint and a parent that is a bone."""
    rig = builders.rig()
    obj = builders.grid("Coat", 4)
    builders.paint(obj, a=0.25, b=[0.5] * 8 + [float("nan")] * 8)
    obj.shape_key_add(name="Basis", from_mix=False)
    obj.shape_key_add(name="Wide", from_mix=False).data[3].co.x += 0.5
    obj.modifiers.new("First", "ARMATURE").object = rig
    obj.modifiers["First"].use_deform_preserve_volume = True
    obj.modifiers.new("Fold", "SIMPLE_DEFORM").angle = 0.7
    obj.modifiers.new("Last", "ARMATURE").object = rig
    follow = obj.constraints.new("COPY_LOCATION")
    follow.target, follow.subtarget = rig, "Arm.L"
    obj.parent, obj.parent_type, obj.parent_bone = rig, "BONE", "Arm.R"
    obj.matrix_parent_inverse = Matrix.Translation((1, 2, 3))
    obj.location, obj.scale = (0.1, 0.2, 0.3), (1, 2, 1)
    bpy.context.view_layer.update()
    return obj


def everything(obj):
    """As a person would compare it, property by property."""
    modifiers = []
    for modifier in obj.modifiers:
        names = [prop.identifier for prop in modifier.bl_rna.properties if prop.identifier != "rna_type"]
        modifiers.append([(name, str(getattr(modifier, name))) for name in names if name not in ("execution_time",)])
    keys = obj.data.shape_keys.key_blocks if obj.data.shape_keys else ()
    return {
        "mesh": (obj.data.name, np.array([vertex.co for vertex in obj.data.vertices]).tobytes()),
        "keys": {key.name: np.array([point.co for point in key.data]).tobytes() for key in keys},
        "groups": [(group.name, group.lock_weight) for group in obj.vertex_groups],
        "rows": [[(member.group, member.weight) for member in vertex.groups] for vertex in obj.data.vertices],
        "modifiers": modifiers,
        "muted": [constraint.mute for constraint in obj.constraints],
        "parent": (obj.parent, obj.parent_type, obj.parent_bone, str(obj.matrix_parent_inverse)),
        "place": [tuple(obj.location), tuple(obj.rotation_euler), tuple(obj.scale)],
    }


def change(obj):
    """All that a transfer may do, and more."""
    obj.vertex_groups["a"].add([0], 0.9, "REPLACE")
    obj.vertex_groups.remove(obj.vertex_groups["b"])
    obj.vertex_groups.new(name="new")
    for vertex in obj.data.vertices:
        vertex.co.z += 1
    for key in obj.data.shape_keys.key_blocks:
        key.data[0].co.z += 1
    obj.modifiers.remove(obj.modifiers["First"])
    obj.modifiers.new("Smooth", "CORRECTIVE_SMOOTH")
    obj.modifiers["Fold"].angle = 0.1
    obj.modifiers["Fold"].show_viewport = obj.modifiers["Fold"].show_render = False
    obj.modifiers.move(2, 0)
    obj.constraints[0].mute = True
    obj.parent, obj.parent_type, obj.parent_bone = None, "OBJECT", ""
    obj.matrix_world = Matrix.Translation((5, 5, 5))


@pytest.mark.parametrize("error", [ValueError, MemoryError, KeyboardInterrupt])
def test_everything_comes_back(object_state, coat, error):
    other = builders.grid("Other", 3)
    before = everything(coat)
    with pytest.raises(error), object_state.all_or_nothing([other, coat], reshaped=[coat]):
        change(coat)
        raise error
    assert everything(coat) == before


def test_an_object_that_is_gone_does_not_hinder_the_others(object_state, coat):
    other = builders.grid("Other", 3)
    before = everything(coat)
    with pytest.raises(ZeroDivisionError), object_state.all_or_nothing([other, coat], reshaped=[coat]):
        bpy.data.objects.remove(other)
        change(coat)
        raise ZeroDivisionError
    assert everything(coat) == before


@pytest.mark.parametrize("memory", [True, False])
def test_a_mesh_made_single_user_is_shared_again(addon, object_state, coat, monkeypatch, memory):
    """With weights brought back by Blender's memory, and by its public interface alone."""
    if not memory:
        monkeypatch.setattr(addon.scene.deform_array, "find_layout", lambda: None)
    twin = builders.grid("Twin", 3)
    twin.data = coat.data
    before, mesh, meshes = everything(coat), coat.data, len(bpy.data.meshes)
    with pytest.raises(KeyError), object_state.all_or_nothing([coat]):
        coat.data = coat.data.copy()
        change(coat)
        raise KeyError
    assert everything(coat) == before
    assert coat.data == mesh == twin.data and len(bpy.data.meshes) == meshes


def test_what_ends_well_stays(object_state, coat):
    with object_state.all_or_nothing([coat], reshaped=[coat]):
        change(coat)
    assert [modifier.name for modifier in coat.modifiers] == ["Smooth", "Fold", "Last"]
    assert coat.parent is None and coat.constraints[0].mute
