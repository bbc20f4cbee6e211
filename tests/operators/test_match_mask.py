"""The match on show, the mask's edits, and painting without a window."""

import time
from importlib import import_module

import builders
import numpy as np
import pytest

PACKAGE = "bl_ext.user_default.skinwright"
bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")


@pytest.fixture
def coat(scene, native):
    """A grid over the middle of the body, one half of it too far away; and a loose patch farther still."""
    body = builders.body()
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 9), np.linspace(-0.5, 0.5, 9))
    sheet = np.stack([x.ravel(), y.ravel(), np.where(x.ravel() > 0.05, 0.5, 0.01)], axis=1)
    first = (np.arange(8)[None] + 9 * np.arange(8)[:, None]).ravel()
    faces = [(i, i + 1, i + 10, i + 9) for i in first]
    patch = np.array([(0, 0, 1), (0.1, 0, 1), (0, 0.1, 1)])
    obj = builders.mesh("Coat", np.concatenate([sheet, patch]), [*faces, (81, 82, 83)])
    scene.skinwright.transfer.source = body
    scene.skinwright.transfer.distance_mode = "ABSOLUTE"
    scene.skinwright.transfer.max_distance = 0.1
    scene.skinwright.transfer.max_normal_angle = 3.2
    builders.select(obj)
    return obj


@pytest.fixture
def session(coat):
    assert bpy.ops.skinwright.preview_match() == {"FINISHED"}
    yield import_module(f"{PACKAGE}.match.session").current
    if bpy.context.scene.skinwright.overlay.kind == "MATCH":
        bpy.ops.skinwright.preview_match()


def params():
    return bpy.context.scene.skinwright.transfer.to_params()


def counts(session):
    return session.match(params()).counts().tolist()


def test_preview_leaves_weights_and_groups_alone(coat, session):
    assert builders.weights(coat) == [{}] * 84
    assert not coat.vertex_groups


def test_categories(session):
    z = session.garment.geometry.positions[:, 2]
    match = session.match(params())
    assert match.category.tolist() == np.select([z < 0.1, z < 0.6], [0, 1], 4).tolist()


def test_sliders_only_threshold(session):
    bpy.context.scene.skinwright.transfer.method = "PAPER"
    assert counts(session) == [45, 36, 0, 0, 3]
    bpy.context.scene.skinwright.transfer.max_distance = 0.6
    assert counts(session) == [81, 0, 0, 0, 3]


def test_the_mask_decides(coat, session):
    coat.skinwright.mask_group = "Match Mask"
    builders.paint(coat, **{"Match Mask": [0.0] * 9 + [0.5] * 72 + [1.0] * 3})
    assert session.read_mask(coat)
    assert counts(session) == [40, 32, 3, 9, 0]
    assert not session.read_mask(coat)


def test_confidence_is_graded_and_coloured(coat, session):
    transfer = bpy.context.scene.skinwright.transfer
    transfer.method = "PAPER"
    assert session.match(params()).confidence is None
    transfer.method = "CONFIDENCE"
    match = session.match(params())
    x, _, z = session.garment.geometry.positions.T
    flat, far, patch = x < -0.1, (z > 0.1) & (z < 0.6), z > 0.6
    assert (match.confidence[flat & ~patch] > 0.9).all()
    assert (match.confidence[far] < 0.1).all()
    assert (match.confidence[patch] == 0).all(), "the patch hangs on the sheet"
    before = match.confidence
    transfer.softness = 1.4
    softer = session.match(params()).confidence
    assert (softer[far] < before[far]).all()

    picture = import_module(f"{PACKAGE}.overlay.picture")
    colours = import_module(f"{PACKAGE}.overlay.colours")
    shape = {"object_name": "Coat", "positions": None, "normals": None, "triangles": None}
    shown = picture._picture_of_match(session.match(params()), session, shape | {"kind": "MATCH"})
    assert shown.kind == "CONFIDENCE"
    assert [value for value, _ in shown.rows] == [1, 0.5, 0, 2, 3, 4]
    rgb = colours.of_values(shown.kind, shown.values)
    np.testing.assert_allclose(rgb[patch], colours.CATEGORIES[[4] * 3])
    np.testing.assert_allclose(colours.of_values("CONFIDENCE", np.array([0.0, 1.0])), colours.CATEGORIES[[1, 0]])


def test_the_mask_decides_with_confidence_too(coat, session):
    bpy.context.scene.skinwright.transfer.method = "CONFIDENCE"
    coat.skinwright.mask_group = "Match Mask"
    builders.paint(coat, **{"Match Mask": [0.0] * 9 + [0.5] * 72 + [1.0] * 3})
    session.read_mask(coat)
    match = session.match(params())
    assert (match.category[:9] == 3).all() and (match.confidence[:9] == 0).all()
    assert (match.category[-3:] == 2).all() and (match.confidence[-3:] == 1).all()


def test_second_press_turns_it_off(coat, session):
    bpy.ops.skinwright.preview_match()
    assert bpy.context.scene.skinwright.overlay.kind == "NONE"
    assert import_module(f"{PACKAGE}.match.session").current is None


@pytest.mark.parametrize(("what", "number"), [("UNMATCHED", 39), ("MATCHED", 45), ("LOOSE", 3)])
def test_select(coat, session, what, number):
    bpy.ops.skinwright.select_match(what=what)
    assert bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert sum(vertex.select for vertex in coat.data.vertices) == number


def test_select_islands_of_the_selected(coat, session):
    for vertex in coat.data.vertices:
        vertex.select = vertex.index == 82
    bpy.ops.skinwright.select_match(what="ISLAND")
    bpy.ops.object.mode_set(mode="OBJECT")
    assert [vertex.index for vertex in coat.data.vertices if vertex.select] == [81, 82, 83]


def test_attributes(coat, session):
    bpy.ops.skinwright.store_match()
    attributes = coat.data.attributes
    matched = [entry.value for entry in attributes["skinwright_matched"].data]
    assert matched == (session.garment.geometry.positions[:, 2] < 0.1).tolist()
    distance = [entry.value for entry in attributes["skinwright_distance"].data]
    assert distance == pytest.approx(session.garment.geometry.positions[:, 2].tolist(), abs=1e-6)
    assert attributes["skinwright_angle"].domain == "POINT"


def mask_values(coat):
    return [row["Match Mask"] for row in builders.weights(coat)]


def edit(action, **more):
    assert bpy.ops.skinwright.edit_match_mask(action=action, **more) == {"FINISHED"}


def test_a_fresh_mask_changes_nothing(coat, session):
    before = counts(session)
    edit("CLEAR")
    assert set(mask_values(coat)) == {0.5}
    session.read_mask(coat)
    assert counts(session) == before


def test_from_match(coat, session):
    edit("FROM_MATCH")
    assert mask_values(coat) == (session.garment.geometry.positions[:, 2] < 0.1).astype(float).tolist()


def test_selection_grow_shrink_invert(coat, session):
    edit("CLEAR")
    for vertex in coat.data.vertices:
        vertex.select = vertex.index == 40
    edit("FROM_SELECTION", value="INPAINT")
    edit("GROW")
    assert {i for i, value in enumerate(mask_values(coat)) if value == 0} == {31, 39, 40, 41, 49}
    edit("SHRINK")
    assert {i for i, value in enumerate(mask_values(coat)) if value == 0} == {40}
    edit("INVERT")
    assert mask_values(coat)[40] == 1 and mask_values(coat)[0] == 0.5


def test_another_tools_mask_is_not_edited(coat, session):
    builders.paint(coat, Other=0.3)
    coat.skinwright.mask_group, coat.skinwright.mask_reading = "Other", "PAINTED"
    with pytest.raises(RuntimeError, match="set Reading to Steer"):
        edit("CLEAR")


class TestPainting:
    """What the modal operator does between events."""

    @pytest.fixture
    def painting(self, coat):
        builders.paint(coat, Arm__L=0.3, Old=0.7)
        coat.vertex_groups.active_index = 1
        self.before = builders.weights(coat)
        mask_painting = import_module(f"{PACKAGE}.match.painting")
        painting = mask_painting.MaskPainting(bpy.context, coat, params())
        assert builders.weights(coat) == self.before and not coat.skinwright.mask_group, "preparing has written"
        painting.open(bpy.context)
        return painting

    def settle(self, painting):
        changes = import_module(f"{PACKAGE}.scene.changes")
        bpy.context.view_layer.update()
        changes.version += 1
        for _ in range(2000):
            if painting.tick(params(), True):
                return
            time.sleep(0.002)
        raise AssertionError("nothing was solved")

    def test_begins_on_the_mask(self, coat, painting):
        assert coat.vertex_groups.active.name == "Match Mask"
        painting.restore()

    def test_weights_follow_the_mask(self, coat, painting):
        self.settle(painting)
        first = builders.weights(coat)
        transfer = import_module(f"{PACKAGE}.transfer").transfer_weights
        coat.vertex_groups["Match Mask"].add(list(range(9)), 0.0, "REPLACE")
        self.settle(painting)
        painting.finish()
        followed = builders.weights(coat)
        assert followed != first
        transfer(bpy.context, bpy.context.scene.skinwright.transfer.source, [coat], params())
        assert builders.weights(coat) == followed

    def test_an_expected_stroke_is_seen_before_blender_counts_it(self, coat, painting):
        self.settle(painting)
        first = builders.weights(coat)
        coat.vertex_groups["Match Mask"].add(list(range(9)), 0.0, "REPLACE")
        assert not painting.tick(params(), True)
        painting.expect_stroke()
        assert painting.tick(params(), True)
        assert builders.weights(coat) != first
        painting.restore()

    def test_finish_restores_group_and_overlay(self, coat, painting):
        painting.finish()
        painting.close()
        assert coat.vertex_groups.active.name == "Old"
        assert bpy.context.scene.skinwright.overlay.kind == "NONE"
        assert coat.skinwright.mask_group == "Match Mask"

    def test_cancel_restores_everything_bit_for_bit(self, coat, painting):
        self.settle(painting)
        assert builders.weights(coat) != self.before
        painting.restore()
        assert builders.weights(coat) == self.before
        assert [group.name for group in coat.vertex_groups] == ["Arm.L", "Old"]
        assert coat.skinwright.mask_group == ""

    def test_a_target_without_an_armature_gets_the_sources_for_the_time(self, coat, painting):
        armature = bpy.context.scene.skinwright.transfer.source.modifiers["Armature"].object
        assert painting.armature_added == (coat.modifiers[0].object == armature)
        assert painting.armature_added
        painting.restore()
        assert not coat.modifiers

    def test_a_mask_without_any_match_leaves_weights_and_says_why(self, coat, painting):
        self.settle(painting)
        before = builders.weights(coat)
        coat.vertex_groups["Match Mask"].add(list(range(84)), 0.0, "REPLACE")
        with pytest.raises(AssertionError, match="nothing was solved"):
            self.settle(painting)
        assert "Coat" in painting.problem
        after = builders.weights(coat)
        assert [row["Arm.L"] for row in after] == [row["Arm.L"] for row in before]
        painting.restore()


def test_rows_that_differ(addon):
    """By brute force: rows that grow, shrink, change a bone or a value, and rows that only lie elsewhere now."""
    module = import_module(f"{PACKAGE}.match.session")
    rng = np.random.default_rng(3)

    def rows(table):
        indptr = np.cumsum([0] + [len(row) for row in table]).astype(np.uint32)
        entries = [entry for row in table for entry in row]
        bones, values = [b for b, _ in entries], [v for _, v in entries]
        return addon.csr.Rows(indptr, np.array(bones, np.uint32), np.array(values, np.float32))

    for _ in range(200):
        before = [[(b, float(rng.integers(3))) for b in range(rng.integers(4))] for _ in range(12)]
        now = [list(row) for row in before]
        for i in rng.integers(12, size=3):
            now[i] = [(b + int(rng.integers(2)), float(rng.integers(3))) for b in range(rng.integers(4))]
        wanted = [a != b for a, b in zip(now, before, strict=True)]
        if any(before):
            assert module.differs(rows(now), rows(before)).tolist() == wanted
    assert module.differs(rows(now), None).all()


class TestStrokesOnALargeTarget:
    """Answered with the rows around them first, and with those of the whole once the brush rests."""

    @pytest.fixture
    def painting(self, scene, native, monkeypatch):
        scene.skinwright.transfer.source = builders.body()
        self.sheet = builders.grid("Sheet", 212, size=1.6, z=0.05)
        builders.select(self.sheet)
        module = import_module(f"{PACKAGE}.match.painting")
        monkeypatch.setattr(module, "PATIENCE_SECONDS", 60.0)
        monkeypatch.setattr(module, "REST_SECONDS", 0.0)
        painting = module.MaskPainting(bpy.context, self.sheet, params())
        painting.open(bpy.context)
        self.stroke(painting, [])
        assert painting.unsettled is None, "the first solve is one of the whole"
        return painting

    def stroke(self, painting, vertices):
        self.sheet.vertex_groups["Match Mask"].add(vertices, 0.0, "REPLACE")
        painting.expect_stroke()
        assert painting.tick(params(), True)

    def assert_as_a_transfer(self):
        """The rows in the file are those of a transfer with the same mask."""
        painted = builders.dense(self.sheet, ("Arm.L", "Arm.R"))
        transfer = import_module(f"{PACKAGE}.transfer").transfer_weights
        transfer(bpy.context, bpy.context.scene.skinwright.transfer.source, [self.sheet], params())
        assert (painted == builders.dense(self.sheet, ("Arm.L", "Arm.R"))).all()

    def test_rest_brings_the_whole(self, painting):
        before = builders.dense(self.sheet, ("Arm.L", "Arm.R"))
        self.stroke(painting, [row * 212 + column for row in range(20) for column in range(20)])
        assert painting.unsettled is not None
        near = builders.dense(self.sheet, ("Arm.L", "Arm.R"))
        assert 0 < (near != before).any(axis=1).sum() < 20_000
        for _ in range(20_000):
            if painting.tick(params(), True):
                break
            time.sleep(0.001)
        assert painting.unsettled is None
        assert len(painting.seconds) == 2, "the whole is not another stroke"
        assert np.abs(near - builders.dense(self.sheet, ("Arm.L", "Arm.R"))).max() < 5e-3
        painting.finish()
        self.assert_as_a_transfer()

    @pytest.mark.parametrize("end", ["finish", "settle"])
    def test_the_end_brings_the_whole(self, painting, end):
        self.stroke(painting, list(range(0, 2120, 212)))
        self.stroke(painting, list(range(1, 2120, 212)))
        assert painting.unsettled is not None
        getattr(painting, end)()
        assert painting.unsettled is None
        self.assert_as_a_transfer()

    def test_the_next_stroke_does_not_wait_for_the_whole(self, painting):
        self.stroke(painting, list(range(0, 2120, 212)))
        painting.tick(params(), True)
        painting.expect_stroke()
        assert painting.unsettled is not None
        assert not painting.session.solving
        painting.restore()


class TestRefusedMeansUnchanged:
    """No group, no mask, no overlay, no traceback."""

    def test_from_match_with_a_source_without_faces(self, scene, coat):
        scene.skinwright.transfer.source.data.clear_geometry()
        before = [group.name for group in coat.vertex_groups], coat.skinwright.mask_group
        with pytest.raises(RuntimeError, match="has no (faces|vertex groups)"):
            bpy.ops.skinwright.edit_match_mask(action="FROM_MATCH")
        assert ([group.name for group in coat.vertex_groups], coat.skinwright.mask_group) == before

    def test_from_match_in_edit_mode_without_a_source(self, scene, coat):
        scene.skinwright.transfer.source = None
        bpy.ops.object.mode_set(mode="EDIT")
        with pytest.raises(RuntimeError, match="There is no source to match"):
            bpy.ops.skinwright.edit_match_mask(action="FROM_MATCH")
        assert bpy.context.mode == "EDIT_MESH"
        bpy.ops.object.mode_set(mode="OBJECT")
        assert not coat.skinwright.mask_group

    def test_selecting_in_what_is_hidden(self, coat):
        coat.hide_viewport = True
        with pytest.raises(RuntimeError, match="Coat is hidden"):
            bpy.ops.skinwright.select_match()

    def test_a_write_that_breaks(self, addon, coat, monkeypatch):
        before = [group.name for group in coat.vertex_groups], coat.skinwright.mask_group

        def broken(*_arguments):
            raise KeyError("x")

        monkeypatch.setattr(addon.scene.mask, "write", broken)
        with pytest.raises(RuntimeError, match="Internal error .KeyError: 'x'."):
            bpy.ops.skinwright.edit_match_mask(action="CLEAR")
        assert ([group.name for group in coat.vertex_groups], coat.skinwright.mask_group) == before


def test_a_mirrored_half_is_previewed_by_its_own_vertices(scene, coat):
    coat.modifiers.new("Mirror", "MIRROR")
    for operator in ("preview_match", "store_match", "select_match"):
        assert getattr(bpy.ops.skinwright, operator)() == {"FINISHED"}
