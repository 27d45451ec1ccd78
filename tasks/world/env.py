"""A task as a Gymnasium environment: reset, step, render, and what a task file has to state.

A task file derives from `TaskEnv` and says what stands on the table, when it is done, and how an
expert does it. Actions move the goal of the arm's tip; the arm follows by its controller.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from tasks.world.arm import KP, Arm
from tasks.world.scene import FINGER, LOOKS, SIZE, SUBSTEPS, World

LOW = 0.035  # m above the lowest tip: here a tip beside an object touches it


class Leg(NamedTuple):
    """A leg of the expert's way: the tip is at `end` (m) after `seconds`."""

    end: np.ndarray
    seconds: float
    # Speed decides here: a human's leg is then never bent or slower, and no rest follows it.
    dosed: bool = False


class TaskEnv(gym.Env):
    """A task of the paper as a Gymnasium environment.

    Observation: (84, 84, 3) uint8 RGB; with `observation="state"` the simulator's truth instead,
    (tip, object, target) in metres, for lessons and tests only: the method never uses it. Action:
    (3,) in [-1, 1], a step of the tip's goal along x, y, z, at full action `STEP` metres.
    `embodiment`: "robot" or "human". `jitter`: how far, in metres, the start pose may be off the
    fixed configuration. reset(options={"scatter": True}) puts the object anywhere, for random data.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 25}

    # Every task states these; the values here are what most tasks use.
    STEP = 0.03  # m, the tip's goal moves this far per control step at full action
    # How far, in m, the goal may run ahead of the tip. No frame shows the goal: the policy has to
    # infer it from how the tip moved. One that saw z_t alone solved push in no episode with 0.05
    # instead of 0.03.
    LEASH = 0.03
    # m: half a metre fills the image; a 5 cm object is 8 pixels wide.
    CAMERA = ((0.56, 0.0, 0.145), 1.15)
    KP = KP  # 1/s^2, stiffness of the arm's tip
    WORKSPACE = ((0.42, -0.01, 0.015), (0.74, 0.01, 0.17))  # m, box of the tip's goal
    START = (0.46, 0.0, 0.12)  # m, the tip at reset
    # m along x from tip to object when they touch; None where nothing is touched.
    CONTACT: float | None = None

    def __init__(
        self,
        embodiment: str = "robot",
        render_mode: str | None = None,
        observation: str = "rgb",
        jitter: float = 0.0,
    ):
        if embodiment not in LOOKS:
            raise ValueError(f"embodiment={embodiment!r}: choose 'robot' or 'human'.")
        if observation not in ("rgb", "state"):
            raise ValueError(f"observation={observation!r}: choose 'rgb' or 'state'.")
        self.embodiment, self.render_mode = embodiment, render_mode
        self.observation, self.jitter = observation, jitter
        self.action_space = gym.spaces.Box(-1, 1, (3,), np.float32)
        if observation == "rgb":
            self.observation_space = gym.spaces.Box(0, 255, (SIZE, SIZE, 3), np.uint8)
        else:
            self.observation_space = gym.spaces.Box(-np.inf, np.inf, (9,), np.float32)
        self.world = World(embodiment, self.CAMERA)
        self.furnish()
        self.world.paint()
        self.arm = Arm(self.world.p, embodiment, self.KP)
        self.build()
        self.world.p.stepSimulation()  # a world that never stepped behaves unlike one that did
        self._fresh = self.world.p.saveState()
        self.world.take_apart()
        self._apart = self.world.p.saveState()

    # What a task file writes.

    def furnish(self) -> None:
        """Add what never moves to `self.world`."""

    def build(self) -> None:
        """Add what moves to `self.world`."""

    def place(self, offset: np.ndarray, scatter: bool) -> None:
        """Put the objects at their start, moved by `offset` (m), or anywhere if `scatter`."""
        raise NotImplementedError

    def object_position(self) -> np.ndarray:
        """Centre of the thing the task is about, (3,) in m."""
        raise NotImplementedError

    def target_position(self) -> np.ndarray:
        """Where that thing has to get, (3,) in m."""
        raise NotImplementedError

    def is_success(self) -> bool:
        """Whether the task is done now."""
        raise NotImplementedError

    def waypoints(self) -> list[Leg]:
        """The expert's way from the start."""
        raise NotImplementedError

    # What Gymnasium calls.

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        self.world.p.restoreState(self._apart)
        self.world.p.performCollisionDetection()  # or Bullet keeps the last episode's contacts
        self.world.p.restoreState(self._fresh)
        offset = self.np_random.uniform(-self.jitter, self.jitter, 4)
        scatter = bool((options or {}).get("scatter", False))
        if scatter:
            self.arm.reset(self.np_random.uniform(*self.WORKSPACE))
        else:
            self.arm.reset(np.array(self.START) + (offset[0], 0, offset[1]))
        self.place(np.array([offset[2], offset[3] / 2, 0]), scatter)
        if scatter and self.CONTACT and self.np_random.random() < 0.5:
            self._stand_beside()
        return self._observe(), self._info()

    def put(
        self,
        body: int,
        position: np.ndarray,
        half: float,
        height: float,
        span: tuple[float, float] | None = None,
    ) -> None:
        """Stand a body of that half width and height (m) at `position`.

        With `span` it stands anywhere along x in it where it is clear of the arm.
        """
        if span is not None:
            x, tip = self.np_random.uniform(*span), self.arm.goal
            if abs(x - tip[0]) < half + 2 * FINGER and tip[2] < height + 0.02:
                x = max(span, key=lambda end: abs(end - tip[0]))
            position[0] = x
        self.world.p.resetBasePositionAndOrientation(body, position, (0, 0, 0, 1))

    def _stand_beside(self):
        """Put the tip low and next to the object, if in reach: chance brings little contact."""
        x, low, high = self.object_position()[0], self.WORKSPACE[0][0], self.WORKSPACE[1][0]
        aside = self.np_random.uniform(self.CONTACT, self.CONTACT + 0.05)
        side = self.np_random.choice([-1, 1], p=[0.65, 0.35])
        if not low < x + side * aside < high:
            side = -side
        if low < x + side * aside < high:
            z = self.WORKSPACE[0][2] + self.np_random.uniform(0, LOW)
            self.arm.reset(np.array([x + side * aside, 0, z]))

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        action = np.clip(np.asarray(action, float), -1, 1)
        x = self.arm.tip_pose()[0]
        goal = self.arm.goal + self.STEP * action
        # The goal must not run away from a stuck tip.
        goal = np.clip(goal, x - self.LEASH, x + self.LEASH)
        self.arm.goal = np.clip(goal, *self.WORKSPACE)
        self.arm.prepare()
        for _ in range(SUBSTEPS):
            self.arm.actuate()
            self.world.p.stepSimulation()
        info = self._info()
        return self._observe(), float(info["is_success"]), False, False, info

    def render(self) -> np.ndarray | None:
        return self.world.render() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        if self.world is not None:
            self.world.p.disconnect()
            self.world = None

    def _observe(self):
        if self.observation == "rgb":
            return self.world.render()
        return self.true_state()

    def _info(self):
        return {"is_success": bool(self.is_success())}

    def distance(self) -> float:
        """From the object to where it has to get, in m."""
        return float(np.linalg.norm(self.object_position() - self.target_position()))

    def true_state(self) -> np.ndarray:
        """Tip, object and target in metres, (9,) float32; for lessons, recordings and tests."""
        parts = self.arm.tip_pose()[0], self.object_position(), self.target_position()
        return np.concatenate(parts).astype(np.float32)

    def true_pixels(self) -> np.ndarray:
        """Pixels (4,) of tip and object in the image; for plots and tests only."""
        points = self.arm.tip_pose()[0], self.object_position()
        return np.concatenate([self.world.pixel(point) for point in points])
