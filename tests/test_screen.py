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


@pytest.mark.parametrize(("level", "screen"), [(16, True), (15, False), (0, False)])
def test_a_dark_room_is_no_screen(level, screen):
    assert (recorded(page(0.6, level)) is not None) == screen


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
