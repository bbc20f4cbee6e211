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
