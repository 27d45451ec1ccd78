"""The probe of perception: R² and errors of toy keypoints whose map to the pixels is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from tasks.commands import probe as module
from tasks.commands.probe import gap, in_picture, linear, probe


class Exact:
    """Keypoints that are the pixels, shrunk; in a translation the tip stands 3 pixels to the right.

    Its frames are the pixels themselves, (T, 4).
    """

    z_E = np.column_stack([np.arange(20.0, 40), np.full((20, 3), 30.0)]) / 100

    def detect(self, frames):
        return (frames / 100).reshape(len(frames), 2, 2)

    def translate(self, frames):
        assert frames.min() > 10  # the human's, see `filmed`
        return frames + (3, 0, 0, 0)


def filmed(env, frames, seed):
    """Random motion: the object's height never changes. Human frames begin with larger numbers."""
    rng = np.random.default_rng([seed, env.embodiment == "human"])
    pixels = rng.uniform(20, 60, (frames, 4))
    pixels[:, 3] = 40
    return pixels, pixels


@pytest.fixture
def found(monkeypatch):
    asked = []

    def record(env, frames, seed):
        asked.append((env.embodiment, frames, seed))
        return filmed(env, frames, seed)

    def bare(name, embodiment):
        def close():
            asked.append(f"{embodiment} closed")

        return SimpleNamespace(embodiment=embodiment, CONTACT=0.04, close=close)

    expert = np.full((20, 4), 40.0)
    expert[:, 2] = 46 + np.arange(20)  # the object goes, 6 pixels and more before the tip
    expert[:, 0] = 40 + np.arange(20)
    monkeypatch.setattr(module, "record_random", record)
    monkeypatch.setattr(module, "record_expert", lambda env, seed: (expert, None, None))
    monkeypatch.setattr(module.tasks, "bare", bare)
    perception = Exact()
    perception.z_E = (expert - (0, 0, 2, 0)).reshape(20, 2, 2) / 100  # 4 pixels before it
    return probe("push", perception, seed=7, frames=80), asked


def test_what_is_exact_has_r2_of_1_and_a_shift_costs_its_pixels_only_where_maps_are_lent(found):
    scores, asked = found
    assert asked == [("robot", 160, 7), ("human", 80, 8), "robot closed", "human closed"]
    for where in ("robot", "translated"):
        for name in ("tip_x", "tip_y", "object_x"):
            assert scores[where][name] == {"r2": 1.0, "px": 0.0}
    assert scores["transfer"]["tip_x"]["px"] == pytest.approx(3.0, abs=0.01)
    assert scores["transfer"]["tip_x"]["r2"] < 0.98 < scores["transfer"]["tip_y"]["r2"]


def test_what_never_moves_has_no_r2(found):
    scores, _ = found
    assert all(scores[where]["object_y"]["r2"] is None for where in module.SETS)


def test_contact_is_read_from_demonstration_and_robot_in_the_robots_pixels(found):
    scores, _ = found
    assert scores["contact_px"] == {"demonstration": 4.0, "robot": 6.0}


def test_each_keypoint_has_its_deviation(found):
    """Uniform over 40 of 100: 0.4 / 12^0.5 = 0.115; what stands still has none."""
    scores, _ = found
    assert scores["keypoint_std"] == pytest.approx([0.115, 0.115, 0.115, 0], abs=0.012)


def test_the_gap_counts_only_while_the_object_moves():
    """It rests for five frames, 2 pixels before the tip; then both go on, 5 pixels apart."""
    tip = np.array([8, 8, 8, 8, 8, 20, 22, 24, 26])
    thing = np.array([10, 10, 10, 10, 10, 25, 27, 29, 31])
    px = np.stack([tip, 0 * tip, thing, 0 * tip], 1).astype(float)
    moving = [4, 5, 6, 7, 8]  # np.gradient looks to both sides
    assert gap(px) == pytest.approx(np.mean((thing - tip)[moving]), abs=0.005)
    assert gap(px[5:]) == 5.0
    px[:, 2] += 0.123
    assert gap(px) == 4.52


def test_an_object_that_never_moves_has_no_gap():
    """No NaN, which is no JSON: a smoke run's keypoints may show nothing that moves."""
    assert gap(np.tile([8.0, 8, 12, 8], (9, 1))) is None


def test_frames_that_tip_or_object_have_left_do_not_count():
    inside, outside = [10.0, 10, 20, 20], [[10.0, 10, 90, 20], [-1, 10, 20, 20], [10, 84, 20, 20]]
    truth = np.array([inside, *outside])
    film, kept = in_picture(np.arange(4), truth)
    assert film.tolist() == [0] and kept.tolist() == [inside]


def test_the_linear_map_has_an_intercept():
    rng = np.random.default_rng(0)
    z, A = rng.uniform(-1, 1, (50, 3, 2)), rng.normal(size=(6, 4))
    pixels = z.reshape(50, 6) @ A + (10, 20, 30, 40)
    more = rng.uniform(-1, 1, (5, 3, 2))
    np.testing.assert_allclose(
        linear(z, pixels)(more), more.reshape(5, 6) @ A + (10, 20, 30, 40), atol=1e-8
    )


def test_the_probes_frames_are_of_seeds_that_no_training_reaches():
    assert module.PROBE_SEED >= 1_000_000
