"""What moves and where a film jumps, on pictures of a few shapes whose motion is known."""

import cv2
import numpy as np
import pytest

from lbw_minimal.clips import motion
from lbw_minimal.clips.motion import before_background, differs, high_pass, jumps, moves, told


def ground(side=84, seed=0):
    rough = np.random.default_rng(seed).integers(60, 180, (12, 12, 3), np.uint8)
    return cv2.resize(rough, (side, side), interpolation=cv2.INTER_CUBIC)


def film(x, size=10, side=84, level=240):
    """A bright square that goes along x before a still ground."""
    frames = np.repeat(ground(side)[None], len(x), axis=0)
    for frame, left in zip(frames, np.rint(x).astype(int), strict=True):
        frame[40 : 40 + size, left : left + size] = level
    return frames


def test_an_even_change_of_light_is_no_motion():
    frames = film(np.full(3, 20.0))
    brighter = np.clip(frames + np.array([0, 20, 40])[:, None, None, None], 0, 255).astype(np.uint8)
    passed = high_pass(brighter)
    assert np.abs(passed.mean(axis=(1, 2))).max() < 1
    assert (np.abs(passed[1] - passed[0]) > 4).mean() < 0.02
    assert not differs(passed[0], passed[2])


def test_motion_is_35_pixels_that_change_by_more_than_16_grey_levels_up_or_down():
    still = np.zeros((84, 84), np.float32)
    for level, pixels, moved in ((17, 36, 1), (17, 35, 0), (15, 400, 0), (-17, 36, 1)):
        other = still.copy()
        other.reshape(-1)[:pixels] = level
        assert differs(still, other) == differs(other, still) == bool(moved), (level, pixels)


def test_the_background_is_what_most_frames_show():
    x = np.r_[np.full(6, 10.0), np.full(15, 50.0)]
    still, background, moving = before_background(film(x))
    assert moving and np.abs(still[-1] - background).max() < 1e-3
    assert differs(still[0], background)
    assert not moves(film(np.full(9, 30.0))) and moves(film(np.linspace(10, 30, 9)))


def test_at_most_sixty_frames_are_looked_at_from_first_to_last():
    some = motion.some(np.arange(200))
    assert len(some) == 60 and (some[0], some[-1]) == (0, 199)
    assert len(motion.some(np.arange(20))) == 20


def test_a_frame_is_told_from_the_last_that_was_however_slowly_a_thing_moves():
    """A square of 10 pixels goes a pixel a frame. One step changes 20 pixels enough, two 40."""
    frames = np.full((6, 84, 84, 3), 60, np.uint8)
    for t, x in enumerate([20, 21, 22, 23, 23, 23]):
        frames[t, 40:50, x : x + 10] = 106
    assert told(frames).tolist() == [0, 2]
    assert told(frames[:1]).tolist() == [0]


def test_an_even_motion_has_no_jump_and_one_that_leaves_a_piece_out_has_one():
    """Two pixels a frame; then it is 40 pixels further on at once."""
    x = 8.0 + 1.0 * np.arange(40)
    times = np.arange(40) / 25
    assert jumps(film(x, side=112), times) == []
    x[20:] += 40
    assert jumps(film(x, side=112), times) == [20]


def test_another_scene_is_a_jump_and_so_is_the_way_back():
    one, other = film(np.linspace(10, 30, 20)), np.repeat(ground(seed=5)[None], 8, axis=0)
    both = np.concatenate([one[:10], other, one[10:]])
    assert jumps(both, np.arange(28) / 25) == [10, 18]


def test_a_gap_of_half_a_second_is_a_jump_only_where_something_changed():
    times = np.arange(20) / 25
    times[10:] += 0.6
    x = np.full(20, 30.0)
    assert jumps(film(x, side=112), times) == []
    x[10:] = 50
    assert jumps(film(x, side=112), times) == [10]
    # Two frames a second are a slow camera's usual pace, and a gap of 0.3 s is short.
    slow = 30 + 2.0 * np.arange(8)
    assert jumps(film(slow, side=112), 0.6 * np.arange(8)) == []
    times[10:] -= 0.3
    even = 30.0 + np.arange(20)
    assert jumps(film(even, side=112), times) == []


@pytest.mark.parametrize(
    ("beside", "leap", "at_once"),
    [(0, 40, True), (0, 2, False), (4, 40, True), (20, 35, False), (20, 0, False)],
    ids=["at rest", "hardly", "moving", "in a hit", "as before"],
)
@pytest.mark.parametrize("t", [1, 5, 9])
def test_a_jump_changes_far_more_at_once_than_what_moves_just_before_and_after(
    beside, leap, at_once, t
):
    """A square of 20 pixels, that goes on by so many in each frame and by more in one."""
    x = 5.0 + np.cumsum(np.where(np.arange(10) == t, leap, 0))
    near = np.isin(np.arange(10), [t - 1, t + 1]) & (np.arange(10) > 0)
    x += np.cumsum(np.where(near, beside, 0))
    frames = np.full((10, 84, 150, 3), 60, np.uint8)
    for frame, at in zip(frames, x.astype(int), strict=True):
        frame[40:60, at : at + 20] = 200
    assert motion._at_once(frames, t) == at_once


def test_the_first_four_grey_levels_of_a_change_do_not_count():
    assert motion._strong(np.array([[4.0, -4.0], [6.0, -9.0]])) == pytest.approx((2 + 5) / 4)


def test_flow_explains_what_only_moved():
    """A square on its way leaves next to nothing; one that appears leaves all of its change."""
    size = 112, 112
    change, residual = motion._unexplained(film([30.0, 33, 36], size=30, side=112), size)
    assert (residual < 0.35 * change).all() and (change > 0.5).all()
    there = film([30.0, 30], size=30, side=112)
    there[0] = ground(112)
    change, residual = motion._unexplained(there, size)
    assert residual[0] > 0.5 * change[0] > 0.5


def test_fewer_than_three_frames_have_no_jump():
    assert jumps(film([10.0, 60.0]), np.array([0, 3.0])) == []


def test_a_flat_picture_is_looked_at_at_a_height_of_eight_pixels(monkeypatch):
    sizes = []
    rest = np.zeros(2)
    monkeypatch.setattr(motion, "_unexplained", lambda f, size: sizes.append(size) or (rest, rest))
    jumps(np.zeros((3, 4, 400, 3), np.uint8), np.arange(3.0) / 25)
    assert sizes == [(motion.WIDTH, 8)]


@pytest.mark.parametrize(
    ("rate", "times", "jumped"),
    [(25, 3.2, False), (25, 3.4, True), (10, 4.3, False), (10, 4.5, True)],
)
def test_a_jump_is_three_times_what_is_usual_nearby_and_more_where_frames_are_far_apart(
    rate, times, jumped, monkeypatch
):
    """One grey level before and after, and 0.1 more: 3.3 of them; at 10 a second four thirds."""
    rest = np.zeros(40)
    rest[[17, 18, 22, 23]], rest[20] = 1.0, times
    monkeypatch.setattr(motion, "_unexplained", lambda frames, size: (rest, rest))
    monkeypatch.setattr(motion, "_at_once", lambda frames, t: True)
    frames = np.zeros((41, 84, 84, 3), np.uint8)
    assert jumps(frames, np.arange(41) / rate) == ([21] if jumped else [])


def test_what_noise_does_everywhere_is_no_motion(monkeypatch):
    """Five grey levels more in every frame: the tenth part that changes least says how much."""
    rest = np.zeros(40)
    rest[[17, 18, 22, 23]], rest[20] = 1.0, 3.4
    frames = np.zeros((41, 84, 84, 3), np.uint8)
    monkeypatch.setattr(motion, "_at_once", lambda frames, t: True)
    for noise in (0, 5):
        monkeypatch.setattr(motion, "_unexplained", lambda *_, n=noise: (rest + n, rest + n))
        assert jumps(frames, np.arange(41) / 25) == [21]
    monkeypatch.setattr(motion, "_at_once", lambda frames, t: True)
    monkeypatch.setattr(motion, "_unexplained", lambda *_: (0 * rest + 5, 0 * rest + 5))
    late = np.arange(41) / 25 + 2 * (np.arange(41) > 30)  # a pause in which nothing changed
    assert jumps(frames, late) == []


def test_a_jump_is_looked_for_without_what_a_sixth_of_the_picture_shares(monkeypatch):
    windows = []
    monkeypatch.setattr(motion.cv2, "blur", lambda grey, window: windows.append(window) or 0 * grey)
    motion._unexplained(film([20, 22]), (112, 112))
    (across, down), _ = windows
    assert across == down and across % 2 and across / 112 == pytest.approx(1 / 6, abs=0.02)


@pytest.mark.parametrize(
    ("rate", "at", "jumped"), [(25, 6, False), (25, 7, True), (5, 2, False), (5, 3, True)]
)
def test_what_is_usual_is_told_by_a_quarter_of_a_second_or_two_frames_on_each_side(
    rate, at, jumped, monkeypatch
):
    """As much of a change so many frames before and after it makes one no jump."""
    rest = np.zeros(40)
    rest[[20 - at, 20, 20 + at]] = 20.0
    monkeypatch.setattr(motion, "_unexplained", lambda frames, size: (rest, rest))
    monkeypatch.setattr(motion, "_at_once", lambda frames, t: True)
    found = jumps(np.zeros((41, 84, 84, 3), np.uint8), np.arange(41) / rate)
    assert (21 in found) == jumped


@pytest.mark.parametrize(
    ("level", "pause", "jumped"), [(0.29, 0, 0), (0.31, 0, 1), (0.09, 2, 0), (0.11, 2, 1)]
)
def test_a_change_of_a_tenth_of_a_level_is_noise(level, pause, jumped, monkeypatch):
    """Where all else stands it takes three times as much, or a pause in which it came about."""
    rest = np.zeros(40)
    rest[20] = level
    monkeypatch.setattr(motion, "_unexplained", lambda frames, size: (rest, rest))
    monkeypatch.setattr(motion, "_at_once", lambda frames, t: True)
    times = np.arange(41) / 25 + pause * (np.arange(41) > 20)
    assert jumps(np.zeros((41, 84, 84, 3), np.uint8), times) == [21] * jumped
