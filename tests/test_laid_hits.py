"""What becomes of the hand behind a hit that is laid into a scene, by hand on eight steps."""

import numpy as np
from toy_pushes import HIT

from lbw_minimal.clips import retarget


def test_behind_a_hit_the_hand_stays_low_until_the_object_is_two_centimetres_ahead():
    """It touches with step 2, goes along for 9 cm, rests and rises by a centimetre a step."""
    way = np.array([0, 0, 0.13, 0.25, 0.35, 0.44, 0.52, 0.59])
    start, goal = HIT.start[0], HIT.goal[0]
    behind = start + way * (goal - start) - HIT.contact
    x = np.stack([behind, 0.1 + 0.01 * np.arange(8)], 1)
    x[5:, 0] = behind[4]  # 3.7 cm behind what slides on
    tip, _ = retarget._push(x.copy(), way, HIT, [])
    low, high = HIT.height, HIT.height + 0.01 * (np.arange(8) - 2)
    np.testing.assert_allclose(tip[:, 1], np.where(np.isin(np.arange(8), (2, 3, 4)), low, high))
    np.testing.assert_allclose(tip[:5, 0], behind[:5])


def test_a_hand_drives_what_it_hits_until_that_is_fastest_and_then_goes_on_as_it_was_seen():
    """A puck that gets faster for three steps from the touch, and a hand that is seen to lag."""
    way = np.array([0, 0.02, 0.13, 0.2, 0.32, 0.45, 0.55, 0.62])
    start, goal = HIT.start[0], HIT.goal[0]
    behind = start + way * (goal - start) - HIT.contact
    x = np.stack([0.4 + 0.005 * np.arange(8), np.full(8, 0.1)], 1)
    tip, _ = retarget._push(x, way, HIT, [])
    # The longest step is the one from 0.32 of the way on.
    expected = [*behind[2:5], *(behind[4] + 0.005 * np.arange(1, 4))]
    np.testing.assert_allclose(tip[2:, 0], expected)


def test_a_hand_that_has_hit_does_not_go_back_while_the_object_slides():
    way = np.array([0, 0.02, 0.13, 0.25, 0.35, 0.44, 0.52, 0.59])
    x = np.stack([0.5 - 0.01 * np.arange(8), np.full(8, 0.1)], 1)
    tip, _ = retarget._push(x, way, HIT, [])
    np.testing.assert_allclose(tip[2:, 0], HIT.start[0] + 0.13 * 0.41 - HIT.contact)
