"""What of a clip's seconds is said to be used, or left out."""

import numpy as np
import pytest

from lbw_minimal.clips.used import left_out, sliver

T = 10 + np.arange(101) / 25  # s, of a clip's steps


@pytest.mark.parametrize(("steps", "said"), [(7, 0), (8, 1)])
def test_what_is_left_out_is_said_from_three_tenths_of_a_second_on(steps, said):
    assert len(left_out(T, 1 + steps, 101)) == said
    assert len(left_out(T, 0, 101 - steps)) == said
    assert left_out(T, 0, 109) == []  # what is used goes on beyond the clip


def test_what_is_left_out_is_said_in_seconds():
    first, last = left_out(T, 26, 51)
    assert first == "The first 1.0 s, before the hand moves within the robot's reach, are left out."
    assert last == "The last 2.0 s, after the end, are left out."


def wanders(used, before, after):
    """A hand (101, 2) that goes `before` pixels until step 40, `used` until 60, then `after`, and
    comes back in each third, so that all its places are near each other."""
    steps = np.repeat([before / 40, used / 20, after / 40], [40, 20, 40])
    return np.cumsum(np.r_[0, steps * np.where(np.arange(100) // 10 % 2, 1, -1)])[:, None] * [
        0.6,
        0.8,
    ]


@pytest.mark.parametrize("before", [0.0, 60.0, 30.0])
@pytest.mark.parametrize(("used", "warned"), [(31, True), (34, False)])
def test_a_hand_that_goes_most_of_its_way_elsewhere_is_warned_of(used, warned, before):
    """A third of its way is little, 0.36 is not."""
    said = sliver(T, wanders(used, before, 60 - before), 40, 60)
    assert bool(said) == warned
    if warned:
        assert said[0].startswith("Of the hand's way only 34% is used, from 11.60 to 12.40 s:")


def test_a_hand_that_comes_and_goes_back_by_the_same_way_is_not():
    comes = np.r_[np.zeros(20), np.linspace(0, 90, 20), np.full(21, 90.0), np.linspace(90, 0, 40)]
    assert sliver(T, np.stack([comes, comes], 1), 20, 40) == []
    assert sliver(T, np.zeros((101, 2)), 20, 40)  # none of it is used
