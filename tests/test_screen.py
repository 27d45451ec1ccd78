"""What a recording of a screen is refused for."""

import numpy as np
import pytest

from lbw_minimal.clips.paths import Unusable
from lbw_minimal.clips.reader import Clip
from lbw_minimal.clips.screen import recorded
from tasks.commands import prepare
from tasks.commands.choices import Choices


def page(share, white=255):
    """A page (10, 100, 100, 3) whose lowest part, a share of it, is white; text of all greys goes
    up by a line a frame."""
    text = (np.arange(200)[:, None, None] * (3, 5, 7) + np.arange(100)[:, None]) % 200
    frames = np.stack([text[t : t + 100] for t in range(10)]).astype(np.uint8)
    frames[:, round(100 - 100 * share) :] = white
    return frames


def test_a_page_is_told_by_the_one_colour_that_fills_half_of_it():
    assert "one colour fills 60% of the picture" in str(recorded(page(0.6)))
    assert recorded(page(0.48)) is None


def test_coding_changes_a_colour_by_a_grey_level_and_noise_by_more():
    rng = np.random.default_rng(0)
    coded = page(0.6, 253 + rng.integers(0, 2, (60, 100, 3)))
    assert recorded(coded) is not None
    assert recorded(page(0.6, 246 + rng.integers(0, 9, (60, 100, 3)))) is None


def desktop(flat=1.0, *, size=30, white=240, stays=False):
    """A window (10, 100, 100, 3) that is dragged over a wallpaper of many colours; its upper part,
    a share of it, has one colour, and the rest a picture."""
    y, x = np.mgrid[:100, :100]
    wallpaper = np.stack([x, y, (x + y) // 2], -1).astype(np.uint8)
    window = wallpaper[50 : 50 + size, ::-1][:, :size] ^ 128
    window[: round(flat * size)] = white
    frames = np.repeat(wallpaper[None], 10, 0)
    for t, frame in enumerate(frames):
        left = 7 * t * (not stays)
        frame[10 : 10 + size, left : left + size] = window
    return frames


@pytest.mark.parametrize(
    ("film", "screen"),
    [
        (desktop(), True), (desktop(0.6), True), (desktop(0.2), False),
        (desktop(white=10), False),  # dark rooms have black shadows
        (desktop(stays=True), False),
        (desktop(size=8), True), (desktop(size=4), False),  # 0.0064 of the picture; 0.0016
    ],
)  # fmt: skip
def test_a_window_over_a_wallpaper_is_told_by_the_one_colour_of_what_moves(film, screen):
    said = recorded(film)
    assert (said is not None) == screen
    if screen:
        assert "% of what moves in the picture; film an arm with a camera" in str(said)


def test_noise_gives_what_moves_many_colours():
    noise = np.random.default_rng(0).normal(0, 3, (10, 100, 100, 3))
    assert recorded(np.clip(desktop() + noise, 0, 255).astype(np.uint8)) is None


@pytest.mark.parametrize(("level", "screen"), [(16, True), (15, False), (0, False)])
def test_a_dark_room_is_no_screen(level, screen):
    assert (recorded(page(0.6, level)) is not None) == screen


@pytest.mark.parametrize(
    ("colour", "screen"),
    [((200, 0, 0), True), ((0, 0, 255), True), ((16, 2, 1), True), ((15, 15, 15), False)],
)
def test_a_screen_of_a_full_colour_is_no_dark_room(colour, screen):
    """Two of its three levels are as low as those of a shadow."""
    assert (recorded(page(0.6, colour)) is not None) == screen
    assert (recorded(desktop(white=colour)) is not None) == screen


def unusable(result, choices):
    result.warnings.append("The camera trembles.")
    raise Unusable("the camera moves", "put it on a stand")


@pytest.mark.parametrize(
    ("share", "tip", "reason", "warnings"),
    [
        (
            0.6,
            (),
            "it looks like a recording of a screen, since one colour fills 60%",
            ["It is damaged."],
        ),
        (0.3, (), "the camera moves", ["It is damaged.", "The camera trembles."]),
        # who has placed the tip has seen an arm there
        (0.6, ((5.0, 5.0, 0.1),), "the camera moves", ["It is damaged.", "The camera trembles."]),
    ],
)
def test_a_recording_of_a_screen_is_refused_for_that_and_not_for_a_camera(
    share, tip, reason, warnings, monkeypatch
):
    clip = Clip(page(share), np.arange(10) / 25, [], [], ["It is damaged."])
    monkeypatch.setattr(prepare, "read_clip", lambda path, **more: clip)
    monkeypatch.setattr(prepare, "follow", unusable)
    result = prepare.prepare("push", "a.mp4", Choices(tip=tip))
    assert result.why_not.startswith(reason) and result.warnings == warnings
