"""Embed Armature in Blender: bones where the limb has them, bound if asked, and nothing at all where it fails."""

from importlib import import_module

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


@pytest.fixture
def arm(scene):
    """A limb 1.5 times as long as that of the donor, which is the source, and without an armature."""
    _, rig = builders.limb("Donor", around=12, along=16)
    obj, own = builders.limb("Arm", around=12, along=16, length=3.0, bound=False)
    bpy.data.objects.remove(own)
    bpy.data.armatures.remove(bpy.data.armatures["Arm Rig"])
    scene.skinwright.retarget.source = rig
    builders.select(obj)
    return obj


def everything():
    return sorted(o.name for o in bpy.data.objects), sorted(a.name for a in bpy.data.armatures), bpy.context.mode


@pytest.mark.parametrize("method", ["TEMPLATE", "MEDIAL"])
def test_bones_are_in_the_limb(arm, method):
    assert bpy.ops.skinwright.embed_armature(method=method) == {"FINISHED"}
    rig = bpy.data.objects["Arm Rig"]
    assert [(m.type, m.object) for m in arm.modifiers] == [("ARMATURE", rig)]
    joint = np.array(rig.data.bones["Lower"].head_local)
    assert -0.1 < joint[0] < 3.1 and np.linalg.norm(joint[1:]) < 0.1
    if method == "TEMPLATE":
        assert joint[0] == pytest.approx(1.5, abs=0.1)
    assert bpy.context.view_layer.objects.active == arm and arm.select_get()


def test_it_is_bound_on_demand_only(arm):
    bpy.ops.skinwright.embed_armature(bind=False)
    assert not arm.modifiers and "Arm Rig" in bpy.data.objects


@pytest.mark.parametrize(
    "module, name", [("scene.embedded", "mark"), ("scene.embedded", "_place"), ("embed", "EmbedReport")]
)
def test_nothing_is_left_if_it_fails(addon, arm, monkeypatch, module, name):
    def fails(*_arguments, **_named):
        raise OSError("injected")

    monkeypatch.setattr(import_module(f"{addon.__name__}.{module}"), name, fails)
    before = everything()
    with pytest.raises(RuntimeError, match="Embed Armature"):
        bpy.ops.skinwright.embed_armature()
    assert everything() == before and not arm.modifiers


def test_a_template_without_weights_is_refused(arm):
    bpy.data.objects["Donor"].vertex_groups.clear()
    before = everything()
    with pytest.raises(RuntimeError, match="Donor Rig deforms no mesh that has weights"):
        bpy.ops.skinwright.embed_armature(method="TEMPLATE")
    assert everything() == before
