"""Pairs of bones: by name, by convention, by place; sides are never swapped and nothing is paired twice."""

import numpy as np
import pytest

pytest.importorskip("bpy", reason="needs the bpy wheel")


@pytest.fixture(scope="module")
def modules(addon):
    from importlib import import_module

    return [
        import_module(f"{addon.__name__}.{name}")
        for name in ("retarget.bone_map", "scene.rest_bones", "retarget.bone_names")
    ]


def skeleton(modules, names, heads, parents):
    frames = np.tile(np.eye(4), (len(names), 1, 1))
    frames[:, :3, 3] = heads
    return modules[1].RestBones(list(names), frames, np.full(len(names), 0.1), np.array(parents, np.int32))


def person(modules, convention):
    """Bones of a convention at the same places, whatever they are called."""
    words, left, right = modules[2].CONVENTIONS[convention]
    keys = sorted(
        {(key, side) for key, pattern in words.items() for side in ((left, right) if "{S}" in pattern else ("",))}
    )
    names = [words[key].replace("{S}", side) for key, side in keys]
    heads = [(0.1 * k, 0.0, 1.0 - 0.01 * k * (1 if side == left else -1)) for k, (key, side) in enumerate(keys)]
    meanings = [key + {left: ".L", right: ".R"}.get(side, "") for key, side in keys]
    return skeleton(modules, names, heads, [-1] * len(names)), dict(zip(names, meanings, strict=True))


def test_all_conventions_map_onto_each_other(modules):
    bone_map, _, bone_names = modules
    for source in bone_names.CONVENTIONS:
        for target in bone_names.CONVENTIONS:
            (giver, meaning), (taker, wanted) = person(modules, source), person(modules, target)
            for entry in bone_map.match(giver, taker):
                if entry.source and entry.how != "place":
                    assert meaning[entry.source] == wanted[entry.target], (source, target, entry)
            shared = set(meaning.values()) & set(wanted.values())
            found = {entry.target for entry in bone_map.match(giver, taker) if entry.source}
            assert sum(wanted[name] in shared for name in found) >= len(shared), (source, target)


def test_place_pairs_what_names_do_not(modules):
    parents = [-1, 0, 0]
    giver = skeleton(modules, ["root", "wing.L", "wing.R"], [(0, 0, 0), (1, 0, 1), (-1, 0, 1)], parents)
    taker = skeleton(modules, ["root", "fluegel.L", "fluegel.R"], [(0, 0, 0), (2, 0, 2), (-2, 0, 2)], parents)
    found = {entry.target: entry for entry in modules[0].match(giver, taker)}
    assert found["fluegel.L"].source == "wing.L" and found["fluegel.R"].source == "wing.R"
    assert 0 < found["fluegel.L"].confidence < 0.85


def test_sides_are_never_swapped(modules):
    giver = skeleton(modules, ["wing.L"], [(1, 0, 1)], [-1])
    taker = skeleton(modules, ["fluegel.R"], [(1, 0, 1)], [-1])
    assert [entry.source for entry in modules[0].match(giver, taker)] == [""]


def test_given_pairs_win(modules):
    giver = skeleton(modules, ["a", "b"], [(0, 0, 0), (0, 0, 1)], [-1, 0])
    found = modules[0].match(giver, giver, {"a": "b", "b": ""})
    assert [(entry.source, entry.how) for entry in found] == [("b", "given"), ("", "given")]


def leg(modules, names, at=0.0):
    """Hips with a thigh and a shin on each side; `names` are those of the left leg."""
    right = [name.replace("Left", "Right").replace(".L", ".R") for name in names]
    heads = [(0, 0, 1), (0.1, 0, 0.9), (0.1, 0, 0.5 + at), (-0.1, 0, 0.9), (-0.1, 0, 0.5 + at)]
    return skeleton(modules, ["Hips", *names, *right], heads, [-1, 0, 1, 0, 3])


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("first", [("Leg.L", "Shin.L"), ("Thigh.L", "UpLeg.L")])
def test_a_leg_that_is_a_thigh_here_and_a_shin_there(modules, first, turned):
    """Mixamo calls the shin leg."""
    second = ("LeftUpLeg", "LeftLeg")
    giver, taker = (leg(modules, names) for names in ((second, first) if turned else (first, second)))
    found = {entry.target: entry.source for entry in modules[0].match(giver, taker)}
    assert found == dict(zip(taker.names, giver.names, strict=True))


def test_a_bone_map_that_is_given_is_not_corrected(modules):
    giver, taker = leg(modules, ("Leg.L", "Shin.L")), leg(modules, ("LeftUpLeg", "LeftLeg"))
    found = {entry.target: entry for entry in modules[0].match(giver, taker, {"LeftLeg": "Leg.L"})}
    assert found["LeftLeg"].source == "Leg.L" and found["RightLeg"].source == "Shin.R"
    sources = [entry.source for entry in found.values() if entry.source]
    assert len(sources) == len(set(sources))


def test_an_order_that_fits_the_places_worse_corrects_nothing(modules):
    """One rig has a bone more above, and another bone more below, and the name is right."""
    giver = skeleton(modules, ["Hips", "Leg.L", "Toe.L"], [(0, 0, 1), (0.1, 0, 0.9), (0.1, 0, 0)], [-1, 0, 1])
    taker = skeleton(modules, ["Hips", "Root.L", "Leg.L"], [(0, 0, 1), (0, 0, 1.02), (0.1, 0, 0.9)], [-1, 0, 1])
    found = {entry.target: entry.source for entry in modules[0].match(giver, taker)}
    assert found["Leg.L"] == "Leg.L"
