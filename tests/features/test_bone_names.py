"""Names of bones in the rigs that characters come with."""

import pytest

pytest.importorskip("bpy", reason="needs the bpy wheel")


@pytest.fixture(scope="module")
def names(addon):
    from importlib import import_module

    return import_module(f"{addon.__name__}.retarget.bone_names")


@pytest.mark.parametrize(
    ("name", "side"),
    [
        ("upper_arm.L", "L"),
        ("upper_arm.L.001", "L"),
        ("DEF-thigh.R.001", "R"),
        ("hand_r", "R"),
        ("mixamorig:LeftForeArm", "L"),
        ("J_Bip_R_UpperLeg", "R"),
        ("J_Bip_C_Hips", ""),
        ("CC_Base_L_Clavicle", "L"),
        ("lShldrBend", "L"),
        ("rThighBend", "R"),
        ("l_forearm", "L"),
        ("UpperArmR", "R"),
        ("左ひじ", "L"),
        ("右足首", "R"),
        ("leftUpperArm", "L"),
        ("spine", ""),
        ("pelvis", ""),
        ("lowerleg", ""),
        ("rib", ""),
        ("Head", ""),
    ],
)
def test_sides(names, name, side):
    assert names.side(name) == side


def test_a_side_is_all_that_differs(names):
    for left, right in [("hand.L", "hand.R"), ("LeftHand", "RightHand"), ("lHand", "rHand"), ("hand_l", "hand_r")]:
        assert names.without_side(left) == names.without_side(right) == "hand"


def all_names(names, convention):
    words, left, right = names.CONVENTIONS[convention]
    return sorted({pattern.replace("{S}", side) for pattern in words.values() for side in (left, right)})


def test_every_convention_is_recognised_and_unique(names):
    for convention in names.CONVENTIONS:
        own = all_names(names, convention)
        assert names.convention(own) == convention
        meanings = names.vocabulary(own)
        assert len(meanings) == len(own) == len(set(meanings.values()))


def test_prefixes_do_not_hide_a_convention(names):
    rigify = [f"DEF-{name}" for name in all_names(names, "Rigify")]
    assert names.convention(rigify) == "Rigify"
    assert names.vocabulary(rigify)["DEF-shin.L"] == "shin.L"


def test_few_names_are_no_convention(names):
    assert names.convention(["spine", "head", "pelvis"]) == ""
