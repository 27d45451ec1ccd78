"""The object is a patch that waits for the hand, whatever a detector takes for it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from lbw_minimal.clips.detector import Found
from lbw_minimal.clips.patches import Path, chosen, gone, mended
from tests.toy_clips import room

H, W, T = 120, 160, 40


@pytest.fixture(scope="module")
def clip():
    """A hand comes to a box and pushes it on; the frames, the hand's path and the box's."""
    hand = np.stack([np.interp(np.arange(T), [0, 5, 35], [20, 20, 120]), np.full(T, 60)], 1)
    box = np.stack([np.maximum(75, hand[:, 0] + 15), np.full(T, 64)], 1)
    return acted(hand, box), hand, box


def acted(hand, box):
    """The frames (T, H, W, 3) uint8 of those paths (T, 2)."""
    frames = np.repeat(cv2.GaussianBlur(room(H, W), (0, 0), 2)[None], T, axis=0)
    for frame, (x, y), (bx, by) in zip(frames, hand.astype(int), box.astype(int), strict=True):
        cv2.rectangle(frame, (bx - 8, by - 8), (bx + 8, by + 8), (200, 40, 30), -1)
        cv2.circle(frame, (bx, by), 4, (240, 240, 60), -1)
        cv2.rectangle(frame, (x - 6, 0), (x + 6, y), (40, 60, 110), -1)
        cv2.circle(frame, (x, y), 7, (220, 170, 140), -1)
    return frames


def found(hand, thing):
    return Found(hand, thing, np.ones(T), np.ones(T))


def off(mend, box):
    """Pixels by which a path is off the box's, but for where on the box it is."""
    error = mend.object - box
    return np.abs(error - np.median(error, axis=0)).max()


def test_a_hand_that_was_taken_for_the_object_is_not_it(clip):
    frames, hand, box = clip
    assert off(found(hand, hand), box) > 20
    mend, pushed = mended(frames, found(hand, hand))
    assert off(mend, box) < 4 and mend.object_sure.mean() > 0.5 and pushed


def test_an_object_that_was_missed_until_the_touch_is_followed_back(clip):
    frames, hand, box = clip
    late = np.where(np.arange(T)[:, None] < 20, hand, box)
    assert off(mended(frames, found(hand, late))[0], box) < 4


def test_where_a_detector_sees_another_thing_for_a_moment_it_is_not_believed_then(clip):
    """In two frames in turn it sees the hand: a median of three would not take that out."""
    frames, hand, box = clip
    glitch = np.isin(np.arange(T), (24, 25))
    mend, pushed = mended(frames, found(hand, np.where(glitch[:, None], (20, 20), box + 0.3)))
    assert np.array_equal(mend.object_sure < 0.5, glitch) and pushed
    assert np.array_equal(mend.object[~glitch], box[~glitch] + 0.3)  # and else to a fraction


def test_a_hit_thing_whose_first_place_the_hand_hides_is_found_where_it_got_to(clip):
    hand = np.stack([np.interp(np.arange(T), [0, 5, 20], [20, 20, 75]), np.full(T, 60)], 1)
    box = np.stack([np.interp(np.arange(T), [16, 30], [75, 135]), np.full(T, 64)], 1)
    frames = acted(hand, box)
    assert off(mended(frames, found(hand, hand))[0], box) < 4


def test_how_far_an_object_goes_counts_only_where_it_is_mostly_seen(clip):
    """60 pixels across and 80 down, with a glitch that is no way."""
    path = np.array([[10.0, 10], [10, 10], [300, 10], [10, 10], [70, 90], [70, 90]])
    sure = np.array([1.0, 1, 1, 1, 1, 1])
    assert gone(Found(path, path, sure, sure)) == 100
    assert gone(Found(path, path, sure, np.array([0.5, 0.5, 0, 0, 0.5, 0.4]))) == 100
    assert gone(Found(path, path, sure, np.array([0.5, 0, 0, 0, 0.5, 0.4]))) == 0


def test_where_nothing_moves_but_the_hand_the_object_stays_where_it_is(clip):
    frames, hand, _ = clip
    rests = np.repeat([[75.0, 64.0]], T, axis=0)
    still = np.repeat(frames[:1], T, axis=0)
    mend, pushed = mended(still, found(hand, rests))
    assert np.ptp(mend.object, axis=0).max() < 1 and not pushed


def a_path(x, tip):
    places = np.stack([x, 0 * x], 1)
    return Path(places, np.ones(len(x)), None if tip is None else np.stack([tip, 0 * tip], 1), 120)


MOVES = np.interp(np.arange(40), [20, 35], [40, 90])  # after the hand has come
SWINGS = 60 - 20 * np.cos(0.7 * np.maximum(0, np.arange(40) - 20))
HAND = np.interp(np.arange(40), [0, 20, 35], [0, 38, 88])


@pytest.mark.parametrize(
    ("path", "is_it"),
    [
        (a_path(MOVES, HAND), True),
        (a_path(MOVES, None), True),
        (a_path(HAND + 5, HAND), False),  # a sleeve
        (a_path(MOVES + 200, HAND), False),  # nobody is near
        (a_path(np.where(np.arange(40) < 20, 40.0, 90.0), HAND), False),  # taken for another
        (a_path(SWINGS, HAND), False),
        (a_path(np.full(40, 40.0), HAND), False),
    ],
)
def test_what_waits_and_then_goes_without_leaps_by_a_hand_that_is_near_is_pushed(path, is_it):
    assert path.pushed == is_it


def test_one_path_alone_is_chance():
    right, other = a_path(MOVES, HAND), a_path(MOVES[::-1].copy(), HAND)
    assert chosen([right]) is None and chosen([right, replace(right)]) is right
    assert chosen([right, other]) is None


def test_paths_that_rest_alike_and_then_part_do_not_agree():
    """A patch that is followed to a look-alike rests as long, and goes the other way."""
    right, back = a_path(MOVES, HAND), a_path(80 - MOVES, HAND)
    assert right.pushed and back.pushed
    assert right.agrees(back, 0.5) and chosen([right, back]) is None


def test_of_paths_the_one_counts_with_which_most_agree():
    """Two that were followed to a look-alike, and are more like their patch, are outvoted."""
    right = replace(a_path(MOVES, HAND), alike=np.full(40, 0.9))
    back = a_path(80 - MOVES, HAND)
    assert back.worth > right.worth
    assert chosen([back, back, right, right, right]) is right
