"""A tip that was found on the object is put behind it: the toy push, whose tip is where it should
be, with dots that are not."""

from dataclasses import replace

import numpy as np
import pytest
from toy_pushes import HIT, SCENE, SIDE, clip, hit, seen

from lbw_minimal.clips import behind as module
from lbw_minimal.clips.behind import BEHIND, behind, put_behind
from lbw_minimal.clips.paths import Unusable
from lbw_minimal.clips.retarget import lay

TOUCH, THERE = 1.3, 1.9  # s, after 12 % of the object's way and before it is done
RIGHT = replace(clip(), width=SIDE)
MOVES = (RIGHT.times >= TOUCH) & (RIGHT.times <= THERE)


def on_the_object(when, ahead=0.0):
    """The push with its tip found on the object in those frames, or so many pixels ahead."""
    tip = RIGHT.tip.copy()
    tip[when] = RIGHT.object[when] + (ahead, 3)
    return replace(RIGHT, tip=tip)


def test_a_tip_behind_the_object_stays_where_it_is():
    motion = lay(RIGHT, SCENE)
    tracks, again = behind(RIGHT, motion, SCENE)
    np.testing.assert_array_equal(tracks.tip, RIGHT.tip)
    np.testing.assert_array_equal(again.tip, motion.tip)
    assert again.warnings == motion.warnings == []


@pytest.mark.parametrize("ahead", [0.0, 20.0, -0.015 * SIDE])
def test_a_tip_on_the_object_or_ahead_of_it_is_put_behind_it_and_that_is_said(ahead):
    wrong = on_the_object(RIGHT.times > 0.9, ahead)
    motion = lay(wrong, SCENE)
    tracks, again = behind(wrong, motion, SCENE)
    off = (tracks.tip - RIGHT.object)[MOVES] / SIDE
    np.testing.assert_allclose(off, np.tile((-BEHIND, 0), (MOVES.sum(), 1)), atol=4e-3)
    (said,) = again.warnings
    touch, there = motion.times[[motion.contact, motion.arrival]]
    assert said.endswith(f"look at the pictures from {touch:.1f} to {there:.1f} s.")
    after = RIGHT.times > there
    np.testing.assert_array_equal(tracks.tip[after], wrong.tip[after])


def test_it_is_behind_as_the_way_goes():
    """Mirrored, the object goes to the left and the hand is at its right."""
    path = np.array([SIDE, 0]) + RIGHT.object * (-1, 1)
    wrong = replace(RIGHT, tip=path, object=path)
    tracks, share = put_behind(wrong, TOUCH, THERE)
    off = (tracks.tip - path)[MOVES] / SIDE
    np.testing.assert_allclose(off, np.tile((BEHIND, 0), (MOVES.sum(), 1)), atol=4e-3)
    assert share == 1


@pytest.mark.parametrize("mirror", [True, None])
def test_a_clip_is_mirrored_as_it_was_laid_first(mirror):
    """Who asks for it is not told of it, neither by the first laying nor by the second."""
    wrong = on_the_object(RIGHT.times > 0.9)
    tip, thing = (np.array([SIDE, 0]) + path * (-1, 1) for path in (wrong.tip, wrong.object))
    wrong = replace(wrong, tip=tip, object=thing)
    motion = lay(wrong, SCENE, mirror)
    tracks, again = behind(wrong, motion, SCENE, mirror)
    assert tracks is not wrong and again.mirrored
    assert ["mirrored" in note for note in again.notes].count(True) == (mirror is None)


def test_in_a_few_frames_it_is_put_behind_the_object_and_nothing_is_said():
    few = MOVES & (RIGHT.times < 1.5)
    wrong = on_the_object(few)
    tracks, share = put_behind(wrong, TOUCH, THERE)
    assert share == pytest.approx(few.sum() / MOVES.sum()) and 0 < share < 0.5
    np.testing.assert_array_equal(tracks.tip[~few], RIGHT.tip[~few])
    off = (tracks.tip - RIGHT.object)[few] / SIDE
    np.testing.assert_allclose(off, np.tile((-BEHIND, 0), (few.sum(), 1)), atol=4e-3)
    assert behind(wrong, lay(wrong, SCENE), SCENE)[1].warnings == []


@pytest.mark.parametrize(("share", "all_of_them"), [(0.4, False), (0.6, True)])
def test_where_it_mostly_was_on_the_object_it_is_put_behind_all_along(share, all_of_them):
    """In the other frames its dot is as far off as the object's corner or its shadow."""
    moving = np.flatnonzero(MOVES)
    few = moving[: round(share * len(moving))]
    wrong, beside = on_the_object(few), RIGHT.object + (-0.06 * SIDE, 0.05 * SIDE)
    tip = wrong.tip.copy()
    tip[moving[len(few) :]] = beside[moving[len(few) :]]
    tracks, found = put_behind(replace(wrong, tip=tip), TOUCH, THERE)
    assert found == pytest.approx(len(few) / len(moving))
    off = (tracks.tip - RIGHT.object)[moving[len(few) :]] / SIDE
    want = (-BEHIND, 0) if all_of_them else (-0.06, 0.05)
    np.testing.assert_allclose(off, np.tile(want, (len(off), 1)), atol=4e-3)


def test_a_tip_found_on_the_object_at_rest_is_put_between_those_elsewhere():
    early = (RIGHT.times > 0.3) & (RIGHT.times < 0.5)
    tracks, share = put_behind(on_the_object(early), TOUCH, THERE)
    np.testing.assert_allclose(tracks.tip, RIGHT.tip, atol=0.02 * SIDE)
    assert share == 0
    far = on_the_object(early, 0.1 * SIDE)  # above a thing at rest, or beyond, a hand may be
    np.testing.assert_array_equal(put_behind(far, TOUCH, THERE)[0].tip, far.tip)


def test_another_shot_stays_as_it_is():
    wrong = replace(on_the_object(RIGHT.times > 0), cuts=(6,))
    tracks, _ = put_behind(wrong, TOUCH, THERE)
    np.testing.assert_array_equal(tracks.tip[:6], wrong.tip[:6])
    first = tracks.tip[MOVES][0]  # where it is known first, behind the object
    np.testing.assert_allclose(tracks.tip[6:30], np.tile(first, (24, 1)))


def test_where_the_picture_changes_on_the_objects_way_it_is_one_shot_all_the_same():
    """As where a lamp goes on: neither tip nor object jumps, so the piece that is used goes on."""
    wrong = on_the_object(RIGHT.times > 0.9)
    whole, share = put_behind(wrong, TOUCH, THERE)
    for later in (TOUCH + 0.02, THERE - 0.3, THERE):
        cut = int(np.searchsorted(RIGHT.times, later))
        tracks, again = put_behind(replace(wrong, cuts=(cut,)), TOUCH, THERE)
        np.testing.assert_array_equal(tracks.tip, whole.tip)
        assert again == share


def test_a_hit_and_a_hand_that_touches_nothing_are_let_alone():
    t = np.arange(0, 2.6, 1 / 30)
    tracks = replace(seen(hit(t), t), width=SIDE)
    motion = lay(tracks, HIT)
    assert behind(tracks, motion, HIT) == (tracks, motion)
    nothing = replace(SCENE, contact=None)
    assert behind(RIGHT, motion, nothing) == (RIGHT, motion)


def test_a_clip_that_was_taken_stays_taken(monkeypatch):
    wrong = on_the_object(RIGHT.times > 0.9)
    motion = lay(wrong, SCENE)

    def refuse(*_):
        raise Unusable("no", "else")

    monkeypatch.setattr(module, "lay", refuse)
    tracks, again = behind(wrong, motion, SCENE)
    assert tracks is wrong and again is motion
