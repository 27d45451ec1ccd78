"""A task as a Gymnasium environment: reset, step, render, and what a task file has to state.

A task file derives from `TaskEnv` and says what stands on the table, when it is done, and how an
expert does it. Actions move the goal of the arm's tip; the arm follows by its controller.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.error import ClosedEnvironmentError, InvalidAction, ResetNeeded, UnsupportedMode
from gymnasium.utils import EzPickle

from lbw_minimal.clips.retarget import Scene
from tasks.world.arm import KP, Arm
from tasks.world.scene import FINGER, LOOKS, SIZE, SUBSTEPS, World

LOW = 0.035  # m above the lowest tip: here a tip beside an object touches it
MOST_JITTER = 0.05  # m: with more the tip could start in an object
TOUCH = 0.001  # m: a start in deeper contact throws arm and object apart


class Leg(NamedTuple):
    """A leg of the expert's way: the tip is at `end` (m) after `seconds`."""

    end: np.ndarray
    seconds: float
    # Speed decides here: a human's leg is then never bent or slowed, and no rest follows it.
    exact: bool = False


class TaskEnv(gym.Env, EzPickle):
    """A task of the paper as a Gymnasium environment.

    Observation: (84, 84, 3) uint8 RGB; with `observation="state"` the simulator's truth instead,
    (tip, object, target) in metres, for lessons and tests only: the method never uses it. Action:
    (3,) in [-1, 1], a step of the tip's goal along x, y, z, at full action `STEP` metres; what is
    beyond 1 counts as 1. `embodiment`: "robot" or "human". `jitter`: how far, in metres, the start
    pose may be off the fixed configuration, at most 0.05; the tip stays in its box.
    reset(options={"scatter": True}) puts the object anywhere, for random data.

    An episode is never over because the task is done. It is `terminated`, and
    `info["object_lost"]`, when the object has left the table: nothing that follows can do the task,
    and nothing moves until the next reset. A copy (`copy.deepcopy`, pickle) is a new environment
    with the same arguments and a simulator of its own; reset it first.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 25}

    # Every task states these; the values here are what most tasks use.
    GOAL = ""  # what success is, for the report of a run: "the cube gets ..."
    STEP = 0.03  # m, the tip's goal moves this far per control step at full action
    # How far, in m, the goal may run ahead of the tip. No frame shows the goal: the policy has to
    # infer it from how the tip moved. With 0.05 instead of 0.03, one that saw
    # only z_t solved push in no episode.
    LEASH: float | tuple[float, float, float] = 0.03
    # m: half a metre fills the image; a 5 cm object is 8 pixels wide.
    CAMERA = ((0.56, 0.0, 0.145), 1.15)
    KP = KP  # 1/s^2, stiffness of the arm's tip
    OVERSPEED = 1.0  # times the arm's rated joint speeds, which it may reach
    WORKSPACE = ((0.42, -0.01, 0.015), (0.74, 0.01, 0.17))  # m, box of the tip's goal
    START = (0.46, 0.0, 0.12)  # m, the tip at reset
    # m along x from tip to object when they touch; None where nothing is touched.
    CONTACT: float | None = None
    PUSH_AT = 0.02  # m, the tip's height while it pushes

    def __init__(
        self,
        embodiment: str = "robot",
        render_mode: str | None = None,
        observation: str = "rgb",
        jitter: float = 0.0,
    ):
        if embodiment not in list(LOOKS):
            raise ValueError(f"embodiment={embodiment!r}: choose 'robot' or 'human'.")
        if observation not in ("rgb", "state"):
            raise ValueError(f"observation={observation!r}: choose 'rgb' or 'state'.")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise UnsupportedMode(f"render_mode={render_mode!r}: choose 'rgb_array' or None.")
        if not isinstance(jitter, float | int | np.number) or not 0 <= jitter <= MOST_JITTER:
            raise ValueError(f"jitter={jitter!r}: give metres, from 0 to {MOST_JITTER}.")
        EzPickle.__init__(self, embodiment, render_mode, observation, jitter)
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
        self.arm = Arm(self.world.p, embodiment, self.WORKSPACE, self.KP, self.OVERSPEED)
        self.world.shapes.add(self.arm.body, self.arm.spec.meshes)
        self.build()
        self.world.p.stepSimulation()  # a world that never stepped behaves unlike one that did
        self._fresh = self.world.p.saveState()
        self.world.take_apart()
        self._apart = self.world.p.saveState()
        self._open, self._reset, self._lost = True, False, False

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

    def move(self) -> None:
        """Move what moves by itself, once a control step."""

    # What Gymnasium calls.

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        self._check_open("reset")
        scatter = _scatter(options)
        super().reset(seed=seed)
        self._reset, self._lost = True, False
        self.world.p.restoreState(self._apart)
        self.world.p.performCollisionDetection()  # or Bullet keeps the last episode's contacts
        self.world.p.restoreState(self._fresh)
        offset = self.np_random.uniform(-self.jitter, self.jitter, 4)
        if scatter:
            self.arm.reset(self.np_random.uniform(*self.WORKSPACE))
        else:
            start = np.array(self.START) + (offset[0], 0, offset[1])
            self.arm.reset(np.clip(start, *self.WORKSPACE))
        self.place(np.array([offset[2], offset[3] / 2, 0]), scatter)
        if scatter and self.contact() > TOUCH:
            self.arm.reset(np.array([self.WORKSPACE[0][0] + 0.01, 0, self.arm.goal[2]]))
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
        sides = [s for s in (side, -side) if low < x + s * aside < high]
        if sides:
            before = self.arm.goal
            z = self.WORKSPACE[0][2] + self.np_random.uniform(0, LOW)
            for tip in (*(np.array([x + s * aside, 0, z]) for s in sides), before):
                self.arm.reset(tip)
                if self.contact() <= TOUCH:
                    return

    def contact(self) -> float:
        """How deep, in m, the arm is in whatever it touches; 0 where it touches nothing."""
        p, arm = self.world.p, self.arm
        bodies = [p.getBodyUniqueId(i) for i in range(p.getNumBodies())]
        points = [
            point
            for body in bodies
            for link in arm.spec.reach_links
            if body != arm.body
            for point in p.getClosestPoints(arm.body, body, 0, linkIndexA=arm.links[link])
        ]
        return max((-point[8] for point in points), default=0.0)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        self._check_open("step")
        action = np.clip(_checked(action), -1, 1)
        if not self._reset:
            raise ResetNeeded("step() before reset(): call reset() first.")
        if not self._lost:
            self.move()
            self._follow(action)
            self._lost = bool(self.object_position()[2] < 0)  # the table's top is at 0
        info = self._info()
        return self._observe(), float(info["is_success"]), self._lost, False, info

    def _follow(self, action):
        """A control step of the arm towards the goal that the action moves."""
        x = self.arm.tip_pose()[0]
        goal = self.arm.goal + self.STEP * action
        # The goal must not run away from a stuck tip.
        goal = np.clip(goal, x - self.LEASH, x + self.LEASH)
        self.arm.goal = np.clip(goal, *self.WORKSPACE)
        self.arm.prepare()
        for _ in range(SUBSTEPS):
            self.arm.actuate()
            self.world.p.stepSimulation()
            self.arm.brake()

    def render(self) -> np.ndarray | None:
        self._check_open("render")
        return self.world.render() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        if self._open:
            self.world.p.disconnect()
            self._open = False

    def _check_open(self, call):
        if not self._open:
            raise ClosedEnvironmentError(f"{call}() after close(): make a new environment.")

    def _observe(self):
        if self.observation == "rgb":
            return self.world.render()
        return self.true_state()

    def _info(self):
        return {"is_success": bool(self.is_success()), "object_lost": self._lost}

    def distance(self) -> float:
        """From the object to where it has to get, in m."""
        return float(np.linalg.norm(self.object_position() - self.target_position()))

    def scene(self) -> Scene:
        """The scene in its plane, for a person's clip to be laid into; as it is after a reset."""

        def plane(point):
            return float(point[0]), float(point[2])

        return Scene(
            start=plane(self.object_position()),
            goal=plane(self.target_position()),
            tip=plane(self.START),
            low=plane(self.WORKSPACE[0]),
            high=plane(self.WORKSPACE[1]),
            step=self.STEP,
            contact=self.CONTACT,
            height=self.PUSH_AT,
        )

    def true_state(self) -> np.ndarray:
        """Tip, object and target in metres, (9,) float32; for lessons, recordings and tests."""
        parts = self.arm.tip_pose()[0], self.object_position(), self.target_position()
        return np.concatenate(parts).astype(np.float32)

    def true_pixels(self) -> np.ndarray:
        """Pixels (4,) of tip and object in the image; for plots and tests only."""
        points = self.arm.tip_pose()[0], self.object_position()
        return np.concatenate([self.world.pixel(point) for point in points])


def _scatter(options) -> bool:
    """Whether the reset's options ask for a scattered start. Raises ValueError for any other."""
    if options is None:
        return False
    if not isinstance(options, dict) or not set(options) <= {"scatter"}:
        raise ValueError(f"options={options!r}: the one option is {{'scatter': True}}.")
    if not isinstance(scatter := options.get("scatter", False), bool | np.bool_):
        raise ValueError(f"options={options!r}: 'scatter' is True or False.")
    return bool(scatter)


def _checked(action) -> np.ndarray:
    """The action as an array (3,). Raises InvalidAction if it is not three finite numbers."""
    try:
        array = np.asarray(action)
        right = array.shape == (3,) and array.dtype.kind in "fiu" and np.isfinite(array).all()
    except (TypeError, ValueError, RuntimeError):  # lists of lists, tensors that want a gradient
        right = False
    if not right:
        raise InvalidAction(f"action={action!r}: give three finite numbers in [-1, 1].")
    return array.astype(float)
