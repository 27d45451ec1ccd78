"""Reach: a target hangs over the table, and the tip of the arm has to come within 5 cm of it.

After the paper's FetchReach (openai/gym 0.18.0, gym/envs/robotics/fetch/reach.py): success within
5 cm, in 50 steps of 1/25 s. Where the target hangs is ours. From top to bottom: constants, scene,
success, the expert, the recipe.
"""

from __future__ import annotations

import numpy as np

from lbw_minimal.imitate import Recipe
from tasks.world import GREEN, Leg, TaskEnv

HORIZON = 50  # control steps, 2 s: the paper's and Fetch's
RADIUS = 0.018  # m, the ball that marks the target; it cannot be touched
TARGET = (0.68, 0.0, 0.06)  # m
SUCCESS = 0.05  # m, distance from tip to target: Fetch's `distance_threshold`


class Reach(TaskEnv):
    __doc__ = __doc__
    GOAL = f"the tip gets to within {100 * SUCCESS:g} cm of the ball's centre"

    def furnish(self) -> None:
        self.world.sphere(RADIUS, TARGET, GREEN, solid=False)

    def place(self, offset: np.ndarray, scatter: bool) -> None:
        """The target stands still, even in random data: only the arm moves in this task."""

    def object_position(self) -> np.ndarray:
        return self.arm.tip_pose()[0]

    def target_position(self) -> np.ndarray:
        return np.array(TARGET)

    def is_success(self) -> bool:
        return self.distance() < SUCCESS

    def waypoints(self) -> list[Leg]:
        # the tip lags its goal by 2 / 20 s
        return [Leg(np.array(TARGET), 1.0), Leg(np.array(TARGET), 0.2)]


RECIPE = Recipe(human_frames=1056, robot_frames=3150)
