"""How unlike each other drawn clips are in light, noise and blur: a film of two grey halves."""

import cv2
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


CORNER, ALONG, DOWN = (42.0, 42.0), (62.0, 42.0), (42.0, 62.0)  # pixels


@pytest.fixture(scope="module")
def filmed():
    """Of 400 clips of three white frames what the camera made: frames, and where it has three
    places, (3, 3, 2), nan where they are out of the picture. Light and noise are left out."""
    patch, out = pytest.MonkeyPatch(), []
    patch.setattr(drawn_camera, "_developed", lambda rng, frames: frames)
    white, none = np.full((84, 84, 3), 255, np.uint8), np.zeros((84, 84, 2), np.uint8)
    for seed in range(400):
        seen = []
        for pair in ((CORNER, ALONG), (CORNER, DOWN)):
            places = np.array([[at] * 3 for at in pair])
            rng = np.random.default_rng(seed)
            seen.append(drawn_camera.filmed(rng, [white] * 3, [none] * 3, places))
        out.append((seen[0][0], np.stack([seen[0][1], seen[0][2], seen[1][2]])))
    patch.undo()
    return out


def views(filmed):
    """Which clips (n,) are mirrored, and of those that show all: zoom, turn, and the middle."""
    places = np.array([places[:, 0] for _, places in filmed])
    places = places[np.isfinite(places).all((1, 2))]
    along, down = (places[:, i] - places[:, 0] for i in (1, 2))
    mirrored = along[:, 0] * down[:, 1] - along[:, 1] * down[:, 0] < 0
    places[mirrored, :, 0] = 84 - places[mirrored, :, 0]
    along[mirrored, 0] *= -1
    down[mirrored, 0] *= -1
    return mirrored, along, down, places[:, 0]


def test_half_of_the_clips_are_mirrored(filmed):
    assert views(filmed)[0].mean() == pytest.approx(0.5, abs=0.07)


def test_a_camera_stands_nearer_or_farther_by_a_fifth_and_leans_by_six_degrees(filmed):
    """The log of the zoom is -0.05 +- 0.18; what is drawn near the edge is seen less often."""
    _, along, *_ = views(filmed)
    zoom = np.log(np.linalg.norm(along, axis=1) / 20)
    assert zoom.mean() == pytest.approx(-0.05, abs=0.03)
    assert zoom.std() == pytest.approx(0.18, abs=0.025)
    turn = np.degrees(np.arctan2(-along[:, 1], along[:, 0]))
    assert turn.mean() == pytest.approx(0, abs=0.8) and turn.std() == pytest.approx(6, abs=0.6)


def test_what_is_upright_leans_by_a_sixteenth_against_what_is_level(filmed):
    _, along, down, _ = views(filmed)
    lean = (along * down).sum(1) / (np.linalg.norm(along, axis=1) * np.linalg.norm(down, axis=1))
    assert lean.std() == pytest.approx(0.06, abs=0.01)


def test_a_camera_looks_four_pixels_elsewhere(filmed):
    *_, middle = views(filmed)
    assert np.abs(middle.mean(0) - 42).max() < 0.6
    assert middle.std(0)[1] == pytest.approx(4, abs=0.5)


def test_one_camera_in_seven_shakes_by_a_third_of_a_pixel(filmed):
    shakes = np.array([np.ptp(places[0, :, 1]) for _, places in filmed])
    shakes = shakes[np.isfinite(shakes)]
    assert (shakes > 1e-5).mean() == pytest.approx(0.15, abs=0.04)
    moved = np.concatenate([
        (places[0, :, 1] - places[0, :, 1].mean()) for _, places in filmed
        if np.ptp(places[0, :, 1]) > 1e-5
    ])  # fmt: skip
    assert moved.std() == pytest.approx(0.3 * (2 / 3) ** 0.5, abs=0.03)


def test_two_clips_in_five_lie_between_black_bars_of_4_to_21_pixels(filmed):
    """As many upright as wide; the picture between them goes on to its edges."""
    bars = np.array([
        [int((frames[0, 42, :, 0] == 0).sum()), int((frames[0, :, 42, 0] == 0).sum())]
        for frames, _ in filmed
    ])  # fmt: skip
    barred = bars.any(1)
    assert barred.mean() == pytest.approx(0.4, abs=0.06)
    assert (bars[barred] > 0).sum(1).max() == 1
    assert (bars[barred, 0] > 0).mean() == pytest.approx(0.5, abs=0.1)
    wide = bars.max(1)[barred]
    assert (wide % 2 == 0).all() and set(wide // 2) == set(range(4, 22))


def test_what_lies_in_a_bar_is_nowhere_on_either_side():
    """Places along the middle row and column, in the clips that have bars."""
    white, none = np.full((84, 84, 3), 255.0, np.float32), np.zeros((84, 84, 2), np.uint8)
    out = 0
    for seed in range(80):
        x = np.random.default_rng(seed + 1000).uniform(0, 84, (2, 1, 2)).repeat(2, 1)
        frames, *places, _ = drawn_camera.filmed(
            np.random.default_rng(seed), [white] * 2, [none] * 2, x
        )
        lit = frames[0].max(2) > 0
        for (at_x, at_y), _ in places:
            if np.isfinite(at_x):
                assert lit[int(at_y), int(at_x)]
            out += np.isnan(at_x)
    assert out > 20


def test_one_clip_in_twelve_begins_in_its_middle_with_its_places_and_masks():
    """Frames, masks and places count upwards, but for a turn of all three by the same steps."""
    T, turned = 3, 0
    patch = pytest.MonkeyPatch()
    patch.setattr(drawn_camera, "_developed", lambda rng, frames: frames)
    for seed in range(300):
        frames = [np.full((84, 84, 3), 10 * t, np.uint8) for t in range(1, T + 1)]
        masks = [np.full((84, 84, 2), 10 * t, np.uint8) for t in range(1, T + 1)]
        places = np.array([[(42.0, 30 + 10 * t) for t in range(T)]] * 2)
        seen, tip, thing, cells = drawn_camera.filmed(
            np.random.default_rng(seed), frames, masks, places
        )
        order = seen[:, 42, 42, 0] // 10 - 1
        first = int(order[0])
        assert order.tolist() == [(first + t) % T for t in range(T)]
        assert (cells[:, 21, 21, 0] // 10 - 1).tolist() == order.tolist()
        for place in (tip, thing):
            there = np.isfinite(place[:, 1])
            assert (np.diff(place[there][np.argsort(order[there]), 1]) > 0).all()
        turned += first > 0
    patch.undo()
    assert turned / 300 == pytest.approx(0.08, abs=0.04)


class Choice:
    """Chance whose yes-or-no questions, in their order, are answered as told."""

    def __init__(self, seed, yes=()):
        self.rng, self.yes, self.asked = np.random.default_rng(seed), yes, -1

    def random(self):
        self.asked += 1
        return 0.0 if self.asked in self.yes else 0.999

    def __getattr__(self, name):
        return getattr(self.rng, name)


FLICKERS, HAZE, NOISE, BLUR, JPEG = range(5)  # the questions of `_developed`


def developed(seed, *yes, frames=None):
    film = np.full((8, 84, 84, 3), 100.0, np.float32) if frames is None else frames
    return drawn_camera._developed(Choice(seed, yes), film.copy()).astype(float)


def halves():
    film = np.full((1, 84, 84, 3), DARK, np.float32)
    film[:, 42:] = BRIGHT
    return film


@pytest.mark.parametrize(
    ("question", "share"), [(FLICKERS, 0.3), (HAZE, 0.25), (NOISE, 0.6), (BLUR, 0.4), (JPEG, 0.4)]
)
def test_so_many_clips_flicker_or_are_hazy_noisy_blurred_or_coded(question, share):
    """What changes when the question is answered by just less, or just more, than the share."""

    class Nearly(Choice):
        def random(self):
            self.asked += 1
            return self.answer if self.asked == question else 0.999

    made = []
    film = halves().repeat(4, axis=0)
    for answer in (share - 1e-6, share + 1e-6, 0.999):
        chance = Nearly(5)
        chance.answer = answer
        made.append(drawn_camera._developed(chance, film.copy()))
    assert not np.array_equal(made[0], made[2]) and np.array_equal(made[1], made[2])


def test_a_clip_flickers_by_three_hundredths_and_else_not_at_all():
    levels = np.array([developed(seed, FLICKERS).mean((1, 2, 3)) for seed in range(60)])
    relative = levels / levels.mean(1, keepdims=True) - 1
    assert relative.std() == pytest.approx(0.03 * (7 / 8) ** 0.5, abs=0.005)
    assert np.ptp(developed(0), axis=0).max() == 0


def test_haze_leaves_between_two_fifths_and_all_of_a_contrast():
    share = []
    for seed in range(60):
        plain, hazy = (
            film[0, 54:80, 42].mean() - film[0, 4:30, 42].mean()
            for film in (developed(seed, frames=halves()), developed(seed, HAZE, frames=halves()))
        )
        share.append(hazy / plain)
    assert 0.37 < min(share) < 0.5 and 0.9 < max(share) < 1.03


def test_all_is_brighter_or_darker_by_twelve_levels_and_ends_at_black_and_white():
    """Of black pictures the offset alone is left; white ones stay white, and turn no corner."""
    black, white = (np.full((1, 84, 84, 3), level, np.float32) for level in (0, 255))
    offset = np.array([developed(seed, frames=black).mean() for seed in range(400)])
    assert (offset == 0).mean() == pytest.approx(0.5, abs=0.06)
    assert np.median(offset[offset > 0]) == pytest.approx(12 * 0.6745, abs=1.3)
    assert min(developed(seed, frames=white).min() for seed in range(100)) > 60


def test_noise_is_up_to_eight_levels():
    grey = np.full((3, 84, 84, 3), 100.0, np.float32)
    noise = [developed(s, NOISE, frames=grey).std(0, ddof=1).mean() for s in range(60)]
    assert min(noise) < 1 and 6.5 < max(noise) < 8.5


def test_a_blurred_edge_is_up_to_a_pixel_wide():
    """Its slope is that of a normal deviation of 0.3 to 1.1 pixels; a sharp one jumps at once."""
    wide = []
    for seed in range(60):
        column = developed(seed, BLUR, frames=halves())[0, 36:48, 42, 1]
        wide.append(np.abs(np.diff(column)).max() / np.abs(column[-1] - column[0]))
    assert max(wide) > 0.88 and 0.33 < min(wide) < 0.42


def test_a_clip_is_coded_with_one_quality_from_25_to_89(monkeypatch):
    """Drawn once for all of its frames, so that they flicker by nothing but their content."""
    asked, encode = [], cv2.imencode

    def told(kind, frame, quality):
        asked.append(quality[1])
        return encode(kind, frame, quality)

    monkeypatch.setattr(drawn_camera.cv2, "imencode", told)
    for seed in range(60):
        developed(seed, JPEG, frames=halves().repeat(2, axis=0))
    first, second = np.array(asked).reshape(60, 2).T
    assert (first == second).all() and 25 <= first.min() < 30 and 85 < first.max() < 90
