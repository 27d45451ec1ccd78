"""The motion that a picture shares, by hand: cells that vote, and similarities that are known."""

import cv2
import numpy as np
import pytest

from lbw_minimal.clips import camera

H, W = 120, 240


def votes(moved=0, still=0):
    """One frame's 6 x 12 votes: cells that moved, from the left, that stand, from the right."""
    said = np.zeros((12, 6))
    said.flat[:moved], said.flat[72 - still :] = 1, -1
    return said.T[None]


@pytest.mark.parametrize(("moved", "still", "stands"), [(37, 30, False), (36, 30, True)])
def test_the_camera_moves_if_six_cells_say_so_for_five_that_do_not(moved, still, stands):
    assert camera._stands(votes(moved, still)) == stands


def test_all_frames_vote_together():
    """In most frames nothing tells, and one frame's arm is outvoted by the others' room."""
    nothing, arm, room = votes(), votes(moved=24), votes(still=9)
    assert camera._stands(np.concatenate([nothing, arm, room, room, room]))
    assert not camera._stands(np.concatenate([nothing, arm, room, room]))


@pytest.mark.parametrize(("columns", "stands"), [(3, True), (5, False)])
def test_what_moves_has_to_lie_about_a_fifth_of_the_picture(columns, stands):
    """The hull of 6 x 3 middles is 5 x 2 = 10 cells of 72, of 6 x 5 it is 20."""
    assert camera._stands(votes(moved=6 * columns)) == stands


def test_a_picture_in_which_nothing_tells_stands():
    assert camera._stands(votes()) and camera._stands(np.zeros((0, 6, 12)))


def test_a_cell_votes_for_what_it_is_more_like():
    """The left half of a picture moves by 8 pixels, and the right half stands."""
    before, after = panned([0, 8])
    after[:, W // 2 :] = before[:, W // 2 :]
    there = np.array([[1.0, 0, -8], [0, 1, 0], [0, 0, 1]])
    picture = camera._Picture(before, camera.FINE)
    said = picture.votes(camera._plain(after, picture.size), there, np.eye(3))
    assert said.shape == (6, 12)
    assert (said[:, 1:5] > 0).mean() > 0.9 and (said[:, 7:] < 0).mean() > 0.9


def test_the_extent_is_the_way_of_the_corner_that_goes_farthest_in_longer_sides():
    still, moved = np.eye(3)[:2], np.array([[1.0, 0, 12], [0, 1, -3]])
    assert camera.extent(np.stack([still, moved]), 120, 60) == pytest.approx(0.1)
    assert camera.extent(np.stack([still, moved, still - moved + still]), 120, 60) == 0.2
    # 5 % larger about the left upper corner: the right lower one goes 12 and 6 pixels
    assert camera.extent(np.stack([still, 1.05 * still]), H, W) == pytest.approx(0.05)


def test_light_that_changes_evenly_leaves_the_picture_as_it_is_looked_at():
    rng = np.random.default_rng(0)
    frame = cv2.GaussianBlur(rng.integers(60, 160, (H, W, 3), dtype=np.uint8), (0, 0), 4)
    plain = camera._plain(frame, (W, H))
    assert np.abs(plain - camera._plain(frame - np.uint8(40), (W, H))).max() < 1e-4
    # Beside a step of 10 levels: what it is above the mean of 15 pixels, 5 of them down.
    frame[:], frame[:, 100:] = 100, 110
    assert camera._plain(frame, (W, H))[60, 102] == pytest.approx(10 * 5 / 15, abs=0.1)


def panned(x):
    """Frames of a camera that looks so many pixels (T,) to the right in a large room."""
    rng = np.random.default_rng(0)
    wall = cv2.resize(rng.integers(0, 255, (24, 90, 3), dtype=np.uint8), (900, H))
    return np.stack([wall[:, int(s) : int(s) + W] for s in x])


def test_a_picture_is_laid_over_one_that_is_turned_and_nearer():
    """By 3 degrees and 8 % about the middle, to a twentieth of a pixel of what is looked at."""
    (frame,) = panned([40])
    there = np.vstack([cv2.getRotationMatrix2D((W / 2, H / 2), 3, 1.08), (0, 0, 1)])
    other = cv2.warpAffine(frame, there[:2], (W, H), flags=cv2.INTER_CUBIC)
    picture = camera._Picture(frame, camera.FINE)
    found = picture.laid(camera._plain(other, picture.size), np.eye(3))
    corners = np.array([(0, 0, 1), (W, 0, 1), (0, H, 1), (W, H, 1)], float)
    assert np.abs(((found - there) @ corners.T)[:2]).max() < 0.3


def test_stripes_that_go_along_themselves_do_not_hide_a_pan():
    """Blinds have no corners, and what hangs before them is all that tells."""
    wall = np.full((H, 2 * W, 3), 120, np.uint8)
    wall[::8] = wall[1::8] = 150
    wall[20:50, 60:200] = wall[70:100, 150:290] = 60
    sways = camera.sway(np.stack([wall[:, x : x + W] for x in range(0, 60, 4)]))
    np.testing.assert_allclose(sways[-1], [[1, 0, 56], [0, 1, 0]], atol=1)


def test_tiles_that_look_alike_do_not_lead_a_still_camera_astray():
    """An arm goes across tiles, by a tile in three frames."""
    wall = np.full((H, W, 3), 90, np.uint8)
    wall[::20] = wall[:, ::20] = 190
    frames = np.repeat(wall[None], 20, axis=0)
    for i, frame in enumerate(frames):
        frame[40:80, : 10 + 7 * i] = (wall[10:50, : 10 + 7 * i] // 2)[:, ::-1]
    assert camera.extent(camera.sway(frames), H, W) == 0


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
