"""How unlike each other drawn clips are in light, noise and blur: a film of two grey halves."""

import numpy as np
import pytest

from lbw_minimal.clips import drawn_camera

DARK, BRIGHT, CLIPS = 80.0, 120.0, 300


@pytest.fixture(scope="module")
def films():
    """Of each clip a frame (1, 84, 84, 3), dark above and bright below."""
    halves = np.full((1, 84, 84, 3), DARK, np.float32)
    halves[:, 42:] = BRIGHT
    return [drawn_camera._developed(np.random.default_rng(s), halves) for s in range(CLIPS)]


def parts(film):
    """The upper and the lower half of a film without the edge between them, as floats."""
    return film[:, 4:30].astype(float), film[:, 54:80].astype(float)


def test_two_clips_in_five_have_no_noise(films):
    """Then all pixels of a column are alike."""
    still = [all(np.ptp(part, axis=1).max() == 0 for part in parts(film)) for film in films]
    assert 0.3 < np.mean(still) < 0.5


def test_clips_differ_by_a_quarter_in_brightness_and_less_in_tint(films):
    """By the difference of the halves, in which an offset is not; haze makes that smaller."""
    above, below = (np.array([part.mean((0, 1, 2)) for part in side])
                   for side in zip(*map(parts, films), strict=True))  # fmt: skip
    seen = (above.min(1) > 5) & (below.max(1) < 250)
    cast = np.log((below - above)[seen] / (BRIGHT - DARK))  # (n, 3)
    high, low = np.quantile(cast.mean(1), (0.84, 0.5))
    assert high - low == pytest.approx(0.25, abs=0.07)
    assert cast.std(1, ddof=1).mean() == pytest.approx(0.07 * 0.886, abs=0.02)


def test_the_light_comes_from_either_side(films):
    """An edge is by a normal deviation of 0.12 brighter than the middle, or darker."""
    left, middle, right = (
        np.array([film[:, 54:80, columns].mean() for film in films])
        for columns in (slice(4), slice(40, 44), slice(80, 84))
    )
    slope = (right - left) / middle / 2
    assert np.median(np.abs(slope)) == pytest.approx(0.12 * 0.6745, abs=0.017)
    assert 0.4 < (slope > 0).mean() < 0.6
