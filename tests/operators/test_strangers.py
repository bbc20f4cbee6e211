"""Groups whose weights count for nothing, as no deforming bone has their name."""

import builders
import figure
import numpy as np
import pytest
from transferring import said

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


def rename_group(body, rig, name):
    body.vertex_groups["Leg.L"].name = name


def rename_bone(body, rig, name):
    """While the body is not bound, as in another file."""
    body.modifiers.clear()
    rig.data.bones["Leg.L"].name = name
    figure.bind(body, rig)


CASES = [
    (rename_group, "Leg.L ", "the group 'Leg.L ', and Rig has no bone of that name", "its bone, Leg.L perhaps"),
    (rename_group, "leg.l", "the group leg.l, and Rig has no bone of that name", "its bone, Leg.L perhaps"),
    (rename_bone, "Thigh.L", "the group Leg.L, and Rig has no bone of that name", "its bone, Thigh.L perhaps"),
]


@pytest.mark.parametrize("spoil, name, phrase, hint", CASES)
def test_a_group_that_fits_no_bone_is_named(plain, body, rig, boot, spoil, name, phrase, hint):
    spoil(body, rig, name)
    found = said(plain(body, boot))
    assert phrase in found and hint in found


def test_a_bone_that_does_not_deform_is_named(plain, body, rig, boot):
    rig.data.bones["Leg.L"].use_deform = False
    assert "the group Leg.L, whose bone does not deform" in said(plain(body, boot))


def test_two_groups_that_only_together_complete_the_rows(addon, plain, body, boot):
    """Where nothing else is in reach, they are the reason of the refusal."""
    for name in ("Leg.L", "Shin.L"):
        body.vertex_groups[name].name = f"Old {name}"
    found = said(plain(body, figure.trousers()))
    assert "in the group Old Leg.L" in found and "in the group Old Shin.L" in found
    with pytest.raises(addon.scene.error.SceneError, match="in the group Old Leg.L, and Rig has no bone"):
        plain(body, boot)


def test_retargeting_says_so_too(addon, body, rig):
    body.vertex_groups["Leg.L"].name = "leg.l"
    other = figure.rig(name="Other Rig")
    child = builders.mesh("Child", *figure.joined(figure.tube(0.12, 0, 1, 0.1), figure.tube(-0.12, 0, 1, 0.1)))
    figure.bind(child, other)
    report = addon.retarget.retarget_weights(bpy.context, body, [child], addon.retarget.RetargetParams())
    assert "the group leg.l, and Rig has no bone" in said(report)


def test_pins_and_masks_are_no_bones(plain, body, boot):
    """Also where the weights of bones do not sum to 1."""
    vertices = range(len(body.data.vertices))
    for name, weight in (("pin", 0.7), ("hide", 1.0)):
        body.vertex_groups.new(name=name).add(list(vertices), weight, "REPLACE")
    body.vertex_groups["Leg.L"].add([40, 41, 42], 0.4, "REPLACE")
    assert "in the group" not in said(plain(body, boot))


def test_weights_of_a_rig_that_is_replaced_do_not_stay_in_the_way(plain, body, boot):
    old = figure.bones({"Old": ((0, 0, 0), (0, 0, 1), None)}, "Old Rig")
    figure.bind(boot, old)
    builders.paint(boot, Old=0.6)
    plain(body, boot, replace_others=True)
    np.testing.assert_allclose(builders.dense(boot, figure.BONES).sum(1), 1, atol=1e-5)
