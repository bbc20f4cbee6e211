"""When the sculpting operator looks for strokes; the session is stood in for."""

from importlib import import_module

import pytest

pytest.importorskip("bpy", reason="needs the bpy wheel")


class Session:
    """Notes what is asked of it."""

    def __init__(self):
        self.asked = []

    def expect_stroke(self):
        self.asked.append("expect")

    def set_strength(self, kappa):
        self.asked.append(kappa)

    def stroke(self):
        self.asked.append("stroke")
        return "outcome"


@pytest.fixture
def session():
    return Session()


@pytest.fixture
def changes(addon, monkeypatch):
    """The counts of what happens in Blender, at 0."""
    module = addon.scene.changes
    monkeypatch.setattr(module, "version", 0)
    monkeypatch.setattr(module, "undone", 0)
    return module


@pytest.fixture
def watch(addon, changes, session):
    return import_module(f"{addon.__name__}.operators.sculpt.watch").StrokeWatch(session)


def test_each_change_is_looked_at_once(watch, changes, session):
    assert watch.look(0.1) is None and session.asked == []
    changes.version += 1
    assert watch.look(0.1) == "outcome"
    assert watch.look(0.1) is None
    assert session.asked == [0.1, "stroke"]


def test_a_brush_that_was_down_is_looked_at_before_blender_has_counted_it(watch, session):
    watch.expect_stroke()
    assert watch.look(0.2) == "outcome"
    assert watch.look(0.2) is None
    assert session.asked == [0.2, "stroke"]


def test_only_a_brush_that_rests_leaves_time_for_more(watch, changes, session):
    for _ in range(3):
        changes.version += 1
        watch.expect_stroke()
    assert session.asked == []
    watch.expect_stroke()
    assert session.asked == ["expect"]


def test_a_refused_stroke_is_not_looked_at_again(watch, session, monkeypatch):
    def refuse():
        raise ValueError

    monkeypatch.setattr(session, "stroke", refuse)
    watch.expect_stroke()
    with pytest.raises(ValueError):
        watch.look(0.1)
    assert watch.look(0.1) is None


class Strokes:
    """A session of which only the number of strokes counts."""

    def __init__(self, made):
        self.made = self.stroke_count = made

    def undo(self):
        self.stroke_count -= 1
        return True

    def redo(self):
        self.stroke_count += 1
        return True


@pytest.mark.parametrize(
    ("at", "count", "back", "now", "left"),
    [
        ([5, 6, 8], 3, True, 7, 2),  # the step of the last stroke
        ([5, 6, 8], 3, True, 8, 3),  # something else was undone
        ([5, 6, 8], 3, True, 5, 1),  # several at once, from the history
        ([5, 6, 8], 1, False, 8, 3),
        ([5, 6, 8], 1, False, 5, 1),
        ([5, 6, 8], 2, True, None, 1),  # Blender does not say before 5.3
        ([5, 6, 8], 2, False, None, 3),
    ],
)
def test_blenders_undo_takes_back_the_strokes_of_its_steps(addon, at, count, back, now, left):
    brushes = import_module(f"{addon.__name__}.operators.sculpt.brushes").SculptBrushes
    session = brushes.__new__(brushes)
    session.session, session._stroke_at = Strokes(len(at)), at
    session.session.stroke_count = count
    session._follow(None, back, now)
    assert session.session.stroke_count == left
