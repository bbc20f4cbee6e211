"""scene.vertex_groups: exact round trips, and nothing else touched."""

import builders
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")


@pytest.fixture
def vertex_groups(addon, scene):
    return addon.scene.vertex_groups


@pytest.fixture
def csr(addon):
    return addon.csr


def rows_of(csr, table):
    """Rows of a list of {column: weight}."""
    indptr = np.cumsum([0] + [len(row) for row in table]).astype(np.uint32)
    bones = np.array([column for row in table for column in row], np.uint32)
    values = np.array([value for row in table for value in row.values()], np.float32)
    return csr.Rows(indptr, bones, values)


def random_table(rng, n_rows, n_columns, most=6):
    table = []
    for _ in range(n_rows):
        columns = np.sort(rng.choice(n_columns, rng.integers(0, most + 1), replace=False))
        table.append({int(c): float(np.float32(rng.random())) for c in columns})
    return table


def test_round_trip_is_exact(vertex_groups, csr):
    obj = builders.grid("Garment", 20)
    names = [f"Bone.{index:02d}" for index in range(60)]
    table = random_table(np.random.default_rng(1), 400, 60)
    table[3] = {5: float(np.float32(1e-38)), 7: 1.0, 9: float(np.float32(1) - np.finfo(np.float32).epsneg)}
    rows = rows_of(csr, table)
    vertex_groups.write(obj, names, rows)
    assert builders.weights(obj) == [{names[c]: v for c, v in row.items()} for row in table]
    again = vertex_groups.read(obj, names)
    for before, after in zip(rows, again, strict=True):
        assert after.dtype == before.dtype
        assert np.array_equal(before, after)


def test_members_of_weight_zero_survive(vertex_groups, csr):
    obj = builders.mesh("Triangle", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    rows = rows_of(csr, [{0: 0.0, 1: 0.5}, {}, {1: 0.0}])
    vertex_groups.write(obj, ["a", "b"], rows)
    assert builders.weights(obj) == [{"a": 0.0, "b": 0.5}, {}, {"b": 0.0}]
    assert vertex_groups.read(obj, ["a", "b"]).values.tolist() == [0.0, 0.5, 0.0]


def test_read_follows_the_names_given(vertex_groups):
    obj = builders.mesh("Triangle", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    builders.paint(obj, a=[0.1, np.nan, 0.3], b=0.5, c=[np.nan, 0.7, np.nan])
    rows = vertex_groups.read(obj, ["c", "missing", "a"])
    assert rows.indptr.tolist() == [0, 1, 2, 3]
    assert rows.bones.tolist() == [2, 0, 2]
    assert np.array_equal(rows.values, np.array([0.1, 0.7, 0.3], np.float32))


def test_read_without_groups_or_names(vertex_groups):
    obj = builders.grid("Garment", 3)
    assert vertex_groups.read(obj, ["a"]).indptr.tolist() == [0] * 10
    builders.paint(obj, a=0.5)
    assert vertex_groups.read(obj, []).values.size == 0


def test_write_touches_only_its_groups_and_vertices(vertex_groups, csr):
    obj = builders.mesh("Quad", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)])
    builders.paint(obj, pin=[0.25, 0.5, np.nan, 0.75], a=0.5, other=0.125, b=[np.nan, 1.0, 1.0, np.nan])
    obj.vertex_groups["a"].lock_weight = True
    rows = rows_of(csr, [{1: 0.75}, {}])
    vertex_groups.write(obj, ["a", "b"], rows, np.array([3, 1]))
    assert builders.weights(obj) == [
        {"pin": 0.25, "a": 0.5, "other": 0.125},
        {"pin": 0.5, "other": 0.125},
        {"a": 0.5, "other": 0.125, "b": 1.0},
        {"pin": 0.75, "other": 0.125, "b": 0.75},
    ]
    assert [group.name for group in obj.vertex_groups] == ["pin", "a", "other", "b"]
    assert obj.vertex_groups["a"].lock_weight


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_write_against_a_plain_model(vertex_groups, csr, data):
    """Any state before, any rows, any vertices in any order: the rest stays, the rows are exact."""
    weight = st.floats(0, 1, width=32)
    n, names = 9, ["a", "b", "c", "d", "e"]
    obj = builders.grid("Garment", 3)
    groups = [obj.vertex_groups.new(name=name) for name in data.draw(st.permutations(names[:4]))]
    entry = st.tuples(st.integers(0, n - 1), st.sampled_from(groups), weight)
    for vertex, group, value in data.draw(st.lists(entry, max_size=40)):
        group.add([vertex], value, "REPLACE")
    expected = builders.weights(obj)
    written = data.draw(st.lists(st.sampled_from(names), unique=True))
    vertices = data.draw(st.lists(st.integers(0, n - 1), unique=True))
    columns = st.dictionaries(st.integers(0, len(written) - 1), weight) if written else st.just({})
    table = [dict(sorted(data.draw(columns).items())) for _ in vertices]
    vertex_groups.write(obj, written, rows_of(csr, table), np.array(vertices, np.intp))
    for vertex, row in zip(vertices, table, strict=True):
        kept = {name: value for name, value in expected[vertex].items() if name not in written}
        expected[vertex] = kept | {written[column]: value for column, value in row.items()}
    assert builders.weights(obj) == expected


def test_write_keeps_shape_keys_selection_and_positions(vertex_groups, csr):
    obj = builders.grid("Garment", 3)
    obj.shape_key_add(name="Basis")
    obj.shape_key_add(name="Wide").data[4].co = (5, 5, 5)
    obj.active_shape_key_index = 1
    select = np.arange(9) % 2 == 0
    obj.data.vertices.foreach_set("select", select)
    before = [v.co.copy() for v in obj.data.vertices]
    vertex_groups.write(obj, ["a"], rows_of(csr, [{0: 0.5}] * 9))
    assert [v.co for v in obj.data.vertices] == before
    assert tuple(obj.data.shape_keys.key_blocks["Wide"].data[4].co) == (5, 5, 5)
    assert [v.select for v in obj.data.vertices] == select.tolist()
    assert [row["a"] for row in builders.weights(obj)] == [0.5] * 9


def test_written_weights_deform(vertex_groups, csr):
    """The armature sees the new weights at once, without an update by the caller."""
    armature = builders.rig(bones=("a",))
    obj = builders.grid("Garment", 3)
    modifier = obj.modifiers.new("Armature", "ARMATURE")
    modifier.object = armature
    armature.pose.bones["a"].location = (0, 7, 0)
    vertex_groups.write(obj, ["a"], rows_of(csr, [{0: 0.0}] * 9))
    bpy.context.view_layer.update()
    vertex_groups.write(obj, ["a"], rows_of(csr, [{0: 1.0}] * 9))
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert evaluated.data.vertices[4].co.z == pytest.approx(7)


def test_copies_keep_their_weights(vertex_groups, csr):
    """Blender shares arrays between a mesh and its copies until one is written."""
    obj = builders.grid("Garment", 3)
    builders.paint(obj, a=0.25)
    copy = obj.copy()
    copy.data = obj.data.copy()
    vertex_groups.write(obj, ["a"], rows_of(csr, [{0: 1.0}] * 9))
    assert [row["a"] for row in builders.weights(copy)] == [0.25] * 9


def test_users_of_one_mesh_share_its_weights(vertex_groups, csr):
    obj = builders.grid("Garment", 3)
    other = bpy.data.objects.new("Other", obj.data)
    vertex_groups.write(obj, ["a"], rows_of(csr, [{0: 1.0}] * 9))
    assert [row["a"] for row in builders.weights(other)] == [1.0] * 9


@pytest.mark.parametrize("name", ["x" * 80, "é" * 40, "a/b\"c'd", "腕.L", "x" * 62 + "é"])
def test_any_name_round_trips(vertex_groups, csr, name):
    obj = builders.grid("Garment", 2)
    vertex_groups.write(obj, [name], rows_of(csr, [{0: 0.5}] * 4))
    vertex_groups.write(obj, [name], rows_of(csr, [{0: 0.75}] * 4))
    assert len(obj.vertex_groups) == 1
    assert name.startswith(obj.vertex_groups[0].name)
    assert vertex_groups.read(obj, [name]).values.tolist() == [0.75] * 4


def test_names_that_meet_when_cut_are_refused(vertex_groups, csr, addon):
    obj = builders.grid("Garment", 2)
    names = ["x" * 63 + "1", "x" * 63 + "2"]
    with pytest.raises(addon.scene.error.SceneError, match="Garment .* one name"):
        vertex_groups.write(obj, names, rows_of(csr, [{0: 0.5, 1: 0.5}] * 4))
    assert not obj.vertex_groups


def test_a_weight_that_is_not_a_number_is_named(vertex_groups, addon):
    obj = builders.grid("Garment", 3)
    builders.paint(obj, a=0.5)
    obj.data.vertices[7].groups[0].weight = float("nan")
    if obj.data.vertices[7].groups[0].weight == obj.data.vertices[7].groups[0].weight:
        obj.vertex_groups["a"].add([7], float("nan"), "REPLACE")
    with pytest.raises(addon.scene.error.SceneError, match="Garment .* vertex 7 in group a"):
        vertex_groups.read(obj, ["a"])


def test_locked(vertex_groups):
    obj = builders.grid("Garment", 2)
    builders.paint(obj, a=0.5, b=0.5)
    obj.vertex_groups["b"].lock_weight = True
    assert vertex_groups.locked(obj) == {"b"}


def test_four_hundred_thousand_entries(vertex_groups, csr):
    obj = builders.grid("Garment", 317)
    n, names = 317 * 317, [f"Bone.{index}" for index in range(40)]
    rng = np.random.default_rng(2)
    first = rng.integers(0, 10, n)
    bones = (first[:, None] + np.arange(0, 40, 10)).astype(np.uint32)
    values = rng.random((n, 4), np.float32)
    rows = csr.Rows(np.arange(0, 4 * n + 1, 4, dtype=np.uint32), bones.ravel(), values.ravel())
    vertex_groups.write(obj, names, rows)
    again = vertex_groups.read(obj, names)
    assert all(np.array_equal(before, after) for before, after in zip(rows, again, strict=True))


@pytest.mark.parametrize("largest", [0, 1 << 24])
def test_positions_of_pairs_by_sorting_and_by_table(vertex_groups, monkeypatch, largest):
    monkeypatch.setattr(vertex_groups, "_LARGEST_TABLE", largest)
    rng = np.random.default_rng(1)
    keys = rng.permutation(50 * 9)[:200]
    wanted = rng.integers(0, 50 * 12, 300)
    pairs, others = [(k // 12, k % 12) for k in (keys // 9 * 12 + keys % 9, wanted)]
    found = vertex_groups._positions(pairs, others, 50)
    places = {(row, group): k for k, (row, group) in enumerate(zip(*pairs, strict=True))}
    assert found.tolist() == [places.get(pair, -1) for pair in zip(*others, strict=True)]
    assert 0 < (found >= 0).sum() < 300
    nothing = (np.zeros(0, np.int64), np.zeros(0, np.int64))
    assert (vertex_groups._positions(nothing, others, 50) == -1).all()
