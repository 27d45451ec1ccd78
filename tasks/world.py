"""What the five tasks share: table, wall, camera, light, the arm, and Gymnasium's reset, step,
render.

A task file subclasses `TaskEnv` and says what stands on the table, when it is done, and how an
expert does it. The camera looks from the side along y: x goes right in the image, z up. Lengths in
metres.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from typing import NamedTuple

import cv2
import gymnasium as gym
import numpy as np


@contextlib.contextmanager
def _silence():
    """PyBullet prints a line from C when it is imported, and one for every client."""
    sys.stdout.flush()
    keep, null = (os.dup(1), os.dup(2)), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    try:
        yield
    finally:
        ctypes.CDLL(None).fflush(None)  # C still holds the line when stdout is a file
        for stream, copy in enumerate(keep, start=1):
            os.dup2(copy, stream)
            os.close(copy)
        os.close(null)


with _silence():
    import pybullet
    from pybullet_utils.bullet_client import BulletClient

from tasks.arm import KP, Arm  # noqa: E402 (after the silenced import)

SIZE = 84  # pixels, both sides of every frame
# the renderer does not smooth edges; averaging lets a frame show motion below a pixel
SUPERSAMPLE = 2
DT = 1 / 250  # s, one simulation step
SUBSTEPS = 10  # simulation steps per control step: 25 Hz
TABLE_FRICTION = 1.0  # Bullet multiplies it with the object's own
# m, half the thickness of gripper and fingers: what the tip stands behind a thing it pushes
FINGER = 0.012

CAMERA_PITCH, CAMERA_FOV = -12.0, 25.0  # degrees

LOW = 0.035  # m above the lowest tip: here a tip beside an object touches it

RED, GREEN = (0.78, 0.12, 0.10, 1), (0.15, 0.60, 0.25, 1)
# Middle tones: a tanh decoder saturates on white, and translation swaps extreme wall and table
# tones.
LOOKS = {
    "robot": {
        "wall": (0.56, 0.60, 0.64, 1),
        "table": (0.36, 0.38, 0.42, 1),
        "light": (0.3, -1.0, 1.6),
    },
    "human": {
        "wall": (0.68, 0.63, 0.54, 1),
        "table": (0.50, 0.36, 0.25, 1),
        "light": (-0.5, -1.0, 1.4),
    },
}


class Leg(NamedTuple):
    """A leg of the expert's way: the tip is at `end` (m) after `seconds`."""

    end: np.ndarray
    seconds: float
    # its speed decides: a human's leg that is never bent, slower, or followed by a rest
    dosed: bool = False


class World:
    """One PyBullet client with wall and table, its camera, and the shapes tasks are built from.

    camera: the point it looks at, in m, and its distance from there.
    """

    def __init__(self, embodiment: str, camera: tuple[tuple[float, float, float], float]):
        with _silence():
            self.p = BulletClient(connection_mode=pybullet.DIRECT)
        self.client = self.p._client  # PyBullet's number for it
        look = LOOKS[embodiment]
        self.p.setGravity(0, 0, -9.81)
        self.p.setPhysicsEngineParameter(fixedTimeStep=DT, deterministicOverlappingPairs=1)
        self.table = self.box((0.80, 0.30, 0.02), (0.80, 0, -0.02), look["table"])
        self.p.changeDynamics(self.table, -1, lateralFriction=TABLE_FRICTION)
        self.view = self.p.computeViewMatrixFromYawPitchRoll(
            *camera, yaw=0, pitch=CAMERA_PITCH, roll=0, upAxisIndex=2
        )
        self.projection = self.p.computeProjectionMatrixFOV(CAMERA_FOV, 1.0, 0.3, 3.0)
        self.light = look["light"]
        size = SIZE * SUPERSAMPLE
        shade = np.linspace(1.06, 0.94, size)[:, None, None]  # lighter near the ceiling
        self.backdrop = np.uint8(np.broadcast_to(shade * look["wall"][:3] * 255, (size, size, 3)))
        self.depth = np.full((size, size), 0.999, np.float32)  # 1 is where nothing is

    def paint(self) -> None:
        """Take what has been built so far as scenery: it is rendered now, with its depth, and never
        again."""
        self.scenery = [self.p.getBodyUniqueId(i) for i in range(self.p.getNumBodies())]
        self.backdrop, self.depth = self._composite()
        self.show_scenery(False)

    def show_scenery(self, visible: bool) -> None:
        """Show the scenery to whoever reads the scene, like the 3-D viewer, or leave it to the
        backdrop."""
        for body in self.scenery:
            rgba = (*self.p.getVisualShapeData(body)[0][7][:3], float(visible))
            self.p.changeVisualShape(body, -1, rgbaColor=rgba)

    def box(self, half, position, rgba, mass=0.0, solid=True) -> int:
        """Add a box of half extents `half`; static where `mass` (kg) is 0, untouchable if not
        solid."""
        return self._body("box", half, position, rgba, mass, solid)

    def cylinder(self, radius, height, position, rgba, mass=0.0, solid=True) -> int:
        """Add an upright cylinder."""
        return self._body("cylinder", (radius, height), position, rgba, mass, solid)

    def sphere(self, radius, position, rgba, mass=0.0, solid=True) -> int:
        """Add a ball."""
        return self._body("sphere", (radius,), position, rgba, mass, solid)

    def _body(self, kind, size, position, rgba, mass, solid):
        visual, collision = self._shapes(kind, size, rgba, solid)
        body = self.p.createMultiBody(mass, collision, visual, position)
        self._undamp(body)
        return body

    def assembly(self, parts, position, slides=None) -> int:
        """Add one movable body of several parts (kind, size, place, rgba, mass, solid), fixed to
        each other.

        kind and size as above, place relative to `position`. With `slides`, an axis, the whole
        hangs on a prismatic joint, number 0, of a base that stands fast.
        """
        shapes = [self._shapes(kind, size, rgba, solid) for kind, size, _, rgba, _, solid in parts]
        visual, collision = ([pair[i] for pair in shapes] for i in (0, 1))
        place, mass = [part[2] for part in parts], [part[4] for part in parts]
        base = (0, -1, -1) if slides else (mass.pop(0), collision.pop(0), visual.pop(0))
        if not slides:
            position, first = np.add(position, place[0]), place.pop(0)
            place = [np.subtract(x, first) for x in place]
        n, joints = len(mass), [self.p.JOINT_FIXED] * len(mass)
        parents = [0] * n
        if slides:
            joints[0], parents[1:] = self.p.JOINT_PRISMATIC, [1] * (n - 1)
            place[1:] = [np.subtract(x, place[0]) for x in place[1:]]
        body = self.p.createMultiBody(
            *base, basePosition=position, linkMasses=mass, linkCollisionShapeIndices=collision,
            linkVisualShapeIndices=visual, linkPositions=place, linkOrientations=[(0, 0, 0, 1)] * n,
            linkInertialFramePositions=[(0, 0, 0)] * n, linkInertialFrameOrientations=[(0, 0, 0, 1)] * n,
            linkParentIndices=parents, linkJointTypes=joints, linkJointAxis=[slides or (0, 0, 1)] * n,
        )  # fmt: skip
        self._undamp(body)
        return body

    def _shapes(self, kind, size, rgba, solid):
        p = self.p
        kind, look, touch = {
            "box": lambda half: (p.GEOM_BOX, {"halfExtents": half}, {"halfExtents": half}),
            "cylinder": lambda s: (
                p.GEOM_CYLINDER, {"radius": s[0], "length": s[1]}, {"radius": s[0], "height": s[1]},
            ),
            "sphere": lambda s: (p.GEOM_SPHERE, {"radius": s[0]}, {"radius": s[0]}),
        }[kind](size)  # fmt: skip
        visual = p.createVisualShape(kind, rgbaColor=rgba, specularColor=(0, 0, 0), **look)
        return visual, p.createCollisionShape(kind, **touch) if solid else -1

    def _undamp(self, body):
        # Bullet's default damping of 0.04 would brake a sliding object besides friction.
        for link in range(-1, self.p.getNumJoints(body)):
            self.p.changeDynamics(body, link, linearDamping=0, angularDamping=0, jointDamping=0)

    def take_apart(self) -> None:
        """Put all that moves freely where nothing touches."""
        for i in range(self.p.getNumBodies()):
            body = self.p.getBodyUniqueId(i)
            if self.p.getDynamicsInfo(body, -1)[0] > 0:  # neither scenery nor an arm nor a rail
                self.p.resetBasePositionAndOrientation(body, (0, 10 + i, 10), (0, 0, 0, 1))

    def render(self) -> np.ndarray:
        """The camera's picture, (84, 84, 3) uint8 RGB."""
        return cv2.resize(self._composite()[0], (SIZE, SIZE), interpolation=cv2.INTER_AREA)

    def _composite(self):
        """What moves, rendered over the backdrop at SUPERSAMPLE times the size, and the depth of it
        all."""
        size = SIZE * SUPERSAMPLE
        _, _, rgba, depth, _ = self.p.getCameraImage(
            size, size, self.view, self.projection, lightDirection=self.light, shadow=0,
            lightAmbientCoeff=0.65, lightDiffuseCoeff=0.35, lightSpecularCoeff=0.0,
            renderer=self.p.ER_TINY_RENDERER, flags=self.p.ER_NO_SEGMENTATION_MASK,
        )  # fmt: skip
        depth = np.asarray(depth, np.float32).reshape(size, size)
        seen = depth < self.depth
        picture = self.backdrop.copy()
        picture[seen] = np.asarray(rgba, np.uint8).reshape(size, size, 4)[seen, :3]
        return picture, np.minimum(depth, self.depth)

    def position(self, body: int) -> np.ndarray:
        """Centre of a body, (3,) in m."""
        return np.array(self.p.getBasePositionAndOrientation(body)[0])

    def pixel(self, point) -> np.ndarray:
        """Where a world point (m) appears in the image: (x right, y down) in pixels."""
        view = np.array(self.view).reshape(4, 4).T
        projection = np.array(self.projection).reshape(4, 4).T
        clip = projection @ view @ np.append(point, 1.0)
        return (clip[:2] / clip[3] * (1, -1) + 1) / 2 * SIZE


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
    # m: half a metre fills the image, a 5 cm object is 8 pixels wide
    CAMERA = ((0.56, 0.0, 0.145), 1.15)
    KP = KP  # 1/s^2, stiffness of the arm's tip
    WORKSPACE = ((0.42, -0.01, 0.015), (0.74, 0.01, 0.17))  # m, box of the tip's goal
    START = (0.46, 0.0, 0.12)  # m, the tip at reset
    CONTACT = None  # m along x from tip to object when they touch; None where nothing is touched

    def __init__(self, embodiment="robot", render_mode=None, observation="rgb", jitter=0.0):
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

    # What a task file writes
    # ------------------------------------------------------------------------

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

    # Gymnasium
    # --------------------------------------------------------------------------------------

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.world.p.restoreState(self._apart)
        # Bullet forgets contacts of the last episode only so
        self.world.p.performCollisionDetection()
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

    def put(self, body, position, half, height, span=None) -> None:
        """Stand a body of that half width and height (m) at `position`; with `span`, anywhere along
        x in it where it is clear of the arm."""
        if span is not None:
            x, tip = self.np_random.uniform(*span), self.arm.goal
            if abs(x - tip[0]) < half + 2 * FINGER and tip[2] < height + 0.02:
                x = max(span, key=lambda end: abs(end - tip[0]))
            position[0] = x
        self.world.p.resetBasePositionAndOrientation(body, position, (0, 0, 0, 1))

    def _stand_beside(self):
        """Put the tip low and next to the object, if it is in reach: a task is about contact, and
        chance brings little."""
        x, low, high = self.object_position()[0], self.WORKSPACE[0][0], self.WORKSPACE[1][0]
        aside = self.np_random.uniform(self.CONTACT, self.CONTACT + 0.05)
        side = self.np_random.choice([-1, 1], p=[0.65, 0.35])
        if not low < x + side * aside < high:
            side = -side
        if low < x + side * aside < high:
            z = self.WORKSPACE[0][2] + self.np_random.uniform(0, LOW)
            self.arm.reset(np.array([x + side * aside, 0, z]))

    def step(self, action):
        action = np.clip(np.asarray(action, float), -1, 1)
        x = self.arm.tip_pose()[0]
        goal = self.arm.goal + self.STEP * action
        # the goal must not run away from a stuck tip
        goal = np.clip(goal, x - self.LEASH, x + self.LEASH)
        self.arm.goal = np.clip(goal, *self.WORKSPACE)
        self.arm.prepare()
        for _ in range(SUBSTEPS):
            self.arm.actuate()
            self.world.p.stepSimulation()
        info = self._info()
        return self._observe(), float(info["is_success"]), False, False, info

    def render(self):
        return self.world.render() if self.render_mode == "rgb_array" else None

    def close(self):
        if self.world is not None:
            self.world.p.disconnect()
            self.world = None

    def _observe(self):
        if self.observation == "rgb":
            return self.world.render()
        parts = self.arm.tip_pose()[0], self.object_position(), self.target_position()
        return np.concatenate(parts).astype(np.float32)

    def _info(self):
        return {"is_success": bool(self.is_success())}

    def distance(self) -> float:
        """From the object to where it has to get, in m."""
        return np.linalg.norm(self.object_position() - self.target_position())

    def true_pixels(self) -> np.ndarray:
        """(4,): the tip's and the object's place in the image, in pixels; for plots and tests
        only."""
        points = self.arm.tip_pose()[0], self.object_position()
        return np.concatenate([self.world.pixel(point) for point in points])


def expert_actions(env: TaskEnv, rng: np.random.Generator | None = None):
    """Yield the actions that lead the tip along the task's waypoints; human-like with an `rng`.

    Each leg follows a minimum-jerk profile (Flash and Hogan 1985). With `rng` the legs bend, take
    uneven time, and sometimes end in a short pause.
    """
    start = env.arm.goal.copy()
    for end, seconds, dosed in env.waypoints():
        bend, human = np.zeros(3), rng is not None and not dosed
        if human:
            seconds *= rng.uniform(0.9, 1.15)
            bend[[0, 2]] = rng.uniform(-1, 1, 2) * 0.08 * abs(end - start)[[2, 0]]
        steps = max(1, round(seconds / (DT * SUBSTEPS)))
        for i in range(1, steps + 1):
            s = i / steps
            s = s**3 * (10 - 15 * s + 6 * s * s)
            wanted = start + s * (end - start) + np.sin(np.pi * s) * bend
            yield np.clip((wanted - env.arm.goal) / env.STEP, -1, 1).astype(np.float32)
        start = np.asarray(end, float)
        if human and rng.random() < 0.4:
            for _ in range(rng.integers(1, 4)):
                yield np.zeros(3, np.float32)


def random_actions(rng: np.random.Generator, towards: float = 0.0):
    """Yield random actions for ever, each held for 4 to 12 steps, so that the arm gets about and
    bumps into things; independent ones would tremble on the spot. `towards` -1 or 1 draws the step
    along x from that half, and keeps the height."""
    low, high = np.array([-1, -1, -1.0]), np.array([1, 1, 0.6])  # mostly low, where things are
    if towards:
        low[[0, 2]] = min(towards, 0), -0.4
        high[[0, 2]] = max(towards, 0), 0.2
    while True:
        action = rng.uniform(low, high).astype(np.float32)
        for _ in range(rng.integers(4, 13)):
            yield action


def record_random(env: TaskEnv, frames: int, seed: int, take: int = 25):
    """Film `frames` frames of random motion in takes of `take` frames, the object put anew for
    each.

    A take that starts next to the object moves towards it for its first half. Returns the frames
    (T, 84, 84, 3) uint8 and the true pixels (T, 4) of tip and object.
    """
    rng = np.random.default_rng(seed)
    film, truth = [], []
    while len(film) < frames:
        film.append(env.reset(seed=int(rng.integers(2**31)), options={"scatter": True})[0])
        truth.append(env.true_pixels())
        gap = env.object_position() - env.arm.goal
        low = env.arm.goal[2] < env.WORKSPACE[0][2] + LOW
        beside = env.CONTACT and abs(gap[0]) < env.CONTACT + 0.05 and low
        seek, roam = random_actions(rng, np.sign(gap[0])), random_actions(rng)
        for i in range(1, take):
            film.append(env.step(next(seek if beside and i < take / 2 else roam))[0])
            truth.append(env.true_pixels())
    return np.stack(film[:frames]), np.stack(truth[:frames])


def record_expert(env: TaskEnv, seed: int):
    """Film one human-like expert episode. Returns frames, true pixels, and whether it succeeded."""
    film = [env.reset(seed=seed)[0]]
    truth, done = [env.true_pixels()], False
    for action in expert_actions(env, np.random.default_rng(seed)):
        frame, _, _, _, info = env.step(action)
        film.append(frame)
        truth.append(env.true_pixels())
        done = info["is_success"]
    return np.stack(film), np.stack(truth), done
