"""How far dots are off is told from when the object moves until it rests, in the clip's pixels."""

import numpy as np
import pytest

from lbw_minimal.clips import camera
from lbw_minimal.clips.paths import Tracks
from tests.strange_dots import laid, moving, off, steadied
from tests.strangers import Stranger

T, W, H, RATE = 40, 160, 120, 10
TIMES = np.arange(T) / RATE
WAY = np.clip((TIMES - 1.5) / 1.5, 0, 1)  # moves from 1.5 to 3.0 s
THING = np.stack([60 + 60 * WAY, np.full(T, 80.0)], 1)
TIP = THING - (12.0, 0) - np.stack([40 * (1 - np.clip(TIMES / 1.4, 0, 1)), np.zeros(T)], 1)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """A stranger's push, whose pictures do not matter here, and its file."""
    room = np.random.default_rng(0).integers(60, 200, (H // 8, W // 8, 3), np.uint8)
    frames = np.repeat(room.repeat(8, 0).repeat(8, 1)[None], T, 0)
    one = Stranger("usable", "push", "painted", frames, RATE, TIP.copy(), THING.copy())
    return one, one.write(tmp_path_factory.mktemp("clip"))


def found(tip, thing):
    return Tracks(TIMES, tip, thing, np.ones(T), np.ones(T), H, width=W)


def test_what_is_found_where_it_is_is_right_and_counts_while_the_object_moves(clip):
    tip = TIP.copy()
    tip[TIMES < 1.3] += 50  # before the touch nobody asks
    dots = off(clip[0], found(tip, THING), clip[1])
    assert dots.tip < 0.01 and dots.object < 0.01 and dots.swapped == 0 and dots.right


def test_tip_and_object_that_were_taken_for_each_other_are_wrong_and_swapped(clip):
    dots = off(clip[0], found(THING, TIP), clip[1])
    assert dots.tip == pytest.approx(12 / W, abs=0.01) == dots.object
    assert dots.swapped == 1 and not dots.right


def test_of_a_reach_the_tip_alone_counts(clip):
    one = Stranger("usable", "reach", "painted", clip[0].frames, RATE, TIP.copy(), THING.copy())
    dots = off(one, found(TIP, THING + 50), clip[1])
    assert dots.right and np.isnan(dots.object) and dots.swapped == 0
    assert np.isnan(laid(found(TIP, THING), False, TIMES)[1]).all()


def test_what_moves_does_so_from_its_first_frame_that_counts():
    assert np.flatnonzero(moving(THING, 0))[[0, -1]].tolist() == [16, 29]
    late = np.concatenate([THING[-5:], THING])  # another take before
    assert np.flatnonzero(moving(late, 5))[[0, -1]].tolist() == [21, 34]
    hidden = THING.copy()
    hidden[:3] = np.nan
    assert np.array_equal(moving(hidden, 0), moving(THING, 0))


def test_where_the_camera_trembles_the_truth_is_moved_as_the_frames_are(clip, monkeypatch):
    tip, _ = steadied(*clip)
    np.testing.assert_allclose(tip, TIP)
    trembles = np.repeat(np.array([[[1.0, 0, 5], [0, 1, 0]]]), T, 0)
    trembles[0, 0, 2] = 0
    monkeypatch.setattr(camera, "sway", lambda frames: trembles)
    tip, thing = steadied(*clip)
    np.testing.assert_allclose(tip[1:], TIP[1:] + (5, 0))
    np.testing.assert_allclose(thing[0], THING[0])
