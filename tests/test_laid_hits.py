"""What becomes of the hand behind a hit that is laid into a scene, by hand on eight steps."""

import numpy as np
from toy_pushes import HIT

from lbw_minimal.clips import retarget


def test_behind_a_hit_the_hand_stays_low_until_the_object_is_two_centimetres_ahead():
    """It touches with step 2, goes along for 5 cm, rests and rises by a centimetre a step."""
    way = np.array([0, 0, 0.13, 0.2, 0.25, 0.31, 0.5, 0.8])
    start, goal = HIT.start[0], HIT.goal[0]
    behind = start + way * (goal - start) - HIT.contact
    x = np.stack([behind, 0.1 + 0.01 * np.arange(8)], 1)
    x[5:, 0] = behind[4]  # 2.5 cm behind what slides on
    tip, _ = retarget._push(x.copy(), way, HIT, [])
    low, high = HIT.height, HIT.height + 0.01 * (np.arange(8) - 2)
    np.testing.assert_allclose(tip[:, 1], np.where(np.isin(np.arange(8), (2, 3, 4)), low, high))
    np.testing.assert_allclose(tip[:5, 0], behind[:5])
