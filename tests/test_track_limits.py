"""On either side of each of the tracks' limits: grey levels, pixels, shares, by hand."""

import numpy as np
import pytest

from lbw_minimal import tracks

WALL = np.full((84, 84, 3), 100, np.uint8)
NOTHING = np.zeros((84, 84), np.uint8)


@pytest.mark.parametrize(("levels", "arm"), [(8, False), (9, True)])
def test_an_arm_stands_out_by_more_than_eight_grey_levels_in_some_colour(levels, arm):
    frame = WALL.copy()
    frame[0:30, 40:44, 2] += levels
    assert (tracks.arm_near(frame, WALL, NOTHING, np.array([42.0, 60])) is not None) == arm


def test_the_arms_pixels_count_by_their_nearness_and_by_how_clearly_they_stand_out():
    """Two columns at the picture's edge, one pixel apart in their distance, of 3."""
    frame = WALL.copy()
    frame[0, 40], frame[0, 41] = 180, 140  # 40 levels are as clear as can be
    place = np.array([38.0, 0])  # 2 and 3 pixels off
    share = np.exp(-1 / 3)
    x, y = tracks.arm_near(frame, WALL, NOTHING, place)
    assert (x, y) == pytest.approx(((40 + 41 * share) / (1 + share), 0))
    frame[0, 40] = 120  # half as clear
    x, _ = tracks.arm_near(frame, WALL, NOTHING, place)
    assert x == pytest.approx((40 * 0.5 + 41 * share) / (0.5 + share))


@pytest.mark.parametrize("levels", [30, 31])
def test_an_object_has_left_where_more_than_thirty_grey_levels_changed(levels):
    """A square goes 20 pixels to the right; its points are where it began."""
    first, last = WALL.copy(), WALL.copy()
    first[40:50, 30:40] += np.uint8(levels)
    last[40:50, 50:60] += np.uint8(levels)
    points = np.array([[31.0, 41], [38, 48]])
    mask = tracks.silhouette(first, last, np.array([20.0, 0]), points)
    assert mask.sum() == (100 if levels > 30 else 50)  # else five pixels about each of its points


def test_what_comes_back_looks_as_it_did_to_within_thirty_grey_levels():
    first, last = WALL.copy(), WALL.copy()
    first[40:50, 30:40] += np.uint8(90)
    last[40:50, 50:60] += np.uint8(90)
    last[40:50, 50:55] -= np.uint8(29)
    last[40:50, 57:60] -= np.uint8(30)
    mask = tracks.silhouette(first, last, np.array([20.0, 0]), np.array([[32.0, 45]]))
    assert mask[40:50, 30:37].all() and mask.sum() == 70


@pytest.mark.parametrize(("contrast", "is_one"), [(9, False), (20, True)])
def test_a_corner_is_a_hundredth_as_strong_as_the_best(contrast, is_one):
    """Strength goes with the square of the contrast: a tenth of 130 levels is 13."""
    frame = np.full((84, 84, 3), 60, np.uint8)
    frame[20:40, 20:40], frame[50:70, 50:70] = 190, 60 + contrast
    found = tracks.corners(frame)
    assert (found > 45).all(1).any() == is_one and (found < 45).all(1).any()


@pytest.mark.parametrize(("apart", "one"), [(1.4, True), (1.6, False)])
def test_points_of_one_object_differ_by_less_than_a_pixel_and_a_half(apart, one):
    d = np.zeros((5, 3, 2))
    d[2, 2, 0] = apart  # in a single frame
    assert tracks.together(d).tolist() == [True, True, one]


@pytest.mark.parametrize(("rest", "kept"), [(0.9, True), (1.1, False)])
def test_an_object_rests_to_within_a_pixel_for_a_quarter_of_the_time(rest, kept):
    """Of 20 frames the first five."""
    paths = np.zeros((20, 2, 2))
    paths[5:] += 10 * np.linspace(0, 1, 15)[:, None, None]
    paths[4, :, 0] = rest
    assert tracks.object_points(paths, np.ones(2, bool)).tolist() == 2 * [kept]
    paths[4, :, 0] = 0
    paths[5, :, 0] = 2  # from here on it may move
    assert tracks.object_points(paths, np.ones(2, bool)).all()


@pytest.mark.parametrize(("way", "moved"), [(2.9, False), (3.1, True)])
def test_an_object_ends_three_pixels_from_its_start(way, moved):
    paths = np.zeros((20, 2, 2))
    paths[10:, :, 0] = way
    assert tracks.object_points(paths, np.ones(2, bool)).tolist() == 2 * [moved]


@pytest.mark.parametrize(("seen", "wall"), [(29, 40), (31, 150)])
def test_the_wall_is_what_three_tenths_of_a_film_show(seen, wall):
    """Of 100 frames so many show it; an arm of all grey levels from 20 to 60 is before it else."""
    film = np.full((100, 2, 2, 3), 150, np.uint8)
    film[seen:] = np.linspace(20, 60, 100 - seen).astype(np.uint8)[:, None, None, None]
    assert np.abs(tracks.background(film).astype(int) - wall).max() <= 12


def test_a_point_is_lost_that_comes_back_more_than_half_a_pixel_off(monkeypatch):
    back = iter([np.array([[10.4, 20.0]]), np.array([[10.6, 20.0]])])
    there = np.array([[15.0, 20.0]])

    def lucas_kanade(frame, following, points, guess):
        to = there if points[0, 0] == 10 else next(back)
        return to, np.ones(1, bool)

    monkeypatch.setattr(tracks, "_lucas_kanade", lucas_kanade)
    point = np.array([[10.0, 20.0]])
    assert [tracks.flow(WALL, WALL, point)[1].tolist() for _ in range(2)] == [[True], [False]]
