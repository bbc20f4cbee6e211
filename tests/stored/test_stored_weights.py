"""Weights are kept, brought back to the bit, found by position on a changed mesh, and compared."""

import importlib
import json

import builders
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")
pytestmark = pytest.mark.usefixtures("native", "scene")
BONES = ["Arm.L", "Arm.R"]


@pytest.fixture
def keeping(addon):
    return importlib.import_module(addon.__name__ + ".stored.keeping")


@pytest.fixture
def digest(addon):
    weight_state = importlib.import_module(addon.__name__ + ".scene.weight_state")
    return lambda obj: weight_state.capture(obj).digest()


@pytest.fixture
def body(scene):
    obj = builders.body(16)
    scene.skinwright.transfer.source = obj
    builders.select(obj)
    return obj


def edit(obj, rng):
    """One random edit of the weights of an object."""
    groups, n = obj.vertex_groups, len(obj.data.vertices)
    some = rng.choice(n, rng.integers(1, n // 2), replace=False).tolist()
    group = groups[int(rng.integers(len(groups)))]
    match int(rng.integers(8)):
        case 0:
            groups.new(name=f"new {rng.integers(50)}")
        case 1 if len(groups) > 2:
            groups.remove(group)
        case 2:
            group.lock_weight = not group.lock_weight
        case 3:
            groups.active_index = int(rng.integers(len(groups)))
        case 4:
            group.remove(some)
        case _:
            group.add(some, float(rng.random()), str(rng.choice(["REPLACE", "ADD", "SUBTRACT"])))


def test_hashes_are_equal_after_a_thousand_random_edits(body, digest, tmp_path):
    rng = np.random.default_rng(7)
    before = digest(body)
    bpy.ops.skinwright.store_weights(state_name="Before")
    for number in range(1000):
        edit(body, rng)
        if number % 100 == 99:
            assert digest(body) != before
            bpy.ops.skinwright.restore_weights(state=state_number(body, "Before"))
            assert digest(body) == before
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    edit(body, rng)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"))
    again = bpy.data.objects["Body"]
    builders.select(again)
    edit(again, rng)
    bpy.ops.skinwright.restore_weights(state=state_number(again, "Before"))
    assert digest(again) == before


def state_number(obj, name):
    """The enum's item of the newest state of this name."""
    index = json.loads(obj.data["skinwright_weights_index"])
    return str(max(number for number, entry in enumerate(index) if entry["name"] == name))


def test_a_state_of_the_same_name_is_replaced(body, keeping):
    for weight in (0.1, 0.2):
        body.vertex_groups["pin"].add([0], weight, "REPLACE")
        bpy.ops.skinwright.store_weights(state_name="Mine")
    (entry,) = keeping.entries(body)
    assert entry.name == "Mine"
    body.vertex_groups["pin"].add([0], 0.9, "REPLACE")
    bpy.ops.skinwright.restore_weights()
    assert builders.weights(body)[0]["pin"] == pytest.approx(0.2)


def test_operators_keep_what_they_are_about_to_change(body, keeping, digest):
    """The last five, and equal bytes once."""
    coat = builders.grid("Coat", 9, z=0.02)
    builders.select(coat)
    seen = []
    for mix in np.linspace(0.3, 1, 7):
        seen.append(digest(coat))
        bpy.ops.skinwright.transfer_weights(mix_factor=float(mix))
    found = keeping.entries(coat)
    assert [entry.name for entry in found] == ["Before Transfer Weights"] * 5 and all(e.automatic for e in found)
    bpy.ops.skinwright.restore_weights(state="0")
    assert digest(coat) == seen[2]
    bpy.ops.skinwright.desparsify()
    assert keeping.entries(coat)[-1].name == "Before Add Bone Slots"
    blobs = [key for key in coat.data.keys() if key.startswith("skinwright_weights_blob_")]
    assert len(blobs) <= 6  # five states and one shape


def test_a_refusal_keeps_nothing(body, keeping):
    coat = builders.grid("Coat", 9, z=50)
    builders.select(coat)
    with pytest.raises(RuntimeError):
        bpy.ops.skinwright.transfer_weights()
    assert not keeping.entries(coat) and not coat.data.keys()


def test_forgetting_frees_the_file(body, keeping):
    bpy.ops.skinwright.store_weights(state_name="Mine")
    keeping.keep_before([body], "Test")
    with_both = keeping.size(body)
    bpy.ops.skinwright.forget_weights(which="AUTOMATIC")
    assert [entry.name for entry in keeping.entries(body)] == ["Mine"] and 0 < keeping.size(body) <= with_both
    bpy.ops.skinwright.forget_weights(which="ALL")
    assert keeping.size(body) == 0 and not body.data.keys()


def test_a_renumbered_mesh_is_restored_by_position_exactly(body):
    rows = {tuple(v.co): row for v, row in zip(body.data.vertices, builders.weights(body), strict=True)}
    bpy.ops.skinwright.store_weights()
    permutation = np.random.default_rng(3).permutation(len(body.data.vertices))
    new = bpy.data.meshes.new("Shuffled")
    place = np.argsort(permutation)
    positions = np.array([v.co for v in body.data.vertices])[permutation]
    faces = [[int(place[i]) for i in polygon.vertices] for polygon in body.data.polygons]
    new.from_pydata(positions.tolist(), [], faces)
    for key in body.data.keys():
        new[key] = body.data[key]
    body.data = new
    body.vertex_groups.clear()
    bpy.ops.skinwright.restore_weights()
    assert [rows[tuple(v.co)] for v in new.vertices] == builders.weights(body)


def test_new_vertices_are_inpainted_and_old_ones_kept_to_the_bit(body):
    """After Subdivide old vertices keep their rows; on a grid of linear weights the new ones must lie between them."""
    for vertex in body.data.vertices:
        t = (vertex.co.x + 1) / 2
        body.vertex_groups["Arm.L"].add([vertex.index], t, "REPLACE")
        body.vertex_groups["Arm.R"].add([vertex.index], 1 - t, "REPLACE")
    before = {tuple(v.co): row for v, row in zip(body.data.vertices, builders.weights(body), strict=True)}
    bpy.ops.skinwright.store_weights()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode="OBJECT")
    for group in body.vertex_groups:
        group.add(range(len(body.data.vertices)), 0.5, "REPLACE")
    bpy.ops.skinwright.restore_weights()
    after = builders.weights(body)
    new = 0
    for vertex, row in zip(body.data.vertices, after, strict=True):
        if tuple(vertex.co) in before:
            assert row == before[tuple(vertex.co)]
            continue
        new += 1
        assert row["Arm.L"] + row["Arm.R"] == pytest.approx(1, abs=1e-4)
        assert row["Arm.L"] == pytest.approx((vertex.co.x + 1) / 2, abs=0.02)
    assert new == len(after) - 256 > 0


def test_seams_at_one_place_keep_their_own_rows(addon, keeping):
    restoring = importlib.import_module(addon.__name__ + ".stored.restoring")
    before = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0], [2, 0, 0]], np.float32)
    now = np.array([[2, 0, 0], [0, 0, 0], [0, 0, 0], [5, 0, 0], [0, 0, 0]], np.float32)
    assert restoring.partners(now, before).tolist() == [3, 0, 2, -1, -1]
    assert restoring.partners(now, before[:0]).tolist() == [-1] * 5


def test_a_difference_is_half_the_sum_of_absolute_differences(body, addon):
    bpy.ops.skinwright.store_weights(state_name="Before")
    expected = builders.dense(body, BONES)
    rng = np.random.default_rng(5)
    for index in rng.choice(256, 40, replace=False).tolist():
        share = float(rng.random())
        body.vertex_groups["Arm.L"].add([index], share, "REPLACE")
        body.vertex_groups["Arm.R"].add([index], 1 - share, "REPLACE")
    body.vertex_groups["pin"].add(range(256), 0.9, "REPLACE")  # not a bone: not compared
    bpy.ops.skinwright.compare_weights()
    comparing = importlib.import_module(addon.__name__ + ".stored.comparing")
    half_l1 = 0.5 * np.abs(builders.dense(body, BONES) - expected).sum(axis=1)
    np.testing.assert_allclose(comparing.current.difference, half_l1, atol=1e-6)
    assert bpy.context.scene.skinwright.overlay.kind == "DIFFERENCE"
    picture = importlib.import_module(addon.__name__ + ".overlay.picture")
    params = bpy.context.scene.skinwright.transfer.to_params()
    shown = picture.picture(bpy.context, "DIFFERENCE", params)
    np.testing.assert_allclose(shown.values, half_l1, atol=1e-6)
    colours = importlib.import_module(addon.__name__ + ".overlay.colours").of_values("DIFFERENCE", shown.values)
    assert colours.shape == (256, 3) and (colours.min() >= 0) and (colours.max() <= 1)


@pytest.mark.parametrize("ending", ["npz", "json"])
def test_export_and_import(body, digest, tmp_path, ending):
    path, before = tmp_path / f"body.{ending}", digest(body)
    assert bpy.ops.skinwright.export_weights(filepath=str(path)) == {"FINISHED"}
    body.vertex_groups.clear()
    bpy.ops.skinwright.import_weights(filepath=str(path))
    assert digest(body) == before
    with pytest.raises(RuntimeError, match="exists already"):
        bpy.ops.skinwright.export_weights(filepath=str(path))
    assert bpy.ops.skinwright.export_weights(filepath=str(path), overwrite=True) == {"FINISHED"}


@pytest.mark.parametrize("name", ["", "body.txt", "none/body.npz"])
def test_names_that_cannot_be_written(body, tmp_path, name):
    with pytest.raises(RuntimeError, match="npz|no folder"):
        bpy.ops.skinwright.export_weights(filepath=str(tmp_path / name) if name else "")


def test_a_damaged_import_changes_nothing(body, digest, keeping, tmp_path):
    before = digest(body)
    for ending, content in (("npz", b"PK\x03\x04junk"), ("json", b"\xff\xfe"), ("json", b"{}")):
        path = tmp_path / f"bad.{ending}"
        path.write_bytes(content)
        with pytest.raises(RuntimeError, match="bad"):
            bpy.ops.skinwright.import_weights(filepath=str(path))
    assert digest(body) == before and not keeping.entries(body)


@pytest.mark.parametrize("ending", ["npz", "json"])
@pytest.mark.parametrize("weight", [float("nan"), 7.0, -0.5])
def test_no_file_holds_or_brings_what_is_no_weight(addon, body, digest, tmp_path, ending, weight):
    stored, record = (importlib.import_module(f"{addon.__name__}.stored.{name}") for name in ("exchange", "record"))
    kept = importlib.import_module(addon.__name__ + ".stored.keeping").take(body)
    kept.values[3] = weight
    path, before = tmp_path / f"body.{ending}", digest(body)
    with pytest.raises(record.RecordError, match="Body: the weight of vertex 1 in group Arm.L is"):
        stored.write(path, kept)
    assert not path.exists()
    path.write_bytes(record.to_npz(kept) if ending == "npz" else record.to_json(kept).encode())
    with pytest.raises(RuntimeError, match="must be a number from 0 to 1"):
        bpy.ops.skinwright.import_weights(filepath=str(path))
    assert digest(body) == before


@pytest.mark.parametrize("name", ["x" * 100, "a\0b", "\ud800"])
def test_a_name_that_no_group_can_have_changes_nothing(body, digest, tmp_path, name):
    path, before = tmp_path / "body.json", digest(body)
    bpy.ops.skinwright.export_weights(filepath=str(path))
    content = json.loads(path.read_text(encoding="utf-8"))
    content["names"][0] = name
    path.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(RuntimeError, match="Body cannot have a group called"):
        bpy.ops.skinwright.import_weights(filepath=str(path))
    assert digest(body) == before


def test_the_order_of_vertices_without_faces_is_not_trusted(scene):
    wire = builders.mesh("Wire", [(x, 0, 0) for x in range(6)], [])
    wire.data.edges.add(5)
    wire.data.edges.foreach_set("vertices", [0, 1, 1, 2, 2, 3, 3, 4, 4, 5])
    builders.paint(wire, Arm=np.linspace(0.2, 0.7, 6))
    builders.select(wire)
    bpy.ops.skinwright.store_weights()
    for vertex in wire.data.vertices:
        vertex.co.x = 5 - vertex.co.x
    bpy.ops.skinwright.restore_weights()
    assert np.allclose(builders.dense(wire, ["Arm"])[:, 0], np.linspace(0.7, 0.2, 6))
    for vertex in wire.data.vertices:
        vertex.co.z += 1  # merely moved
    bpy.ops.skinwright.restore_weights(state="0")
    assert np.allclose(builders.dense(wire, ["Arm"])[:, 0], np.linspace(0.2, 0.7, 6))


def test_states_of_a_later_version_are_not_lost(body, keeping):
    bpy.ops.skinwright.store_weights(state_name="Precious")
    (entry,) = json.loads(body.data["skinwright_weights_index"])
    body.data["skinwright_weights_index"] = json.dumps([entry | {"colour": "red"}]).encode()
    bpy.ops.skinwright.store_weights(state_name="Second")
    assert [entry.name for entry in keeping.entries(body)] == ["Precious", "Second"]
    bpy.ops.skinwright.restore_weights(state="0")


def test_a_damaged_index_is_as_none(body, keeping):
    for junk in (b"junk", b"{}", b"[[]]", b'[{"name": 5}]', b"[" * 100_000):
        body.data["skinwright_weights_index"] = junk
        assert keeping.entries(body) == []
    bpy.ops.skinwright.store_weights()
    assert len(keeping.entries(body)) == 1
    key = next(key for key in body.data.keys() if "blob" in key)
    body.data[key] = b"junk"
    with pytest.raises(RuntimeError, match="are damaged"):
        bpy.ops.skinwright.restore_weights()


def test_states_of_a_large_mesh_and_their_size(addon, keeping, digest):
    """What the file grows by: five bytes a member and at most sixteen a vertex."""
    coat = builders.grid("Coat", 100)
    rng = np.random.default_rng(1)
    for bone in range(4):
        builders.paint(coat, **{f"Bone{bone}": rng.random(10_000)})
    builders.select(coat)
    bpy.ops.skinwright.store_weights()
    assert keeping.size(coat) < 5 * 40_000 + 16 * 10_000
    before = keeping.size(coat)
    bpy.ops.skinwright.store_weights(state_name="Again")  # the same bytes
    assert keeping.size(coat) < before + 1000


class TestCommand:
    """`skinwright weights ...`, in this process."""

    @pytest.fixture
    def weights(self, addon):
        return lambda *arguments: addon.headless.command_line.weights([str(a) for a in arguments])

    def test_out_and_in_again(self, weights, body, digest, tmp_path, capsys):
        before, path = digest(body), tmp_path / "body.json"
        assert weights("store", "--object", "Body", "--name", "Mine") == 0
        assert weights("export", "--object", "Body", "--file", path) == 0
        body.vertex_groups.clear()
        assert weights("compare", "--object", "Body", "--name", "Mine") == 0
        assert "256 of 256 vertices differ" in capsys.readouterr().out
        assert weights("import", "--object", "Body", "--file", path, "--save", tmp_path / "out.blend") == 0
        assert digest(body) == before
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "out.blend"))
        assert digest(bpy.data.objects["Body"]) == before
        assert weights("list", "--object", "Body") == 0
        assert "Mine: 256 vertices" in capsys.readouterr().out
        assert weights("forget", tmp_path / "out.blend", "--object", "Body") == 0
        assert "nothing was saved: name a file with --save" in capsys.readouterr().err

    def test_refusals(self, weights, body, tmp_path, capsys):
        (tmp_path / "mine.npz").write_bytes(b"mine")
        for arguments, sentence in [
            (("restore", "--object", "Body"), "no stored weights"),
            (("export", "--object", "Body"), "needs --file"),
            (("export", "--object", "Body", "--file", tmp_path / "mine.npz"), "exists already"),
            (("import", "--object", "Body", "--file", tmp_path / "mine.npz"), "cannot be read"),
            (("import", "--object", "Body", "--file", tmp_path / "gone.npz"), "No such file"),
            (("list", "--object", "Rig"), "Rig is not a mesh"),
            (("list", "--object", "Nobody"), "there is no object Nobody"),
            (("list", tmp_path / "gone.blend", "--object", "Body"), "there is no file"),
        ]:
            assert weights(*arguments) == 1, arguments
            error = capsys.readouterr().err
            assert sentence in error and "Traceback" not in error
        assert (tmp_path / "mine.npz").read_bytes() == b"mine"
