"""scene.mask: the three values of a steering mask, and other tools' painted ones."""

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

WEIGHTS = [0.0, 0.2, 0.25, 0.5, 0.75, 0.8, 1.0, np.nan, np.nan]


@pytest.fixture
def mask(addon, scene):
    return addon.scene.mask


@pytest.fixture
def garment(mask):
    obj = builders.grid("Garment", 3)
    builders.paint(obj, pin=1.0, mask=WEIGHTS)
    return obj


def test_steer(mask, garment):
    values = mask.read(garment, "mask", mask.Reading.STEER)
    assert values.dtype == np.uint8
    assert values.tolist() == [0, 0, 1, 1, 1, 2, 2, 1, 1]


def test_an_empty_group_changes_nothing(mask, garment):
    garment.vertex_groups.new(name="empty")
    assert mask.read(garment, "empty", mask.Reading.STEER).tolist() == [1] * 9


def test_painted_means_inpaint(mask, garment):
    values = mask.read(garment, "mask", mask.Reading.PAINTED, threshold=0.5)
    assert values.tolist() == [1, 1, 1, 1, 0, 0, 0, 1, 1]


def test_inverted(mask, garment):
    values = mask.read(garment, "mask", mask.Reading.PAINTED, threshold=0.5, invert=True)
    assert values.tolist() == [0, 0, 0, 0, 1, 1, 1, 0, 0]


def test_a_group_that_is_gone_is_named(mask, garment, addon):
    with pytest.raises(addon.scene.error.SceneError, match="Garment has no vertex group gone"):
        mask.read(garment, "gone", mask.Reading.STEER)
