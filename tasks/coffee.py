"""Coffee: a mug has to be pushed under the outlet of a coffee machine, before a restless wall.

The paper's 300 steps; the rest after Meta-World's coffee-push-v2 (Farama-Foundation/Metaworld,
commit ffe2cd37 of March 2021, metaworld/envs: mujoco/sawyer_xyz/v2/sawyer_coffee_push_v2.py,
assets_v2/objects/assets/mug.xml; the paper names no version): the mug's size and mass, success
within 7 cm. Friction, distance and machine are ours. The human's background is cluttered and moves,
as in the paper's Figure 4. From top to bottom: constants, scene, success, the expert, the recipe.
"""

from __future__ import annotations

import numpy as np

from lbw_minimal.imitate import Recipe
from tasks.world import DT, FINGER, RED, SUBSTEPS, Leg, Part, TaskEnv

HORIZON = 300  # control steps, 12 s: the paper's; Meta-World has had 150, 200 and 500
RADIUS, HEIGHT = 0.028, 0.066  # m, of the mug: Meta-World's
MUG_MASS = 0.11  # kg: Meta-World's
MUG_FRICTION = (
    0.5  # times the table's 1.0 (Meta-World: 1.0): a push at half its height does not tip it
)
HANDLE = (0.020, 0.008, 0.036)  # m: how far it stands out, its thickness, its height
MUG_START = 0.51  # m, along x
OUTLET = 0.69  # m, along x: 18 cm further; Meta-World has 15 to 25 cm
SCATTER = (0.49, 0.69)  # m, where random data puts the mug
SUCCESS = 0.07  # m, distance from mug to outlet: Meta-World's
HEAD, COLUMN = (0.10, 0.19), 0.755  # m: where the machine's head begins and ends, the column's x
MACHINE, METAL = (0.16, 0.20, 0.26, 1), (0.48, 0.50, 0.52, 1)
WALL = 0.28  # m along y, the tiles of the human's kitchen
LAMP, PERIOD = (0.62, 0.10, 0.23), 1.3  # m: its middle, its swing and its height; s: to and fro
SHELF, SHADE = (0.42, 0.30, 0.20, 1), (0.80, 0.70, 0.35, 1)


class Coffee(TaskEnv):
    __doc__ = __doc__
    GOAL = f"the mug's centre gets to within {100 * SUCCESS:g} cm of its place under the outlet"
    STEP = 0.012  # m; with 0.03, one random episode in seven gets the mug there
    WORKSPACE = ((0.42, -0.01, 0.015), (0.66, 0.01, 0.22))
    START = (0.45, 0.0, 0.16)
    CONTACT = RADIUS + FINGER
    PUSH_AT = 0.03

    def furnish(self) -> None:
        head = OUTLET + 0.015  # the hand fits in front of it
        self.world.box((0.05, 0.05, HEAD[1] / 2), (COLUMN + 0.05, 0, HEAD[1] / 2), MACHINE)
        half = ((COLUMN - head) / 2, 0.05, (HEAD[1] - HEAD[0]) / 2)
        self.world.box(half, (head + half[0], 0, sum(HEAD) / 2), MACHINE)
        self.world.cylinder(0.008, 0.02, (OUTLET + 0.023, 0, HEAD[0] - 0.01), METAL)
        self.world.box((0.045, 0.05, 0.001), (COLUMN - 0.045, 0, 0.001), METAL, solid=False)

        if self.embodiment == "human":
            self.clutter()

    def clutter(self) -> None:
        """The human's kitchen: tiles, a shelf with jars, and in front of it a lamp that swings."""
        rng = np.random.default_rng(0)
        for x in np.arange(0.24, 0.90, 0.055):
            for z in np.arange(0.03, 0.50, 0.055):
                tone = np.array([0.68, 0.63, 0.54]) * rng.uniform(0.88, 1.06)
                self.world.box((0.025, 0.002, 0.025), (x, WALL, z), (*tone, 1), solid=False)
        self.world.box((0.20, 0.03, 0.006), (0.60, WALL - 0.04, 0.26), SHELF, solid=False)
        for x in np.arange(0.43, 0.78, 0.055):
            tall = rng.uniform(0.05, 0.10)
            rgba = (*rng.uniform((0.35, 0.35, 0.30), (0.75, 0.65, 0.55)), 1)
            self.world.cylinder(0.02, tall, (x, WALL - 0.04, 0.266 + tall / 2), rgba, solid=False)

    def build(self) -> None:
        if self.embodiment == "human":
            self.lamp = self.world.sphere(
                0.022, (LAMP[0], WALL - 0.08, LAMP[2]), SHADE, solid=False
            )
        out, thick, tall = HANDLE
        bar = (out / 2, thick / 2, thick / 2)
        x = RADIUS + out / 2 - 0.002
        upright = (thick / 2, thick / 2, (tall + thick) / 2)
        self.mug = self.world.fixed(
            [
                Part("cylinder", (RADIUS, HEIGHT), (0, 0, 0), RED, MUG_MASS),
                Part("box", bar, (x, 0, tall / 2), RED, 0.001, solid=False),
                Part("box", bar, (x, 0, -tall / 2), RED, 0.001, solid=False),
                Part("box", upright, (x + out / 2, 0, 0), RED, 0.001, solid=False),
            ],
            (MUG_START, 0, HEIGHT / 2),
        )
        self.world.p.changeDynamics(self.mug, -1, lateralFriction=MUG_FRICTION)

    def place(self, offset: np.ndarray, scatter: bool) -> None:
        start = np.array([MUG_START, 0, HEIGHT / 2]) + offset
        self.put(self.mug, start, RADIUS, HEIGHT, SCATTER if scatter else None)

        self.time = self.np_random.uniform(0, PERIOD)
        self.swing()

    def move(self) -> None:
        self.time += DT * SUBSTEPS
        self.swing()

    def swing(self) -> None:
        """Put the human's lamp where it is at this time."""
        if self.embodiment == "human":
            x = LAMP[0] + LAMP[1] * np.sin(2 * np.pi * self.time / PERIOD)
            self.world.p.resetBasePositionAndOrientation(
                self.lamp, (x, WALL - 0.08, LAMP[2]), (0, 0, 0, 1)
            )

    def object_position(self) -> np.ndarray:
        return self.world.position(self.mug)

    def target_position(self) -> np.ndarray:
        return np.array([OUTLET, 0, HEIGHT / 2])

    def is_success(self) -> bool:
        return self.distance() < SUCCESS

    def waypoints(self) -> list[Leg]:
        behind = self.object_position()[0] - self.CONTACT - 0.025
        end = np.array([OUTLET - self.CONTACT, 0, self.PUSH_AT])
        return [
            Leg(np.array([behind, 0, self.PUSH_AT]), 1.0),
            Leg(end, 1.4),
            Leg(end, 0.2),  # the tip lags its goal by 2 / 20 s
        ]


# With 3,000 policy steps, 33 episodes, a mug in four stopped short: solutions/results/README.md.
RECIPE = Recipe(human_frames=658, robot_frames=4007, policy_steps=5_000)
