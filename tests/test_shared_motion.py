"""The motion that a picture shares, by hand: corners on a grid, and similarities that are known."""

import cv2
import numpy as np
import pytest

from lbw_minimal.clips import camera

H, W = 120, 240  # a cell is 20 pixels wide: a twelfth of the longer side
BEFORE = np.array([[1.0, 0, 7], [0, 1, 0], [0, 0, 1]])  # what was shared a moment ago
X, Y = np.meshgrid(np.arange(10, 230, 20.0), np.arange(10, 110, 20.0))
GRID = np.stack([X.ravel(), Y.ravel()], 1)  # a corner in each of 11 x 5 cells


def shared(here, there):
    return camera._shared(here, there, (H, W), BEFORE)


def test_the_motion_leads_from_where_corners_are_now_to_where_they_were():
    np.testing.assert_allclose(
        shared(GRID, GRID + (3, -2)), [[1, 0, -3], [0, 1, 2], [0, 0, 1]], atol=1e-6
    )
    larger = shared(GRID, 1.1 * GRID)
    np.testing.assert_allclose(larger, np.diag([1 / 1.1, 1 / 1.1, 1]), atol=1e-6)


def test_four_corners_tell_nothing_and_what_was_shared_before_goes_on():
    far_apart = GRID[[0, 10, 44, 54]]
    assert shared(far_apart, far_apart + 3) is BEFORE
    assert shared(GRID, GRID + 3) is not BEFORE


@pytest.mark.parametrize(("still", "stands"), [(17, False), (18, True)])
def test_a_camera_stands_if_half_as_many_cells_stand_as_move(still, stands):
    """Of 54 cells so many stay, and the others move: 37 or 36."""
    here = GRID[:-1]
    there = here + 4.0
    which = np.random.default_rng(0).permutation(len(here))[:still]
    there[which] = here[which]
    assert np.array_equal(shared(here, there), np.eye(3)) == stands


def test_a_striped_sleeve_has_one_vote_a_cell():
    """Four hundred corners stand in nine cells, where a caption is; 46 cells move."""
    caption = np.random.default_rng(0).uniform((0, 0), (60, 60), (400, 2))
    rest = GRID[(GRID > 60).any(1)]
    here = np.concatenate([np.tile(rest, (9, 1)), caption])
    there = np.concatenate([np.tile(rest, (9, 1)) + (15, 0), caption])
    np.testing.assert_allclose(shared(here, there)[:2, 2], [-15, 0], atol=0.1)


@pytest.mark.parametrize(("high", "counts"), [(10, False), (90, True)])
def test_what_moves_has_to_lie_about_a_fifth_of_the_picture(high, counts):
    """Corners in a strip of the picture are an arm's, though they lie in eleven cells."""
    strip = np.array([(x, y) for x in np.arange(10, 230, 20.0) for y in (12.0, 12.0 + high)])
    assert (shared(strip, strip + (3, 0)) is not BEFORE) == counts


def test_the_extent_is_the_way_of_the_corner_that_goes_farthest_in_longer_sides():
    still, moved = np.eye(3)[:2], np.array([[1.0, 0, 12], [0, 1, -3]])
    assert camera.extent(np.stack([still, moved]), 120, 60) == pytest.approx(0.1)
    assert camera.extent(np.stack([still, moved, still - moved + still]), 120, 60) == 0.2
    # 5 % larger about the left upper corner: the right lower one goes 12 and 6 pixels
    assert camera.extent(np.stack([still, 1.05 * still]), H, W) == pytest.approx(0.05)


def test_light_that_changes_evenly_leaves_the_picture_as_it_is_looked_at():
    rng = np.random.default_rng(0)
    frame = cv2.GaussianBlur(rng.integers(60, 160, (H, W, 3), dtype=np.uint8), (0, 0), 4)
    darker = frame - np.uint8(40)
    assert np.abs(camera._plain(frame).astype(int) - camera._plain(darker)).max() <= 3
    assert np.abs(camera._plain(np.full_like(frame, 90)).astype(int) - 128).max() <= 1
    # Beside a step of 10 levels: 3 times what it is above the mean of 31 pixels, 10 of them down.
    frame[:], frame[:, 100:] = 100, 110
    assert camera._plain(frame)[60, 105] == pytest.approx(128 + 3 * 10 * 10 / 31, abs=1)


def panned(x):
    """Frames of a camera that looks so many pixels (T,) to the right in a large room."""
    rng = np.random.default_rng(0)
    wall = cv2.resize(rng.integers(0, 255, (24, 90, 3), dtype=np.uint8), (900, H))
    return np.stack([wall[:, int(s) : int(s) + W] for s in x])


def test_a_pan_across_a_picture_is_followed_though_all_corners_leave():
    x = np.cumsum(1.2 * np.arange(22))  # up to 25 pixels at a time
    sways = camera.sway(panned(x))
    np.testing.assert_allclose(sways[-1], [[1, 0, x[-1]], [0, 1, 0]], atol=8)


def test_between_the_frames_that_are_looked_at_the_way_is_even(monkeypatch):
    """Of 13 frames every second one is looked at; the camera stands in the others."""
    monkeypatch.setattr(camera, "LOOK_AT", 7)
    sways = camera.sway(panned(2 * (np.arange(13) // 2)))
    assert sways.shape == (13, 2, 3)
    np.testing.assert_allclose(sways[:, 0, 2], np.arange(13), atol=0.4)


def test_what_a_steadied_camera_sees_no_more_stays_as_it_was():
    frames = panned([0, 30, 60])
    shift = np.array([[[1.0, 0, s], [0, 1, 0]] for s in (0, 30, 60)])
    steady = camera.steadied(frames, shift)
    np.testing.assert_array_equal(steady[2][:, 62:-2], frames[0][:, 62:-2])
    np.testing.assert_array_equal(steady[2][:, :28], frames[0][:, :28])
    frames[1] //= 2  # the last that saw the strip from 30 to 60
    steady = camera.steadied(frames, shift)
    np.testing.assert_array_equal(steady[2][:, 32:58], frames[0][:, 32:58] // 2)
    assert steady.dtype == np.uint8 and steady.shape == frames.shape
    black = camera.steadied(np.stack([frames[0], 0 * frames[0]]), shift[:2])[1]
    np.testing.assert_array_equal(black[:, :29], frames[0][:, :29])
    assert not black[:, 31:].any()


def test_a_corner_is_lost_that_comes_back_more_than_seven_tenths_of_a_pixel_off(monkeypatch):
    """And it is looked for by 21 pixels about it, first where the motion so far would take it."""
    asked = []

    def found_again(one, two, corners, guess, home, window, most):
        asked.append((guess[0, 0].tolist(), home is corners, window, most))
        return corners + 1, np.array([True, False])

    monkeypatch.setattr(camera, "found_again", found_again)
    corners = np.array([[[10.0, 20.0]], [[30.0, 40.0]]], np.float32)
    here, there = camera._followed(None, None, corners, BEFORE)
    assert asked == [([3.0, 20.0], True, (21, 21), 0.7)]
    assert here.tolist() == [[10, 20]] and there.tolist() == [[11, 21]]
    assert [len(found) for found in camera._followed(None, None, corners[:0], BEFORE)] == [0, 0]
