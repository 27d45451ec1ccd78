"""Which corners of a picture are the object's, by hand on ways of twenty frames."""

import numpy as np
import pytest

from lbw_minimal.clips import corners
from lbw_minimal.clips.corners import objects_own


@pytest.mark.parametrize(("share", "own"), [(0.24, False), (0.26, True), (1.0, True)])
def test_a_corner_that_goes_less_than_a_quarter_of_the_objects_way_is_not_its(share, own):
    """For 16 frames both rest, and then the object goes by 40 pixels."""
    way = np.concatenate([np.zeros(16), np.linspace(10, 40, 4)])
    path = np.stack([50 + way, np.full(20, 30.0)], 1)
    corner = np.stack([53 + share * way, np.full(20, 31.0)], 1)
    is_own, middle = objects_own(corner[:, None], path, 1.0)
    assert is_own.tolist() == [own]
    if share == 1:
        np.testing.assert_allclose(middle, [[-3, -1]])


@pytest.mark.parametrize(
    ("apart", "off", "own"), [(3, 9, True), (5, 9, False), (5, 4.5, False), (5, 3.5, True)]
)
def test_a_corner_is_the_objects_if_it_goes_along_in_four_fifths_of_the_frames(apart, off, own):
    """In so many of the last ten of twenty frames it is beside it; three are a seventh of all."""
    path = np.stack([np.linspace(20, 60, 20), np.full(20, 40.0)], 1)
    corner = path + (2, -1)
    corner[10 : 10 + apart, 1] -= off
    is_own, _ = objects_own(corner[:, None], path, 1.0)
    assert is_own.tolist() == [own]


@pytest.mark.parametrize(("fewer", "known"), [(0, True), (1, False)])
def test_three_corners_tell_an_objects_way_and_two_do_not(fewer, known, monkeypatch):
    """The object is found by up to 2 pixels beside where its corners say that it is."""
    way = np.stack([np.linspace(20, 60, 20), np.full(20, 40.0)], 1)
    offsets = np.array([(-3.0, 0), (3, 0), (0, 4)])[: 3 - fewer]
    monkeypatch.setattr(corners, "follow", lambda grey: way[-len(grey) :, None] + offsets)
    found = way + np.random.default_rng(0).uniform(-2, 2, way.shape)
    given = found.copy()
    path, there = corners.followed(np.zeros((20, 84, 84, 3), np.uint8), found)
    assert there.all() == there.any() == known and (found == given).all()
    off = np.abs(path - way - (path - way).mean(0)).max()
    assert off < 1e-9 if known else off > 0.5


def told(monkeypatch, *flows):
    """OpenCV's tracker says what is told: (places, found) each time that it is asked."""
    answers = iter(flows)

    def track(one, two, corners, **how):
        places, found = next(answers)
        return np.float32(places), np.array(found, np.uint8), None

    monkeypatch.setattr(corners.cv2, "calcOpticalFlowPyrLK", track)


def test_a_corner_is_kept_if_it_is_found_both_ways_and_comes_back_to_half_a_pixel(monkeypatch):
    here = np.float32([[[10, 10]], [[20, 20]], [[30, 30]], [[40, 40]]])
    there, found = here + 3, [[1], [1], [0], [1]]
    back = here + np.float32([[[0.4, 0]], [[0.4, 0.4]], [[0, 0]], [[0, 0]]])
    told(monkeypatch, (there, found), (back, [[1], [1], [1], [0]]))
    places, kept = corners._found_again(None, None, here)
    assert (places == there).all() and kept.tolist() == [True, False, False, False]


@pytest.mark.parametrize(
    ("shape", "followed"), [((540, 720), (360, 480)), ((90, 120), (90, 120)), ((9, 960), (4, 480))]
)
def test_frames_are_followed_at_480_pixels_at_most(shape, followed, monkeypatch):
    shapes = []
    monkeypatch.setattr(corners, "follow", lambda g: shapes.append(g.shape) or np.zeros((20, 0, 2)))
    corners.followed(np.zeros((20, *shape, 3), np.uint8), np.zeros((20, 2)))
    assert shapes[0] == (20, *followed)


def test_where_all_corners_are_lost_others_are_chosen(monkeypatch):
    """The first ones are seen in frames 0 to 11 of forty, those found at frame 12 to the end."""
    way = np.stack([np.linspace(20, 60, 40), np.full(40, 40.0)], 1)
    offsets, asked = np.array([(-3.0, 0), (3, 0), (0, 4)]), []

    def follow(grey):
        first = 40 - len(grey)
        asked.append(first)
        paths = way[first:, None] + offsets
        if first == 0:
            paths[12:] = np.nan
        return paths

    monkeypatch.setattr(corners, "follow", follow)
    path, known = corners.followed(np.zeros((40, 84, 84, 3), np.uint8), way)
    assert asked == [0, 12] and known.all()
    np.testing.assert_allclose(path, way, atol=1e-9)


def test_where_there_are_no_corners_they_are_looked_for_a_twentieth_on(monkeypatch):
    """Of forty frames: each third one, as long as two come after it."""
    asked = []
    monkeypatch.setattr(
        corners, "follow", lambda g: asked.append(40 - len(g)) or np.zeros((len(g), 0, 2))
    )
    way = np.full((40, 2), 30.0)
    path, known = corners.followed(np.zeros((40, 84, 84, 3), np.uint8), way)
    assert asked == list(range(0, 38, 3)) and not known.any() and (path == way).all()


def test_many_faint_corners_are_followed_and_none_closer_than_two_pixels():
    """A hundred squares, half of them at a tenth of the contrast of the others."""
    grey = np.full((2, 220, 220), 100, np.uint8)
    for i in range(100):
        y, x = divmod(i, 10)
        grey[:, 12 + 20 * y : 22 + 20 * y, 12 + 20 * x : 22 + 20 * x] = 220 if i % 2 else 114
    paths = corners.follow(grey)[0]
    assert paths.shape[0] > 300  # four a square
    apart = np.linalg.norm(paths[:, None] - paths[None], axis=2) + 9 * np.eye(len(paths))
    assert apart.min() >= 2
