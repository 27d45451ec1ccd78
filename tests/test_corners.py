"""Which corners of a picture are the object's, by hand on ways of twenty frames."""

import numpy as np
import pytest

from lbw_minimal.clips import corners
from lbw_minimal.clips.corners import objects_own


@pytest.mark.parametrize(("share", "own"), [(0.24, False), (0.26, True), (1.0, True)])
def test_a_corner_that_goes_less_than_a_quarter_of_the_objects_way_is_not_its(share, own):
    """For 15 frames both rest, and then the object goes by 40 pixels."""
    way = np.concatenate([np.zeros(15), np.linspace(8, 40, 5)])
    path = np.stack([50 + way, np.full(20, 30.0)], 1)
    corner = np.stack([53 + share * way, np.full(20, 31.0)], 1)
    is_own, middle = objects_own(corner[:, None], path, 1.0)
    assert is_own.tolist() == [own]
    if share == 1:
        np.testing.assert_allclose(middle, [[-3, -1]])


@pytest.mark.parametrize(("fewer", "known"), [(0, True), (1, False)])
def test_three_corners_tell_an_objects_way_and_two_do_not(fewer, known, monkeypatch):
    """The object is found by up to 2 pixels beside where its corners say that it is."""
    way = np.stack([np.linspace(20, 60, 20), np.full(20, 40.0)], 1)
    offsets = np.array([(-3.0, 0), (3, 0), (0, 4)])[: 3 - fewer]
    monkeypatch.setattr(corners, "follow", lambda grey: way[-len(grey) :, None] + offsets)
    found = way + np.random.default_rng(0).uniform(-2, 2, way.shape)
    path, there = corners.followed(np.zeros((20, 84, 84, 3), np.uint8), found)
    assert there.all() == there.any() == known
    off = np.abs(path - way - (path - way).mean(0)).max()
    assert off < 1e-9 if known else off > 0.5
