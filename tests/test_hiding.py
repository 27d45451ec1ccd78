"""Whether what is pushed is in sight: a thing of 13 pixels that goes 60 pixels across a table."""

from dataclasses import replace

import numpy as np
import pytest

from lbw_minimal.clips.hiding import _cut, alike, unlike
from lbw_minimal.clips.paths import Tracks

T, TOUCH, THERE = 40, 1.0, 3.0  # frames, and s at 10 frames a second
RNG = np.random.default_rng(0)
TABLE = RNG.integers(100, 110, (100, 160, 3), np.uint8)
THING, HAND = RNG.integers(0, 255, (2, 15, 15, 3), np.uint8)
TIMES = np.arange(T) / 10
PLACES = np.stack([40 + 60 * np.clip((TIMES - TOUCH) / 2, 0, 1), np.full(T, 50.0)], 1)
FAR = PLACES - np.array([30.0, 0])


def filmed(hidden, tip=FAR, cuts=(), shown=PLACES):
    """Frames of the thing at the places `shown`, behind a hand in the frames `hidden` (T,) bool."""
    frames = np.repeat(TABLE[None], T, 0)
    for frame, (x, y), behind in zip(frames, shown.round().astype(int), hidden, strict=True):
        frame[y - 7 : y + 8, x - 7 : x + 8] = HAND if behind else THING
    sure = np.ones(T)
    return frames, Tracks(TIMES, tip, PLACES, sure, sure, 100, cuts)


def test_a_thing_in_sight_looks_like_itself():
    frames, tracks = filmed(np.zeros(T, bool))
    assert alike(frames, tracks, TOUCH, THERE) > 0.9
    assert unlike(frames, tracks, TOUCH, THERE) == []


def test_what_a_hand_hides_on_its_way_does_not():
    frames, tracks = filmed(TIMES > TOUCH)
    assert alike(frames, tracks, TOUCH, THERE) < 0.3
    (said,) = unlike(frames, tracks, TOUCH, THERE)
    assert said.endswith("does the hand hide it?")


@pytest.mark.parametrize("hidden", [False, True])
def test_in_a_large_film_it_is_as_alike_as_in_a_small_one(hidden):
    """Four times as many pixels either way, of which a patch is as large a part."""
    frames, tracks = filmed((TIMES > TOUCH) & hidden)
    large = replace(tracks, tip=4 * tracks.tip, object=4 * tracks.object, side=400)
    found = alike(frames.repeat(4, axis=1).repeat(4, axis=2), large, TOUCH, THERE)
    assert found == pytest.approx(alike(frames, tracks, TOUCH, THERE), abs=0.05)


def test_a_square_at_the_edge_is_moved_into_the_frame_whole():
    frame = np.arange(20 * 30 * 3).reshape(20, 30, 3)
    for place, (top, left) in {(0, 0): (0, 0), (29, 19): (7, 17), (31, 3): (0, 17),
                               (12, 9): (3, 6)}.items():  # fmt: skip
        square = _cut(frame, np.array(place, float), 6)
        np.testing.assert_array_equal(square, frame[top : top + 13, left : left + 13])


@pytest.mark.parametrize(("share", "hides"), [(0.3, False), (0.7, True)])
def test_half_of_its_way_counts(share, hides):
    frames, tracks = filmed((TIMES > TOUCH) & (share > (TIMES - TOUCH) / (THERE - TOUCH)))
    assert (alike(frames, tracks, TOUCH, THERE) < 0.45) == hides


def test_a_place_that_is_off_by_a_few_pixels_is_looked_for():
    frames, tracks = filmed(np.zeros(T, bool), shown=PLACES + (4, -3) * (TIMES > TOUCH)[:, None])
    assert alike(frames, tracks, TOUCH, THERE) > 0.9


def test_its_look_is_taken_while_the_hand_is_away():
    """In the first half second a hand is before it; it is seen with the hand gone farther."""
    early = TIMES < 0.5
    tip = np.where(early[:, None], PLACES, FAR)
    frames, tracks = filmed(early, tip)
    assert alike(frames, tracks, TOUCH, THERE) > 0.9


def test_the_take_before_a_cut_does_not_count():
    early = TIMES < 0.5
    tip = np.where(early[:, None], FAR - (9, 0), FAR)
    for cuts, same in (((), False), ((5,), True)):
        frames, tracks = filmed(early, tip, cuts)
        assert (alike(frames, tracks, TOUCH, THERE) > 0.9) == same


def test_what_was_not_seen_before_and_a_narrow_picture_are_not_asked():
    frames, tracks = filmed(TIMES > TOUCH)
    tracks.object_sure[TIMES <= TOUCH] = 0
    assert alike(frames, tracks, TOUCH, THERE) == 1
    frames, tracks = filmed(TIMES > TOUCH)
    assert alike(frames[:, 39:61], tracks, TOUCH, THERE) == 1
