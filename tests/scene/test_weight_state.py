"""A state comes back to the bit and in stored order, after any edits; a block that breaks leaves no trace."""

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")


@pytest.fixture(params=["memory", "interface"])
def weight_state(addon, scene, request, monkeypatch):
    """By Blender's memory, and by its public interface alone."""
    if request.param == "interface":
        monkeypatch.setattr(addon.scene.deform_array, "find_layout", lambda: None)
    import importlib

    return importlib.import_module(addon.__name__ + ".scene.weight_state")


def stored(obj):
    """Members of every vertex in stored order, by the plainest way there is."""
    groups = [(group.name, group.lock_weight) for group in obj.vertex_groups]
    active = obj.vertex_groups.active.name if obj.vertex_groups.active else None
    members = [[(g.group, np.float32(g.weight).tobytes()) for g in v.groups] for v in obj.data.vertices]
    return groups, active, members


def edit(obj, rng):
    """One of what artists and scripts do to weights."""
    groups, n = obj.vertex_groups, len(obj.data.vertices)
    some = rng.choice(n, rng.integers(1, n // 2), replace=False).tolist()
    group = groups[int(rng.integers(len(groups)))] if groups else groups.new(name="first")
    match int(rng.integers(9)):
        case 0:
            groups.new(name=f"new {rng.integers(1000)}")
        case 1 if len(groups) > 1:
            groups.remove(group)
        case 2:
            group.name = f"renamed {rng.integers(1000)}"
        case 3:
            group.lock_weight = not group.lock_weight
        case 4:
            groups.active_index = int(rng.integers(len(groups)))
        case 5:
            group.remove(some)
        case 6:
            group.add(some, float(rng.random()), "ADD")
        case _:
            group.add(some, float(rng.random()), "REPLACE")


def randomly_painted(rng, n=12, n_groups=7):
    obj = builders.grid("Coat", n)
    for index in range(n_groups):
        obj.vertex_groups.new(name=f"Bone {index}")
    for _ in range(60):
        edit(obj, rng)
    return obj


@pytest.mark.parametrize("seed", range(5))
def test_a_state_comes_back_after_random_edits(weight_state, seed):
    rng = np.random.default_rng(seed)
    obj = randomly_painted(rng)
    before, state = stored(obj), weight_state.capture(obj)
    for _ in range(40):
        edit(obj, rng)
        if rng.random() < 0.2:
            weight_state.apply(obj, state)
            assert stored(obj) == before
            assert weight_state.capture(obj).digest() == state.digest()


def test_digests_tell_states_apart(weight_state):
    obj = randomly_painted(np.random.default_rng(1))
    seen = {weight_state.capture(obj).digest()}
    obj.vertex_groups[0].lock_weight = not obj.vertex_groups[0].lock_weight
    seen.add(weight_state.capture(obj).digest())
    obj.vertex_groups.new(name="one more")
    seen.add(weight_state.capture(obj).digest())
    obj.vertex_groups[0].add([3], 0.123, "REPLACE")
    seen.add(weight_state.capture(obj).digest())
    assert len(seen) == 4


def test_weights_that_are_none_come_back_as_they_were(weight_state):
    """A state is no judge: not-a-number is kept too."""
    obj = builders.grid("Coat", 3)
    builders.paint(obj, a=0.5)
    obj.vertex_groups["a"].add([4], float("nan"), "REPLACE")
    before, state = stored(obj), weight_state.capture(obj)
    obj.vertex_groups["a"].add(range(9), 1, "REPLACE")
    weight_state.apply(obj, state)
    assert stored(obj) == before
