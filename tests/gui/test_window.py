"""What only a real window can show; each test runs one script of `in_blender/`."""

import os

import pytest


def test_the_panel_opens_and_nothing_is_left_behind(blender):
    assert blender.run("smoke")["tab"] == "Weights"


def test_every_panel_opens(blender):
    assert blender.run("panels", size=(1000, 1300))["panels"] > 15


def test_painting_the_mask_moves_the_weights_and_esc_brings_them_back(blender):
    seen = blender.run("match_mask", size=(1100, 800))
    assert seen["many"][0] > seen["few"][0]
    assert seen["masked"] > 20


def test_long_work_shows_progress_and_esc_stops_it(blender):
    assert max(blender.run("long_work", size=(1100, 800))["progress"]) > 0


@pytest.mark.parametrize("kind", ["transfer", "sculpt", "mask"])
def test_quitting_ends_what_goes_on_without_an_error(blender, kind):
    assert blender.run("quitting", kind, size=(700, 520))["kind"] == kind
    log = blender.log("quitting")
    assert "Blender quit" in log and "panicked" not in log
    assert "skinwright" not in log.partition("Traceback")[2]  # Debian's Blender has tracebacks of its own


def test_automatic_weights_show_progress_and_are_one_undo_step(blender):
    seen = blender.run("automatic_weights", timeout=600, size=(1100, 800))
    assert max(seen["progress"]) > 0 and seen["groups"] > 2


def test_a_check_shows_the_offenders_and_the_worst_pose(blender):
    assert blender.run("check_weights", timeout=300, size=(1100, 900))["worst"]


def test_a_sculpt_becomes_weights_and_one_undo_step(blender):
    seen = blender.run("sculpt_weights", timeout=300, size=(1000, 900))
    assert seen["strokes"] == 2
    assert 0 < seen["reachability"] <= 1


def test_no_session_is_lost_and_none_is_left_behind(blender):
    assert len(blender.run("sessions", timeout=900, size=(700, 520))["passed"]) == 13


def test_what_happens_around_sessions_harms_nothing(blender):
    assert len(blender.run("sideways", timeout=900, size=(700, 520))["passed"]) == 22


def test_a_released_brush_never_leaves_its_rest_shape_in_the_view(blender):
    seen = blender.run("sculpt_release", timeout=200, size=(640, 480), real_mouse=True)
    assert seen["brush down"] > 0
    assert seen["brush up"] == []


def test_random_actions_leave_everything_in_order(blender):
    """`SKINWRIGHT_MONKEY=SEED,ACTIONS` for another seed or more of them: 2,000 take about half an hour."""
    seed, actions = os.environ.get("SKINWRIGHT_MONKEY", "1,150").split(",")
    seen = blender.run("monkey", seed, actions, timeout=60 + 3 * int(actions), size=(520, 400))
    assert seen["actions"] == int(actions) and seen["sessions"] > 0


def test_weights_are_retargeted_and_undone(blender):
    assert blender.run("retarget", timeout=300, size=(1100, 1000))["bones"] == 6


def test_the_live_preview_follows_posing_undo_and_playback(blender):
    seen = blender.run("live_refine", timeout=400, size=(1000, 760))
    assert seen["posed"] > 0.02
    assert len({frame for frame, _ in seen["played"]}) > 2
