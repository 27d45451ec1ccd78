"""Push: a cube lies on the table, and its centre has to end at the target 15 cm further on.

After the paper's FetchPush (openai/gym 0.18.0, gym/envs/robotics: fetch/push.py,
assets/fetch/push.xml): the cube's size, success within 5 cm, 50 steps. Its mass, its friction and
how far it has to go are ours. The paper says puck, and shows a red cube in its Figure 5: so
ours is red. From top to bottom: constants, scene, success, the expert, the recipe.
"""

from __future__ import annotations

import numpy as np

from lbw_minimal.imitate import Recipe
from tasks.world import FINGER, GREEN, RED, Leg, TaskEnv

HORIZON = 50  # control steps, 2 s: the paper's and Fetch's
CUBE = 0.05  # m, edge: Fetch's
CUBE_MASS = 0.4  # kg (Fetch: 2); a 0.2 kg cube shoots away when it is pinched from above
CUBE_FRICTION = 0.6  # (Fetch: 1.0); at 1.0 a push at half its height tips it over
CUBE_START = 0.53  # m, along x
TARGET = 0.68  # m, along x: 15 cm further; Fetch draws start and target, 17 cm apart on average
SCATTER = (0.50, 0.70)  # m, where random data puts the cube
SUCCESS = 0.05  # m, distance from cube to target: Fetch's `distance_threshold`


class Push(TaskEnv):
    __doc__ = __doc__
    GOAL = f"the cube's centre gets to within {100 * SUCCESS:g} cm of the green disc's"
    CONTACT = CUBE / 2 + FINGER

    def furnish(self) -> None:
        self.world.cylinder(0.03, 0.001, (TARGET, 0, 0.0005), GREEN, solid=False)

    def build(self) -> None:
        self.cube = self.world.box((CUBE / 2,) * 3, (CUBE_START, 0, CUBE / 2), RED, mass=CUBE_MASS)
        self.world.p.changeDynamics(self.cube, -1, lateralFriction=CUBE_FRICTION)

    def place(self, offset: np.ndarray, scatter: bool) -> None:
        start = np.array([CUBE_START, 0, CUBE / 2]) + offset
        self.put(self.cube, start, CUBE / 2, CUBE, SCATTER if scatter else None)

    def object_position(self) -> np.ndarray:
        return self.world.position(self.cube)

    def target_position(self) -> np.ndarray:
        return np.array([TARGET, 0, CUBE / 2])

    def is_success(self) -> bool:
        return self.distance() < SUCCESS

    def waypoints(self) -> list[Leg]:
        behind = self.object_position()[0] - self.CONTACT - 0.025
        end = np.array([TARGET - self.CONTACT, 0, self.PUSH_AT])
        return [
            Leg(np.array([behind, 0, self.PUSH_AT]), 0.6),
            Leg(end, 0.8),
            Leg(end, 0.2),  # the tip lags its goal by 2 / 20 s
        ]


RECIPE = Recipe(human_frames=398, robot_frames=1220)
