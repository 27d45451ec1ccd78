"""What is said of a clip that is too dark, or whose arm looks like what is behind it."""

import numpy as np
import pytest
from toy_clips import room

from lbw_minimal import video
from lbw_minimal.clips import light
from tasks import TASKS, VIDEOS

SHARES = np.clip(np.linspace(-0.2, 0.7, 30), 0, 0.55)  # of the width, to which the arm reaches


ROOM = room()


def film(more, *, room=ROOM, noise=2.0, wide=16):
    """An arm from the left that is by so much lighter than the room behind it, and as patterned."""
    frames = np.repeat(room[None].astype(float), len(SHARES), axis=0)
    for frame, share in zip(frames, SHARES, strict=True):
        frame[48 : 48 + wide, : round(room.shape[1] * share)] += more
    noise = np.random.default_rng(0).normal(0, noise, frames.shape)
    return np.clip(frames + noise, 0, 255).astype(np.uint8)


def test_nothing_is_said_of_a_bright_clip_with_an_arm_of_another_colour():
    assert light.poor(film(60)) == light.poor(film(-60)) == light.poor(film((60, 0, -30))) == ""


def test_a_dark_clip_is_called_dark():
    said = light.poor(film(60) // 5)
    assert said.startswith(" The picture is dark, 2") and said.endswith("more light would help.")


@pytest.mark.parametrize(
    ("brightest", "gain"), [(100, 1), (99, 235 / 99), (47, 5), (20, 8), (0, 8)]
)
def test_a_dark_clip_is_made_so_bright_that_its_lightest_pixels_are_nearly_white(brightest, gain):
    """Two in a hundred of its pixels are so bright, in one colour; the others are black."""
    frames = np.zeros((5, 10, 20, 3), np.uint8)
    frames[:, :3, 0, 1] = frames[:, :3, 1, 2] = frames[:, :3, 2, 0] = brightest
    assert light.gain(frames) == pytest.approx(gain)
    bright = light.brightened(frames, light.gain(frames))
    assert bright.dtype == np.uint8 and bright.max() == round(brightest * gain)
    assert (light.brightened(frames, 30.0)[:, :3, 0, 1] == min(255, 30 * brightest)).all()


def test_a_clip_that_was_made_brighter_is_called_dark_by_the_light_it_was_filmed_in():
    frames = film(60) // 5
    bright = light.brightened(frames, 5.0)
    assert "dark, 2" in light.poor(bright, times=5.0) and light.poor(bright) == ""


@pytest.mark.parametrize("more", [18, -18, (0, 18, 0)])
def test_an_arm_like_what_is_behind_it_is_said_with_what_helps(more):
    said = light.poor(film(more))
    assert "differs from what is behind it by no more than 1" in said and "sleeve" in said


@pytest.mark.parametrize(("found", "said"), [(14, True), (15, False)])
def test_an_arm_whose_tip_is_found_in_half_of_the_frames_is_told_from_the_room(found, said):
    sure = np.where(np.arange(len(SHARES)) < found, 0.5, 0.4)
    assert bool(light.poor(film(18), sure)) == said
    assert "dark" in light.poor(film(60) // 5, sure)


@pytest.mark.parametrize(
    ("bright", "differs", "said"),
    [(32, 30, ""), (31.9, 60, "dark"), (32, 29.9, "no more than 30"), (32, np.nan, ""),
     (31.9, 5, "dark")],
)  # fmt: skip
def test_what_counts_as_dark_and_as_alike(bright, differs, said, monkeypatch):
    monkeypatch.setattr(light, "measured", lambda frames: (bright, differs))
    assert said in light.poor(None) and bool(said) == bool(light.poor(None))


def test_how_bright_and_how_different_is_measured_in_grey_levels():
    wall = np.full((96, 160, 3), 120, np.uint8)
    bright, differs = light.measured(film((10, 25, -5), room=wall))
    assert bright == pytest.approx(120, abs=1) and differs == pytest.approx(25, abs=3)


@pytest.mark.parametrize(("rows", "alike"), [(1, True), (5, False)])
def test_the_tenth_of_an_arm_that_differs_most_counts(rows, alike):
    """Of sixteen rows of pixels; the others might be its shadow."""
    more = np.full((16, 1, 1), 12.0)
    more[:rows] = 80
    assert bool(light.poor(film(more))) == alike


def test_an_arm_counts_in_the_few_frames_in_which_it_is_not_the_background():
    """It rests for most of the clip, and flicker in its old place is no arm."""
    frames = film(60)
    rests = np.concatenate([frames, np.repeat(frames[-1:], 90, axis=0)]).astype(float)
    rests[60::2, 40:, :60] += 8
    assert light.measured(rests.astype(np.uint8))[1] > 50


def test_light_that_changes_and_what_is_smaller_than_an_arm_are_no_arm():
    still = film(0)
    fades = still * np.linspace(0.9, 1.1, len(still))[:, None, None, None]
    for frames in (still, np.clip(fades, 0, 255).astype(np.uint8), film(18, wide=4)):
        assert np.isnan(light.measured(frames)[1]) and light.poor(frames) == ""


def test_an_arm_differs_by_as_much_while_the_light_changes():
    """As by a window in front of which a cloud moves away: 32 levels in all."""
    wall = np.full((96, 160, 3), 120, np.uint8)
    frames = np.concatenate([film(0, room=wall), film((10, 25, -5), room=wall)])
    day = np.linspace(-16, 16, len(frames)).round()[:, None, None, None]
    bright, differs = light.measured(np.uint8(frames + day))
    assert bright == pytest.approx(120, abs=1) and differs == pytest.approx(25, abs=3)


@pytest.mark.parametrize("name", TASKS)
def test_nothing_is_said_of_the_kits_own_films(name):
    frames, _ = video.read(VIDEOS / name / "expert_01.mp4")
    assert light.poor(frames) == ""
