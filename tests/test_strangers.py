"""`prepare` on clips that no training saw: its verdict is the one that a person would give.

The long form is a measurement, whose numbers stand in solutions/results/README.md.
"""

import functools

import numpy as np
import pytest

from lbw_minimal.clips.detector import Found
from tasks.commands.prepare import prepare
from tests.strange_eyes import looked_at
from tests.strangers import FAULTS, Stranger, judged, stranger, trial

DEVELOPED = 2  # the seed with which prepare was mended
HELD_BACK, COUNT = 21, 36
RIGHT = 0.75  # measured: 30 of 36; the goal is 0.95


@functools.cache
def developed(i):
    return stranger(DEVELOPED, i)


@pytest.mark.parametrize(
    ("i", "kind"),
    [(2, "zoom"), (4, "usable"), (5, "still"), (6, "short"), (9, "usable"),
     (10, "steep"), (15, "usable"), pytest.param(18, "usable", marks=pytest.mark.slow)],
)  # fmt: skip
def test_the_verdict_is_right(i, kind, tmp_path):
    one = developed(i)
    assert one.kind == kind
    assert judged(one, prepare(one.task, one.write(tmp_path)).verdict)


def test_a_clip_is_the_same_whenever_it_is_made():
    first, again = developed(6), stranger(DEVELOPED, 6)
    assert np.array_equal(first.frames, again.frames) and first.task == again.task == "push"


def test_a_verdict_is_right_if_its_reason_is():
    still = developed(5)
    assert judged(still, "not usable: nothing moves in the clip; film an arm that does the task.")
    assert not judged(still, "not usable: the camera moves; put it on a stand.")
    assert not judged(still, "usable")
    assert still.kind in FAULTS


@pytest.mark.slow
def test_most_verdicts_on_clips_of_strangers_are_right():
    told = trial(HELD_BACK, COUNT, show=lambda *line, **how: None)
    assert np.mean([judged(*pair) for pair in told]) >= RIGHT


class Blind:
    """A detector that says nothing of use."""

    def detect(self, frames):
        n = len(frames)
        return Found(np.zeros((n, 2)), np.zeros((n, 2)), np.zeros(n), np.zeros(n))


@pytest.mark.parametrize("task", ["push", "reach"])
def test_the_truth_is_in_the_pixels_of_the_clip_as_it_is_read(task, tmp_path):
    """480 pixels wide are read as 320; a tip beyond the edge is nowhere, as a reach's mark is."""
    frames = np.random.default_rng(0).integers(0, 255, (8, 240, 480, 3), np.uint8)
    tip = np.tile([300.0, 150.0], (8, 1))
    tip[0] = 481, 150
    one = Stranger("usable", task, "painted", frames, 10, tip, tip.copy())
    seen = looked_at(Blind(), one, tmp_path)
    assert seen.unit == pytest.approx(320 / 84)
    assert np.isnan(seen.tip[0]).all() and np.allclose(seen.tip[1:], (200, 100))
    assert (
        np.isnan(seen.object).all() if task == "reach" else np.allclose(seen.object[1:], (200, 100))
    )
    assert one.tip[0, 0] == 481  # the clip's own truth is left as it was
