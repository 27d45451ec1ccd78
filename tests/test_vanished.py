"""What has left its place, by squares before a wall of 160x120 pixels, which no frame shrinks."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from lbw_minimal.clips import vanished
from lbw_minimal.clips.detector import Found
from lbw_minimal.clips.patches import Path, of_hand
from lbw_minimal.clips.paths import Unusable

N, LEAVES, THERE = 48, 12, 24  # frames: in all, and between which the thing moves
COMES = 6  # frame in which a hand comes before the thing that it hides
RNG = np.random.default_rng(0)
WALL = cv2.GaussianBlur(RNG.integers(60, 120, (120, 160, 3)).astype(np.uint8), (0, 0), 4)
THING = np.full((14, 14, 3), (220, 60, 30), np.uint8)
THING[3:7, 3:11] = (20, 40, 160)
HAND = np.full((30, 30, 3), (200, 160, 140), np.uint8)
WAY = np.interp(np.arange(N), [LEAVES, THERE], [60, 100]).round().astype(int)


def put(frame, what, x, y):
    frame[y : y + len(what), x : x + what.shape[1]] = what


def film(x=WAY, thing=THING, hides=lambda t: False, also=None):
    """A thing whose left edge is at x, 70 down; `hides`: in which frames a hand is before it."""
    frames = np.repeat(WALL[None], N, 0)
    for t, frame in enumerate(frames):
        if also is not None:
            put(frame, THING, *also)
        put(frame, thing, x[t], 70)
        if hides(t):
            put(frame, HAND, x[t] - 8, 62)
    return frames


def test_a_thing_that_has_left_its_place_is_found_where_it_went():
    thing = vanished.vanished(film())
    middle = np.stack([WAY + 7, np.full(N, 77)], 1)
    assert thing.frames.tolist() == list(range(N)) and thing.scale == 1
    assert LEAVES < thing.left < THERE and (thing.alike[: thing.left] == 1).all()
    late = slice(LEAVES + 8, N)  # half of it is off its place
    assert np.abs(thing.places - middle)[late].max() <= 1.5 and thing.alike[late].min() > 0.85
    assert np.abs(thing.places[: thing.left] - middle[0]).max() <= 1.5


def test_places_are_those_of_the_small_frames():
    large = np.stack([cv2.resize(frame, (320, 240)) for frame in film()])
    thing = vanished.vanished(large)
    assert thing.scale == 0.5 and np.abs(thing.places[-1] - (107, 77)).max() <= 1.5


@pytest.mark.parametrize(
    ("thing", "told"),
    [
        (THING, True),
        (THING[:4, :4], False),  # 16 pixels
        (np.repeat(np.repeat(THING, 2, 0), 2, 1), True),  # 28 wide
        (np.tile(THING, (1, 3, 1)), False),  # 42 wide
    ],
    ids=["14x14", "4x4", "28x28", "42x14"],
)
def test_a_thing_has_the_size_of_one(thing, told):
    x = np.where(np.arange(N) < LEAVES, 40, 100)
    assert (vanished.vanished(film(x, thing)) is not None) == told


def test_what_has_come_or_reaches_over_an_edge_or_stays_has_not_left():
    assert vanished.vanished(film(np.where(np.arange(N) < LEAVES, 0, 60))) is None
    assert vanished.vanished(film(np.full(N, 60))) is None
    come = film()
    come[:LEAVES] = WALL
    assert vanished.vanished(come) is None


TIP = np.tile([20.0, 20.0], (N, 1))


def seen(frames, tip=TIP, sure=0.9):
    vanished.check_seen(vanished.vanished(frames), tip, np.broadcast_to(sure, N))


def test_a_thing_that_is_seen_nowhere_from_then_on_is_hidden():
    seen(film())
    for other in (None, (20, 20)):  # its like that stood there all along is another thing
        with pytest.raises(Unusable, match="hides the object, which is gone from its place"):
            seen(film(hides=lambda t: t >= COMES, also=other))


@pytest.mark.parametrize("place", [(-25, 0), (8, 0), (0, -25), (0, 8)])
def test_a_thing_of_which_a_hand_covers_a_half_is_in_sight(place):
    clip = film()
    for t in range(LEAVES + 1, N):
        x, y = place
        put(clip[t], HAND, WAY[t] + x, 70 + y)
    seen(clip)


@pytest.mark.parametrize(("frames", "hidden"), [(7, True), (14, False)])
def test_a_thing_is_in_sight_if_it_is_so_in_a_quarter_of_the_frames(frames, hidden):
    """Of 42, from when the hand comes."""
    clip = film(hides=lambda t: COMES <= t < N - frames)
    clip[-3:] = clip[-4]
    if hidden:
        with pytest.raises(Unusable, match="seen nowhere else"):
            seen(clip)
    else:
        seen(clip)


@pytest.mark.parametrize(("frames", "hidden"), [(5, False), (6, True)])
def test_a_hand_has_come_to_the_place_and_left_the_ground(frames, hidden):
    """A hand that was there first, and what an arm covers in the end, are no hidden things."""
    gone = np.repeat(WALL[None], N, 0)
    for t in range(COMES + frames):
        put(gone[t], HAND if t >= COMES else THING, 60, 70)
    if hidden:
        with pytest.raises(Unusable, match="seen nowhere else"):
            seen(gone)
    else:
        seen(gone)
    covered = film(np.full(N, 60))
    covered[30:, 62:92, 52:82] = HAND
    seen(covered)


@pytest.mark.parametrize(("frames", "hidden"), [(3, False), (4, True)])
def test_a_hand_that_covers_most_of_a_thing_before_that_goes_hides_it(frames, hidden):
    """Its left edge stays in sight all along, and so is found; it is near its place for two frames
    more."""
    clip = film()
    for t in range(LEAVES - frames, N):
        put(clip[t], HAND, WAY[t] + 6, 62)
    thing = vanished.vanished(clip)
    assert (thing.unlike() <= vanished.UNLIKE).mean() >= vanished.OFTEN
    if hidden:
        with pytest.raises(Unusable, match="hides most of the object before that goes"):
            seen(clip)
    else:
        seen(clip)


def test_an_arm_that_stays_where_a_thing_was_does_not_hide_it():
    """Though that place then looks most like it: it has gone before, out of the picture."""
    x = np.interp(np.arange(N), [LEAVES, THERE], [60, 160]).round().astype(int)
    clip = np.stack([np.pad(WALL, ((0, 0), (0, 20), (0, 0)))] * N)
    for t, frame in enumerate(clip):
        put(frame, THING, min(x[t], 150), 70)
    clip = np.ascontiguousarray(clip[:, :, :160])
    for t in range(LEAVES + 5, N - 4):
        put(clip[t], HAND, 50, 62)
        put(clip[t], THING[:, :5], 60, 70)
    seen(clip)


def test_what_stands_in_the_last_frame_has_not_left():
    """A film that runs in a loop ends with the picture it begins with."""
    loop = film()
    loop[-1] = loop[0]
    assert vanished.vanished(film()) is not None and vanished.vanished(loop) is None


def test_what_stood_where_the_hand_was_first_is_the_hand():
    gone = film(hides=lambda t: t >= COMES)
    place = vanished.vanished(gone).places[0]
    for apart, raised in ((15, False), (17, True)):
        tip = np.tile(place - (apart, 0), (N, 1))
        tip[1:] = 20  # later it is elsewhere
        if raised:
            with pytest.raises(Unusable, match="seen nowhere else"):
                seen(gone, tip)
        else:
            seen(gone, tip)
            with pytest.raises(Unusable, match="seen nowhere else"):  # not where it is unsure
                seen(gone, tip, np.where(np.arange(N) < 1, 0.4, 0.9))
    seen(gone, sure=0.4)


def found(x, y=77.0):
    """A hand that comes to the thing while it rests, and an object."""
    tip = np.stack([np.interp(np.arange(N), [0, LEAVES, THERE], [10, 55, 95]), np.full(N, 77)], 1)
    return Found(tip, np.stack([x, np.broadcast_to(y, N)], 1), np.full(N, 0.9), np.full(N, 0.7))


def followed(frames, found):
    return vanished.followed(vanished.vanished(frames), frames, found)


def test_a_thing_that_is_pushed_from_its_place_is_the_object():
    before = found(WAY + 7.0, 40)
    told = followed(film(), before)
    assert np.abs(told.object - np.stack([WAY + 7, np.full(N, 77)], 1))[LEAVES + 8 :].max() <= 1.5
    assert told.object_sure.min() > 0.5 and told.tip is before.tip


def test_a_thing_that_is_followed_is_as_sure_as_it_is_like_itself():
    thing = vanished.vanished(film())
    alike = np.full(N, 0.8)
    alike[:2] = 1.0, 0.1
    told = vanished.followed(thing._replace(alike=alike), film(), found(WAY + 7.0, 40))
    assert told.object_sure == pytest.approx(np.array([1, 0, *[0.75] * (N - 2)]))


def test_the_detector_is_believed_where_it_agrees_and_where_the_thing_is_not_pushed_or_hidden():
    agrees = found(WAY + 9.0)
    assert followed(film(), agrees) is agrees
    off = found(WAY + 13.0)  # six pixels beside it
    assert followed(film(), off) is not off
    hidden = film(hides=lambda t: t >= COMES)
    assert followed(hidden, off) is off
    swings = film((WAY + 20 * np.sin(np.arange(N))).astype(int))
    assert followed(swings, off) is off
    assert followed(film(np.full(N, 60)), off) is off


def test_an_object_that_stays_where_a_thing_has_left_is_that_thing_however_it_went():
    """A lifted one: it does not go as a pushed one does, and is less like itself in the air."""
    swings = 20 * np.sin(np.maximum(0, np.arange(N) - LEAVES))
    lifted = film((WAY + swings).astype(int))
    stays = found(np.full(N, 67.0))
    told = followed(lifted, stays)
    assert np.ptp(told.object, axis=0).max() > 40 and told.tip is stays.tip
    leaves = found(67.0 + np.linspace(0, 8, N))  # by more than 0.06 of 120 pixels
    assert followed(lifted, leaves) is leaves
    hidden = film(hides=lambda t: t >= COMES)
    assert followed(hidden, stays) is stays


def test_an_object_that_stays_elsewhere_is_not_what_the_hand_takes():
    swings = 20 * np.sin(np.maximum(0, np.arange(N) - LEAVES))
    lifted = film((WAY + swings).astype(int))
    stays = found(np.full(N, 100.0), 20)
    told = followed(lifted, stays)
    assert np.ptp(told.object, axis=0).max() > 40 and abs(told.object[0, 0] - 67) < 2
    leaves = found(100.0 + np.linspace(0, 8, N), 20)
    assert followed(lifted, leaves) is leaves
    far = replace(stays, tip=stays.tip - (8, 0))  # 20 pixels from the thing as that leaves
    assert followed(lifted, far) is far
    along = np.interp(np.arange(N), [LEAVES, N - 1], [62, 160])
    goes = replace(stays, tip=np.stack([along, np.full(N, 77)], 1))
    assert followed(lifted, goes) is goes  # as soon as the hand: it is a piece of that


def test_what_stays_as_far_from_the_tip_and_comes_down_with_it_is_a_piece_of_the_hand():
    """It goes down by half of its way across; by how much of its way the hand comes nearer."""
    down = 0.5 * (WAY - WAY[0])
    for nearer, hand in ((0, True), (0.2, True), (0.3, False), (1, False)):
        comes = np.interp(np.arange(N), [0, THERE], [1, 0])
        apart = comes * nearer * np.hypot(np.ptp(WAY), np.ptp(down))
        places = np.stack([WAY + 7.0, 40 + down], 1)
        tip = places - np.stack([12 + apart, 0 * apart], 1)
        path = Path(places, np.ones(N), tip, 120)
        assert path.of_hand == hand
        assert of_hand(Found(tip, places, np.ones(N), np.ones(N)), 120) == hand
    assert not replace(path, tip=None).of_hand


def test_a_piece_of_the_hand_that_has_left_its_place_is_not_followed(monkeypatch):
    off = found(WAY + 13.0)
    assert followed(film(), off) is not off
    monkeypatch.setattr(vanished, "Path", lambda *what: replace(Path(*what), tip=None))
    monkeypatch.setattr(Path, "of_hand", True)
    assert followed(film(), off) is off
