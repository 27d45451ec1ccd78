"""The look-alike of a phone's clip: what was moved is where it says, and time is uneven."""

import numpy as np
import pytest

from lbw_minimal.clips.lookalike import BEFORE, HEIGHT, PACE, WIDTH, look_alike, write
from lbw_minimal.clips.reader import read_clip
from lbw_minimal.clips.retarget import FPS


def film(T=50):
    """A bright square, 5 x 5 pixels, that goes from left to right on grey, and its centre."""
    frames, pixels = np.full((T, 84, 84, 3), 90, np.uint8), np.zeros((T, 4))
    for t in range(T):
        frames[t, 40:45, 10 + t : 15 + t] = (250, 60, 60)
        pixels[t] = 12.5 + t, 42.5, 12.5 + t, 42.5
    return frames, pixels


@pytest.fixture(scope="module")
def clip():
    return look_alike(*film())


def test_things_are_where_their_places_say(clip):
    """The centre of what is red, which noise moves by a tenth of a pixel."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    for frame, place in zip(clip.frames, clip.object, strict=True):
        red = frame[..., 0].astype(float) - frame[..., 1]
        red = np.where(red > 60, red, 0)
        centre = np.array([(red * x).sum(), (red * y).sum()]) / red.sum()
        np.testing.assert_allclose(centre, place, atol=0.4)


def test_it_goes_the_other_way(clip):
    assert clip.object[-1, 0] < clip.object[0, 0]


def test_a_frames_time_is_that_of_what_it_shows(clip):
    """To half a step of the film, 1/50 s at its own pace."""
    gone = (clip.object[0] - clip.object)[:, 0] / (clip.object[0] - clip.object[-1])[0]
    due = np.clip((clip.times - BEFORE) * PACE * FPS / 49, 0, 1)
    np.testing.assert_allclose(gone, due, atol=0.5 / 49 + 1e-9)


def test_its_frames_come_unevenly(clip):
    steps = np.diff(clip.times)
    assert clip.times[0] == 0 and (steps > 0).all() and steps.max() > 1.8 * steps.min()


def test_the_file_keeps_frames_and_times(clip, tmp_path):
    write(tmp_path / "my.mp4", clip)
    read = read_clip(tmp_path / "my.mp4", crop=False)
    np.testing.assert_allclose(read.times, clip.times, atol=1e-3)
    assert read.frames.shape == clip.frames.shape
    assert np.abs(read.frames.astype(float) - clip.frames).mean() < 8


def test_the_same_seed_gives_the_same_clip(clip):
    again, other = look_alike(*film()), look_alike(*film(), seed=1)
    assert all((a == b).all() for a, b in zip(clip, again, strict=True))
    assert len(other.times) != len(clip.times) or (other.times != clip.times).any()


def test_it_is_slower_after_a_rest_and_lasts_as_long_as_that_takes(clip):
    """50 frames at 25 a second and at 0.7 times the speed, after 0.4 s: 3.26 s, 15 a second."""
    assert clip.times[-1] == pytest.approx(0.4 + 2 / 0.7, abs=0.01)
    assert np.median(np.diff(clip.times)) == pytest.approx(1 / 15, rel=0.25)
    rest = clip.object[clip.times < 0.4]
    assert len(rest) > 2 and np.ptp(rest, axis=0).max() == 0
    assert 0.8 < len(clip.frames) / (15 * clip.times[-1]) < 1  # a tenth never came


def test_it_is_warmer_noisy_and_flickers(clip):
    """Grey of 90 in its corner: red above blue, four grey levels of noise, 3 % of flicker."""
    corner = clip.frames[:, :40, :40].astype(float)
    red, green, blue = corner.mean((0, 1, 2))
    assert red / green == pytest.approx(1.06, abs=0.01)
    assert blue / green == pytest.approx(0.9, abs=0.01)
    assert corner.std((1, 2)).mean() == pytest.approx(4, abs=0.3)
    assert 0.015 < (corner.mean((1, 2, 3)) / corner.mean()).std() < 0.05
