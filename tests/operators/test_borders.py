"""Borders that exist only in the file, under a Mirror or between objects do not open; wires follow what they lie on."""

import builders
import figure
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


@pytest.fixture
def body(scene):
    return figure.body()


def rows_of(obj):
    return builders.dense(obj, figure.BONES)


def at_places(*objects):
    """The rows at every place, keyed by its rounded position, and the largest difference between rows at one place."""
    found = {}
    for obj in objects:
        for place, row in zip(map(tuple, figure.rest(obj).round(5) + 0.0), rows_of(obj), strict=True):
            found.setdefault(place, []).append(row)
    apart = max(np.ptp(rows, axis=0).max() for rows in found.values())
    return {place: rows[0] for place, rows in found.items()}, apart


def panels(faces, positions):
    """Eight panels around the figure."""
    angle = np.arctan2(*positions[faces].mean(axis=1)[:, :2].T)
    return np.floor((angle + np.pi) / (2 * np.pi) * 8).astype(int) % 8


def flat(faces, positions):
    """Every face by itself."""
    return np.arange(len(faces))


def rings(faces, positions):
    """Three bands, one above the other."""
    return np.digitize(positions[faces].mean(axis=1)[:, 2], [0.7, 0.95])


def cut(obj, name, kind):
    """A copy whose faces share vertices only within a piece."""
    positions, faces = figure.rest(obj), np.array([list(p.vertices) for p in obj.data.polygons])
    corner = faces + kind(faces, positions)[:, None] * len(positions)
    used, number = np.unique(corner, return_inverse=True)
    return builders.mesh(name, positions[used % len(positions)], number.reshape(faces.shape))


class TestSeams:
    """Vertices at one place get one row: that of the mesh without the seam."""

    @pytest.mark.parametrize("kind", [panels, flat, rings])
    @pytest.mark.parametrize(
        "settings",
        [{}, {"smoothing_iterations": 3}, {"max_influences": 2}, {"island_policy": "rigid"}, {"geometry": "REST"}],
        ids=str,
    )
    def test_split_as_if_it_were_whole(self, plain, body, kind, settings):
        skirt = figure.skirt(n=48, rings=16)
        pieces = cut(skirt, "Pieces", kind)
        plain(body, skirt, **settings)
        plain(body, pieces, **settings)
        whole, _ = at_places(skirt)
        split, apart = at_places(pieces)
        assert apart == 0
        assert all(split[place] == pytest.approx(row, abs=1e-6) for place, row in whole.items())

    def test_no_gap_in_a_pose(self, plain, body):
        pieces = cut(figure.skirt(), "Pieces", panels)
        plain(body, pieces)
        _, first, same = np.unique(figure.rest(pieces).round(6), axis=0, return_index=True, return_inverse=True)
        figure.turn(body.modifiers[0].object, "Leg.L", -70)
        shown = figure.shown(pieces)
        assert np.abs(shown - shown[first[same.reshape(-1)]]).max() < 1e-5

    def test_welding_can_be_switched_off(self, plain, body):
        pieces = cut(figure.skirt(), "Pieces", panels)
        plain(body, pieces, relative_weld_tolerance=0)
        assert at_places(pieces)[1] > 0.1

    def test_seams_of_the_source(self, plain, body):
        """A body with split normals gives what a body without them gives."""
        trousers, again = figure.trousers(), figure.trousers("Again")
        plain(body, trousers)
        pieces = cut(body, "Cut Body", flat)
        figure.paint(pieces, figure.weights_at(figure.rest(pieces)))
        figure.bind(pieces, body.modifiers[0].object)
        plain(pieces, again, source_scope="OBJECT")
        assert rows_of(again) == pytest.approx(rows_of(trousers), abs=1e-3)


class TestBetweenObjects:
    """Selected objects with a common border."""

    def split(self, where):
        skirt = figure.skirt()
        parts = figure.part(skirt, "First", where), figure.part(skirt, "Second", lambda centre: not where(centre))
        return skirt, parts

    @pytest.mark.parametrize(
        "where",
        [lambda centre: centre[2] > 0.8, lambda centre: centre[0] > 0, lambda centre: centre[1] > 0.1],
        ids=["flounce", "halves", "front and back"],
    )
    def test_joined_they_are_one(self, plain, body, where):
        skirt, parts = self.split(where)
        plain(body, skirt)
        plain(body, *parts)
        whole, _ = at_places(skirt)
        found, apart = at_places(*parts)
        assert apart == 0
        assert all(found[place] == pytest.approx(row, abs=1e-6) for place, row in whole.items())

    def test_by_choice_each_by_itself(self, plain, body):
        _, parts = self.split(lambda centre: centre[0] > 0)
        plain(body, *parts, join_borders=False)
        assert at_places(*parts)[1] > 0.1

    def test_three_in_a_row_beside_a_stranger(self, plain, body):
        skirt = figure.skirt()
        bands = [
            figure.part(skirt, f"Band {low}", lambda centre, low=low: low < centre[2] <= low + 0.25)
            for low in (0.45, 0.7, 0.95)
        ]
        boot = builders.mesh("Boot", *figure.tube(0.12, 0.05, 0.4, 0.095))
        plain(body, bands[2], boot, bands[0], bands[1])
        assert at_places(*bands)[1] == 0
        assert rows_of(boot).sum(1) == pytest.approx(1, abs=1e-6)

    def test_each_keeps_its_own_mask_and_locks(self, plain, body):
        _, parts = self.split(lambda centre: centre[0] > 0)
        builders.paint(parts[0], Mask=0.0)
        parts[0].skinwright.mask_group = "Mask"
        builders.paint(parts[1], Leg__L=0.25)
        parts[1].vertex_groups["Leg.L"].lock_weight = True
        report = plain(body, *parts)
        assert report.garments[0].matched == 0 < report.garments[1].matched
        assert rows_of(parts[1])[:, 1] == pytest.approx(0.25)
        assert rows_of(parts[1]).sum(1) == pytest.approx(1, abs=1e-6)


class TestMirror:
    """Half a garment under a Mirror modifier is solved as the whole one."""

    def half(self, kind="plain"):
        skirt = figure.skirt()
        half = figure.part(skirt, "Half", lambda centre: centre[0] > 0)
        modifier = half.modifiers.new("Mirror", "MIRROR")
        if kind == "object":
            centre = bpy.data.objects.new("Centre", None)
            bpy.context.collection.objects.link(centre)
            half.location.x = 0.5
            for vertex in half.data.vertices:
                vertex.co.x -= 0.5
            modifier.mirror_object = centre
        if kind == "turned":
            half.rotation_euler.z = np.pi / 2
            for vertex in half.data.vertices:
                vertex.co = (vertex.co.y, -vertex.co.x, vertex.co.z)
            modifier.use_axis = (False, True, False)
        if kind == "not merged":
            modifier.use_mirror_merge = False
        bpy.context.view_layer.update()
        return skirt, half

    @pytest.mark.parametrize("kind", ["plain", "object", "turned", "not merged"])
    def test_as_the_whole_garment(self, plain, body, kind):
        skirt, half = self.half(kind)
        plain(body, skirt)
        plain(body, half)
        place = np.linalg.norm(figure.rest(half)[:, None] - figure.rest(skirt), axis=2).argmin(axis=1)
        assert rows_of(half) == pytest.approx(rows_of(skirt)[place], abs=0.02)
        middle = np.abs(figure.rest(half)[:, 0]) < 1e-4
        rows = rows_of(half)[middle]
        assert middle.any() and np.array_equal(rows[:, [1, 2]], rows[:, [3, 4]])

    def test_with_a_limit_and_smoothing(self, plain, body):
        _, half = self.half()
        plain(body, half, max_influences=3, smoothing_iterations=5)
        rows = rows_of(half)
        assert ((rows > 0).sum(1) <= 3).all() and rows.sum(1) == pytest.approx(1, abs=1e-6)

    def test_the_mask_counts_on_both_sides(self, plain, body):
        _, half = self.half()
        builders.paint(half, Mask=0.0)
        half.vertex_groups["Mask"].add([0], 1.0, "REPLACE")
        half.skinwright.mask_group = "Mask"
        assert plain(body, half).garments[0].matched == 1

    def test_a_half_without_a_body_to_match_takes_no_part(self, plain, body):
        """One leg of a body under no Mirror, and a boot under one: the boot follows the leg that is there."""
        leg = figure.part(body, "One Leg", lambda centre: centre[0] > 0 and centre[2] < 0.9)
        figure.bind(leg, body.modifiers[0].object)
        boot = builders.mesh("Boot", *figure.tube(0.12, 0.05, 0.4, 0.095))
        boot.modifiers.new("Mirror", "MIRROR")
        plain(leg, boot, source_scope="OBJECT")
        assert rows_of(boot)[:, [1, 2]].sum(1).min() > 0.95

    @pytest.mark.parametrize("side", [1, -1])
    def test_a_mirror_that_cuts_completes_what_has_nothing_to_be_cut_off(self, plain, body, addon, side):
        skirt = figure.skirt()
        half = figure.part(skirt, "Half", lambda centre: side * centre[0] > 0)
        modifier = half.modifiers.new("Mirror", "MIRROR")
        modifier.use_bisect_axis[0], modifier.use_bisect_flip_axis[0] = True, side < 0
        plain(body, half)
        plain(body, skirt)
        whole, _ = at_places(skirt)
        own, _ = at_places(half)
        assert max(np.abs(row - whole[at]).max() for at, row in own.items()) < 0.02
        skirt.modifiers.new("Mirror", "MIRROR").use_bisect_axis[0] = True
        assert addon.scene.mirror.reflections(skirt, np.eye(4), figure.rest(skirt)) == []

    def test_a_mirror_after_the_pose_completes_nothing(self, body, addon):
        skirt = figure.skirt()
        skirt.modifiers.new("Armature", "ARMATURE").object = body.modifiers[0].object
        skirt.modifiers.new("Mirror", "MIRROR")
        assert addon.scene.mirror.reflections(skirt, np.eye(4), figure.rest(skirt)) == []

    def test_front_and_back_follow_the_same_bones(self, plain, body):
        """A mirror along Y exchanges no sides: with its groups kept it completes, with them flipped it is named."""
        skirt = figure.skirt()
        front = figure.part(skirt, "Front", lambda centre: centre[1] < 0)
        modifier = front.modifiers.new("Mirror", "MIRROR")
        modifier.use_axis, modifier.use_mirror_vertex_groups = (False, True, False), False
        assert plain(body, front).all_warnings() == []
        plain(body, skirt)
        whole, _ = at_places(skirt)
        own, _ = at_places(front)
        assert max(np.abs(row - whole[at]).max() for at, row in own.items()) < 0.02
        modifier.use_mirror_vertex_groups = True
        said = " ".join(plain(body, front).all_warnings())
        assert "Mirror of Front exchanges left and right in a copy that lies on the same side" in said

    def test_two_axes(self, addon):
        """A quarter becomes four, each place once."""
        half = builders.grid("Quarter", 5)
        for vertex in half.data.vertices:
            vertex.co.x, vertex.co.y = vertex.co.x + 1, vertex.co.y + 1
        half.modifiers.new("Mirror", "MIRROR").use_axis = (True, True, False)
        geometry = addon.scene.mesh.read(half)
        reflections = addon.scene.mirror.reflections(half, np.eye(4), geometry.positions)
        completed = addon.transfer.completion.complete(geometry, reflections)
        positions = completed.geometry.positions
        assert len(positions) == len(np.unique(positions, axis=0)) == 81
        assert len(completed.geometry.triangles) == 4 * len(geometry.triangles)
        corners = positions[completed.geometry.triangles]
        assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0).all()


class TestWires:
    """Edges without faces, and points without edges."""

    def lace(self):
        t = np.linspace(0, 1, 30)
        return np.stack([0.12 + 0.125 * np.cos(6 * t), 0.125 * np.sin(6 * t), 0.2 + 0.5 * t], axis=1)

    def wired(self, name, positions, faces, edges):
        data = bpy.data.meshes.new(name)
        data.from_pydata(np.asarray(positions).tolist(), edges, [list(map(int, face)) for face in faces])
        obj = bpy.data.objects.new(name, data)
        bpy.context.collection.objects.link(obj)
        return obj

    @pytest.mark.parametrize("kind", ["lace", "attached lace", "points", "string alone", "two strings"])
    def test_they_follow_the_leg_they_lie_on(self, plain, body, kind):
        positions, faces = figure.joined(figure.tube(0.12, 0.05, 0.98, 0.108), figure.tube(-0.12, 0.05, 0.98, 0.108))
        lace = self.lace()
        if "string" in kind:
            positions, faces = np.empty((0, 3)), []
        start = len(positions)
        edges = [(start + i, start + i + 1) for i in range(29)] if kind != "points" else []
        points = [lace]
        if kind == "attached lace":
            edges.append((start, 4 * 24))
        if kind == "two strings":
            edges += [(start + 30 + i, start + 31 + i) for i in range(29)]
            points.append(lace * [-1, 1, 1])
        obj = self.wired("Wired", np.concatenate([positions, *points]), faces, edges)
        plain(body, obj)
        rows, truth = rows_of(obj)[start:], figure.weights_at(np.concatenate(points))
        assert rows.sum(1) == pytest.approx(1, abs=1e-6)
        assert np.abs(rows - truth).sum(1).mean() / 2 < 0.1
