"""Whether a path is an object's, by hand: ways of ten steps, and maps with two peaks."""

from dataclasses import replace

import numpy as np
import pytest

from lbw_minimal.clips import patches
from lbw_minimal.clips.detector import Found
from lbw_minimal.clips.patches import Path, chosen

SIDE = 100  # pixels, so that a share is a percentage


def path(x, alike=1.0, tip=None, y=0.0):
    """A patch's way along x, as like itself as `alike`, beside a tip that goes along x, too."""
    x = np.asarray(x, float)
    hand = None if tip is None else np.stack([np.asarray(tip, float), 0 * x], 1)
    return Path(np.stack([x, y + 0 * x], 1), np.broadcast_to(alike, x.shape), hand, SIDE)


def test_a_patch_is_seen_if_it_is_like_itself_in_two_fifths_of_the_frames():
    alike = np.where(np.arange(10) < 4, 0.61, 0.59)
    assert path(np.arange(10), alike).seen
    assert not path(np.arange(10), np.where(np.arange(10) < 3, 0.61, 0.59)).seen


def test_a_way_is_the_farthest_apart_that_places_are_without_single_glitches():
    x = [0, 0, 30, 0, 0, 10, 20, 20, 20, 20]
    assert path(x).way == pytest.approx(0.2)
    assert replace(path(x), side=50).way == pytest.approx(0.4)


def test_a_patch_has_started_when_a_tenth_of_its_way_is_gone():
    assert path([0, 0, 0, 1, 2, 2.1, 12, 20, 20, 20]).start == 5


def test_an_object_waits_for_a_share_of_the_tips_way_or_of_the_frames():
    x = [0, 0, 0, 0, 0, 4, 12, 20, 20, 20]
    tip = [0, 10, 20, 30, 30, 30, 40, 50, 50, 50]
    assert path(x).alone == pytest.approx(5 / 10)
    assert path(x, tip=tip).alone == pytest.approx(30 / 50)
    assert path(x, tip=[7] * 10).alone == 0  # a tip that rests has gone no share of its way


WAITS = [0, 0, 0, 0, 4, 8, 12, 16, 20, 20]
THERE = [0, 5, 10, 15, 20]
COMES = [-60, -40, -20, -10, -6, -2, 2, 6, 10, 10]
FLIES = [-30, -20, -10, 0, 0, 80, 90, 95, 99, 99]  # away as soon as the object moves
SNAPS = [-90, -80, -70, -60, -60, -2, 2, 6, 10, 10]  # comes when it has begun to


@pytest.mark.parametrize(
    ("x", "tip", "is_it"),
    [
        (WAITS, COMES, True),
        (np.multiply(WAITS, 0.25), COMES, False),  # 5 % of the side
        (np.multiply(WAITS, 0.45), COMES, True),  # 9 %
        (np.add(WAITS, 35), COMES, False),  # the hand is 45 % of the side away when it starts
        (np.add(WAITS, 25), COMES, True),
        (WAITS, FLIES, True),
        (WAITS, SNAPS, False),
        ([0, 0, 0, 0, 4, 8, 17.5, 18, 20, 20], COMES, False),  # 9.5 of 20 at once
        ([0, 0, 0, 0, 4, 8, 15.5, 18, 20, 20], COMES, True),  # 7.5 of 20
        ([0, 0, 0, 0, *THERE, *THERE[::-1], *THERE], None, True),  # 3 times its way
        ([0, 0, 0, 0, *THERE, *THERE[::-1], *THERE, *THERE[::-1]], None, False),  # 4 times
    ],
)
def test_an_object_waits_for_a_hand_that_is_near_and_goes_once_and_evenly(x, tip, is_it):
    assert path(x, tip=tip).pushed == is_it


def test_a_piece_of_the_hand_moves_within_a_seventh_of_the_tips_way():
    tip = np.arange(20.0) * 5
    sleeve, box = (np.interp(np.arange(20), [n, 19], [0, 40]) for n in (0, 4))
    assert not path(sleeve, tip=tip).pushed and path(box, tip=tip).pushed


def test_two_patches_agree_if_they_go_four_pixels_alike_wherever_they_are():
    own = path(WAITS)
    assert own.agrees(path(np.add(WAITS, 50), y=30), 1.0)
    off = np.array(WAITS, float)
    off[4] += 3.9
    off[5] += 4.1
    assert own.beside(path(off)).tolist() == [t != 5 for t in range(10)]
    assert own.agrees(path(off), 0.9) and not own.agrees(path(off), 0.91)


def test_the_worth_is_of_what_is_seen_and_of_up_to_three_tenths_of_waiting():
    half = path(WAITS, np.where(np.arange(10) < 5, 1.0, 0.5))
    assert half.worth == pytest.approx(0.5 + 0.5 * 0.75 + 0.3)
    assert path(np.arange(10)).worth == pytest.approx(1 + 0.5 + 0.1)


def test_of_pushed_patches_the_worthier_is_taken_and_of_resting_ones_only_where_most_rest():
    better, worse = path(WAITS), path(WAITS, 0.8)
    assert chosen([worse, better, worse]) is better
    rests = [path(np.zeros(10), alike) for alike in (0.7, 0.9, 0.8)]
    sways = path(np.tile([0, 10], 5).repeat(2))  # to and fro, and so neither
    assert chosen([*rests, sways]) is rests[1]
    assert chosen([*rests[:2], sways, sways]) is None
    unseen = path(WAITS, 0.1)
    assert chosen([unseen, unseen]) is None


def test_the_tip_is_known_where_it_is_seen_in_two_fifths_of_the_frames():
    t = np.arange(10.0)
    tip = np.stack([10 * t, 5 * t], 1)
    tip[1] = 99  # not sure, and so between its neighbours

    def found(sure):
        return Found(tip, tip, np.where(np.isin(t, sure), 1.0, 0.0), np.ones(10))

    k = np.array([0, 1, 2])
    np.testing.assert_allclose(
        patches.tip_at(found([0, 2, 3, 9]), k, 0.5), 0.5 * np.array([(0, 0), (10, 5), (20, 10)])
    )
    assert patches.tip_at(found([0, 2, 3]), k, 0.5) is None


def test_what_has_gone_or_come_in_the_end_is_of_a_things_size_and_the_largest_comes_first():
    """Squares of 4, 6, 10 and 40 pixels that stand in the first frames and not in the last."""
    gone = np.full((32, 100, 120, 3), 90, np.uint8)
    for left, side in ((2, 4), (12, 6), (30, 10), (60, 40)):
        gone[:16, 20 : 20 + side, left : left + side, 0] = 90 + 30
    gone[:16, 80:90, 5:15] = 90 + 20  # as faint as a shadow
    np.testing.assert_allclose(patches._changed(list(gone)), [(34.5, 24.5), (14.5, 22.5)])
    np.testing.assert_allclose(patches._changed(list(gone[::-1])), [(34.5, 24.5), (14.5, 22.5)])


def test_patches_are_cut_from_seven_frames_that_surely_show_an_object():
    k = np.arange(0, 40, 2)
    sure = np.where(np.arange(40) >= 10, 1.0, 0.2)
    places = np.stack([np.arange(40.0), np.full(40, 8.0)], 1)
    found = Found(places, places, sure, sure)
    seen = patches._seen(found, k, 0.5)
    assert len(seen) == 7
    assert [i for i, _ in seen][::6] == [5, 19]  # the first and the last of those
    np.testing.assert_allclose(seen[0][1], [5, 4])


def test_peaks_are_the_highest_and_five_pixels_apart():
    alike = np.zeros((60, 60), np.float32)
    alike[20, 30], alike[20, 33], alike[50, 5], alike[20, 35] = 1.0, 0.9, 0.8, 0.7
    places, heights = patches._peaks(alike)
    assert places[:3].tolist() == [[30, 20], [5, 50], [35, 20]]
    np.testing.assert_allclose(heights[:3], [1.0, 0.8, 0.7])
    assert len(places) == 10 and alike[20, 30] == 1  # the map itself stays


def test_a_patch_that_turns_back_is_followed_in_the_order_of_its_frames():
    """The best place is the first peak in the first frame and another one in the last."""
    rng = np.random.default_rng(0)
    look = rng.integers(0, 255, (13, 13, 3), dtype=np.uint8)
    x, small = [20, 20, 20, 22, 26, 30, 34, 38], []
    for t, left in enumerate(x):
        frame = np.full((80, 120, 3), 128, np.uint8)
        if t > 4:  # a copy, farther than it leaps and as alike
            frame[60:73, 100:113] = look
        frame[30:43, left : left + 13] = np.where(t > 4, 0.9, 1) * look
        small.append(frame.astype(np.uint8))
    way = patches._path(small, small[0][30:43, 20:33], None)
    np.testing.assert_allclose(way.places[:, 0], np.array(x) + 6.5, atol=0.51)
    np.testing.assert_allclose(way.places[:, 1], 36.5, atol=0.51)


def test_a_patch_goes_the_way_on_which_it_is_alike_without_leaping():
    """A square moves on evenly. In one frame a copy of it is far off, and its own is dimmed."""
    rng = np.random.default_rng(0)
    look = rng.integers(0, 255, (13, 13, 3), dtype=np.uint8)
    small = []
    for t in range(9):
        frame = np.full((80, 120, 3), 128, np.uint8)
        frame[30:43, 20 + 6 * t : 33 + 6 * t] = look
        if t == 4:
            frame[30:43, 44:57] = 0.6 * look + 0.4 * rng.integers(0, 255, look.shape)
            frame[60:73, 100:113] = look
        small.append(frame)
    way = patches._path(small, small[0][30:43, 20:33], None)
    np.testing.assert_allclose(way.places[:, 0], 26.5 + 6 * np.arange(9), atol=0.51)
    assert way.alike[0] > 0.99 and way.alike[4] < 0.95 and way.side == 80


def test_patches_at_the_pictures_edge_are_as_large_as_elsewhere(monkeypatch):
    """Of corners of the picture and beyond them: 13 and 19 pixels, whole."""
    cut = []
    monkeypatch.setattr(patches, "_path", lambda small, patch, tip: cut.append(patch.shape[:2]))
    frame = np.random.default_rng(0).integers(0, 255, (90, 120, 3), dtype=np.uint8)
    places = [(0, np.array(at, float)) for at in ((0, 0), (119, 89), (200, -5), (60, 45))]
    patches.paths([frame, frame], places, None)
    assert cut == 4 * [(13, 13), (19, 19)]


def test_of_five_things_that_are_gone_the_four_largest_are_looked_at():
    gone = np.full((32, 100, 160, 3), 90, np.uint8)
    for left, side in ((5, 8), (30, 10), (60, 12), (90, 14), (120, 16)):
        gone[:16, 20 : 20 + side, left : left + side] = 200
    middles = [at[0] for at in patches._changed(list(gone))]
    np.testing.assert_allclose(middles, [127.5, 96.5, 65.5, 34.5])


def test_what_is_gone_is_told_by_a_sixteenth_of_the_frames_at_each_end():
    """Of 32 frames two: a hand that is there in one of them is not what the place looks like."""
    stands = np.full((32, 100, 120, 3), 90, np.uint8)
    stands[2:, 20:30, 30:40] = 200
    assert len(patches._changed(list(stands))) == 1
    stands[2:, 20:30, 30:40] = 90
    stands[1, 20:30, 30:40] = 106  # half of it, in a median of two
    assert patches._changed(list(stands)) == []


@pytest.mark.parametrize(("deviation", "looked_at"), [(1.9, 0), (2.1, 2)])
def test_a_patch_in_which_nothing_is_seen_is_not_looked_for(deviation, looked_at, monkeypatch):
    monkeypatch.setattr(patches, "_path", lambda small, patch, tip: patch)
    frame = np.full((80, 120, 3), 100.0)
    frame[:, ::2] += deviation
    frame[:, 1::2] -= deviation
    assert len(patches.paths([frame], [(0, np.array([60.0, 40.0]))], None)) == looked_at


def mended_by(monkeypatch, best, frames, found):
    """What `mended` makes of a patch of that path, and what it was asked for."""
    asked = []
    monkeypatch.setattr(patches, "paths", lambda small, places, tip: asked.append(small) or [])
    monkeypatch.setattr(patches, "chosen", lambda some: best)
    return patches.mended(frames, found)[0], asked[0]


def test_patches_are_looked_for_in_48_frames_of_160_pixels_and_come_back_in_the_clips(monkeypatch):
    """A clip of 95 frames of 320 x 240: every second one, at half of the size. A patch that is
    just alike is just sure, and one that is wholly alike wholly."""
    way = np.stack([np.linspace(20, 67, 48), np.full(48, 50.0)], 1)
    alike = np.repeat([1.0, 0.6, 0.2, -0.5], [16, 16, 15, 1])
    best = Path(way, alike, None, 120)
    nowhere = Found(*np.zeros((2, 95, 2)), *np.zeros((2, 95)))
    frames = np.zeros((95, 240, 320, 3), np.uint8)
    mend, small = mended_by(monkeypatch, best, frames, nowhere)
    assert len(small) == 48 and small[0].shape == (120, 160, 3)
    np.testing.assert_allclose(mend.object[:, 0], 40 + np.arange(95))
    np.testing.assert_allclose(mend.object[:, 1], 100)
    np.testing.assert_allclose(mend.object_sure[[0, 40, 92, 94]], [1, 0.5, 0, 0], atol=1e-9)
    assert not mend.tip_sure.any() and not mend.tip.any()


@pytest.mark.parametrize(("apart", "patchs"), [(3, False), (5, True)])
def test_a_path_that_the_patch_only_repeats_stays_as_it_was_found(apart, patchs, monkeypatch):
    """Unlike it in a fifth of the frames; nobody says where the hand is."""
    x = np.linspace(20, 60, 40)
    own = np.stack([x, np.full(40, 50.0)], 1)
    other = own + (0, 1) * (apart * (np.arange(40) < 8))[:, None]
    found = Found(0 * own, own, np.zeros(40), np.ones(40))
    best = Path(other, np.ones(40), None, 120)
    mend, _ = mended_by(monkeypatch, best, np.zeros((40, 120, 160, 3), np.uint8), found)
    np.testing.assert_allclose(mend.object, other if patchs else own)


@pytest.mark.parametrize(("side", "looked_for"), [(27, 0), (28, 2)])
def test_a_picture_three_patches_high_is_too_small_for_any(side, looked_for, monkeypatch):
    monkeypatch.setattr(patches, "_path", lambda small, patch, tip: patch)
    frame = np.random.default_rng(0).integers(0, 255, (side, 120, 3), dtype=np.uint8)
    assert len(patches.paths([frame], [(0, np.array([60.0, 14.0]))], None)) == looked_for


def test_no_patch_is_looked_for_where_the_detectors_own_path_is_an_objects(monkeypatch):
    """And one is where it sways, in the same shot of another clip."""
    waits = np.interp(np.arange(40), [20, 35], [40, 90])
    sways = 60 - 20 * np.cos(0.7 * np.arange(40))
    for x, looked_for in ((waits, False), (sways, True)):
        asked = []
        monkeypatch.setattr(patches, "paths", lambda *what, to=asked: to.append(what) or [])
        own = np.stack([x, np.full(40, 50.0)], 1)
        found = Found(0 * own, own, np.zeros(40), np.ones(40))
        mend, pushed = patches.mended(np.zeros((40, 120, 160, 3), np.uint8), found)
        assert bool(asked) == looked_for and (mend.object == own).all()
        assert pushed != looked_for
