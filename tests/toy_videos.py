"""Toy videos of two domains for the translations' tests, and a training that is killed."""

import numpy as np

from lbw_minimal.training import Checkpoint


def squares():
    """A square that moves, dark on light for the human, light on dark for the robot."""
    human, robot = np.full((20, 84, 84, 3), 150, np.uint8), np.full((20, 84, 84, 3), 100, np.uint8)
    for t in range(20):
        human[t, 40:52, 3 * t : 3 * t + 12] = (60, 60, 160)
        robot[t, 3 * t : 3 * t + 12, 40:52] = (200, 160, 60)
    return human, robot


class Killed(Exception):
    pass


class DiesAfter(Checkpoint):
    """Saves at every step and kills the training after some."""

    def __init__(self, path, steps):
        super().__init__(path, seconds=0)
        self.left = steps

    def save(self, make_state, force=False):
        super().save(make_state, force=True)
        self.left -= 1
        if not self.left:
            raise Killed
