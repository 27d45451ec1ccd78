"""Stories that the tasks' experts do not tell, for `strange_scenes.py`: one for each kind of clip.

A story is a list of moments, 25 a second, in metres. Where physics would not do what is told, arm
and thing are put where the story has them: the arm by its inverse kinematics.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from tasks.drawer import FRONT, REACH
from tasks.world.arm import Arm
from tasks.world.env import TaskEnv
from tasks.world.scene import FPS
from tests.strange_cameras import ease

FAR_AWAY = (0, 50, 0)  # m, behind all that a camera sees
NOWHERE = np.full(3, np.nan)  # the place of an arm that is not in the picture
MIDDLE = (0.60, 0.0)  # m: x and y, about which the tasks' hands are at work
SHOULDER = 0.48, 0.44  # m: how far from there, and how high, the shoulder is


class Moment(NamedTuple):
    """Where things are, (3,) m each."""

    tip: np.ndarray
    thing: np.ndarray
    other: np.ndarray = NOWHERE  # the tip of a second person
    lamp: bool = True  # whether what moves by itself does so


class TurnedArm(Arm):
    """The human's arm that stands anywhere about a point and looks at it, for poses alone."""

    turn = np.eye(3)

    def stand(self, middle, degrees, tilt=0.0):
        """Stand about `middle` (3,) m, turned by so many degrees seen from above, 0 as the kit's.

        tilt: rad, by which the hand points forwards.
        """
        a, (far, high) = np.radians(degrees), SHOULDER
        self.turn = np.array([(np.cos(a), -np.sin(a), 0), (np.sin(a), np.cos(a), 0), (0, 0, 1)])
        lean = np.array([(np.cos(tilt), 0, -np.sin(tilt)), (0, 1, 0),
                         (np.sin(tilt), 0, np.cos(tilt))])  # fmt: skip
        self.down = self.turn @ lean @ np.array(self.spec.down)
        base = (*middle[:2], 0) + self.turn @ (-far, 0, high)
        turned = self.p.getQuaternionFromEuler((0, 0, a))
        self.p.resetBasePositionAndOrientation(self.body, base, turned)

    def jacobian(self, q):
        """Bullet's is that of the arm's own base, whichever way that looks."""
        ahead = super().jacobian(q)
        return np.concatenate([self.turn @ ahead[:3], self.turn @ ahead[3:]])

    def put(self, tip):
        """Put the tip there (3,) m; out of sight if it is nowhere."""
        if np.isnan(tip).any():
            self.p.resetBasePositionAndOrientation(self.body, FAR_AWAY, (0, 0, 0, 1))
        else:
            self.reset(np.asarray(tip, float))


def put_thing(env: TaskEnv, at: np.ndarray) -> None:
    """Put the thing there (3,) m, upright; of a drawer its grip."""
    name = type(env).__name__
    if name == "Drawer":
        env.world.p.resetJointState(env.drawer, 0, at[0] - FRONT + REACH)
    elif name != "Reach":
        body = getattr(env, {"Push": "cube", "Slide": "puck", "Coffee": "mug"}[name])
        env.world.p.resetBasePositionAndOrientation(body, at, (0, 0, 0, 1))


def way(*points, seconds):
    """A way (N, 3) m over points, rests where two are alike, each part in so many seconds."""
    parts = [np.array([points[0]], float)]
    for (a, b), s in zip(pairwise(points), seconds, strict=True):
        share = ease(np.arange(1, max(2, round(s * FPS)) + 1) / max(2, round(s * FPS)))
        parts.append(np.asarray(a) + share[:, None] * np.subtract(b, a))
    return np.concatenate(parts)


def story(rng, env: TaskEnv, kind: str, done: list[Moment]) -> list[Moment]:
    """What happens in a clip of a kind, as soon as `env` is reset; done: the task as it is done."""
    start, goal = env.object_position(), env.target_position()
    if env.CONTACT is not None:
        goal = np.array([goal[0], *start[1:]])
    if kind == "still":
        tip = np.array(env.START) if rng.random() < 0.5 else NOWHERE
        return [Moment(tip, start, lamp=False)] * round(rng.uniform(1.5, 3) * FPS)
    if kind == "no arm":
        return [Moment(NOWHERE, moment.thing) for moment in done]
    if kind == "two people":
        return _two_people(rng, env, done)
    if kind == "steep":  # of a reach; others are filmed from the front
        above = goal + (rng.uniform(-0.03, 0.03), 0, rng.uniform(0.2, 0.26))
        tip = way(above, above, goal + (0, 0, 0.02), goal + (0, 0, 0.02),
                  seconds=(0.4, rng.uniform(0.9, 1.6), 0.4))  # fmt: skip
        return [Moment(x, start) for x in tip]
    return {"never moves": _never_moves, "hidden": _hidden, "pulled": _pulled, "lifted": _lifted}[
        kind
    ](rng, env, start, goal)


def top(env):
    """How high, in m, a hand has to be to go over the thing."""
    return {"Drawer": 0.15, "Coffee": 0.075, "Slide": 0.05}.get(type(env).__name__, 0.06)


def _never_moves(rng, env, start, goal):
    """A hand stops short of the thing, goes over it, or does so and comes back."""
    first, far = np.array(env.START), min(goal[0] - start[0], 0.13)
    over = rng.random() < 0.5
    if over:
        near = start + (-0.03, 0, top(env) - start[2] + rng.uniform(0.02, 0.05))
        there = near + (0.03 + far, 0, rng.uniform(-0.01, 0.02))
    else:
        near = start + (-env.CONTACT - rng.uniform(0.05, 0.06), 0, rng.uniform(0, 0.05))
        there = near + (rng.uniform(0.01, 0.03), 0, rng.uniform(-0.01, 0.02))
    ends = [near, there, near] if rng.random() < 0.5 else [near, there, there]
    tip = way(first, first, *ends, seconds=(0.4, 0.9, *rng.uniform(0.7, 1.2, 2)))
    return [Moment(x, start) for x in tip]


def _hidden(rng, env, start, goal):
    """The arm comes from the camera's side, and the hand stays before the thing."""
    goal = start + (min(goal[0] - start[0], 0.18), 0, 0)
    before = np.array([rng.uniform(-0.01, 0.01), -rng.uniform(0.065, 0.08), 0.015 - start[2]])
    pushed = rng.uniform(0.8, 1.4)
    thing = way(start, start, goal, goal, seconds=(1.6, pushed, 0.8))
    first = start + (-0.12, -0.06, rng.uniform(0.12, 0.18))
    tip = way(first, first, start + before, start + before, goal + before, goal + before,
              seconds=(0.4, 1.0, 0.2, pushed, 0.8))  # fmt: skip
    return [Moment(*both) for both in zip(tip, thing, strict=True)]


def _pulled(rng, env, start, goal):
    """The hand hooks the thing from beyond, or holds it from above, and draws it to the arm."""
    far = min(goal[0] - start[0], 0.15)
    there, pulled = start + (far, 0, 0), rng.uniform(0.9, 1.5)
    name = type(env).__name__
    if name == "Drawer":
        hold = np.array([0.02, 0, 0.024])  # on the handle
    elif name == "Coffee" or rng.random() < 0.3:
        hold = np.array([0, 0, top(env) - start[2] - 0.03])
    else:
        hold = np.array([env.CONTACT, 0, env.PUSH_AT - start[2]])
    first, above = np.array(env.START), there + hold + (0, 0, 0.06)
    thing = way(there, there, start, start, seconds=(1.6, pulled, 0.5))
    tip = way(first, first, above, there + hold, start + hold, start + hold,
              seconds=(0.3, 0.9, 0.4, pulled, 0.5))  # fmt: skip
    return [Moment(*both) for both in zip(tip, thing, strict=True)]


def _lifted(rng, env, start, goal):
    """The hand takes the thing from above, carries it in a bow and puts it down."""
    far = min(goal[0] - start[0], 0.14)
    hold = np.array([0, 0, top(env) - start[2] - 0.03])
    carried = rng.uniform(1.0, 1.6)
    share = ease(np.arange(1, round(carried * FPS) + 1) / round(carried * FPS))[:, None]
    bow = 4 * share * (1 - share) * (0, 0, rng.uniform(0.5, 0.9) * far)
    aloft = start + share * (far, 0, 0) + bow
    first = np.array(env.START)
    before = way(first, first, start + hold, start + hold, seconds=(0.3, 0.9, 0.2))
    after = np.repeat(aloft[-1:], round(0.6 * FPS), 0)
    thing = np.concatenate([np.repeat(start[None], len(before), 0), aloft, after])
    tip = np.concatenate([before, aloft + hold, after + hold])
    return [Moment(*both) for both in zip(tip, thing, strict=True)]


def _two_people(rng, env, done):
    """Somebody on the other side has a hand in it, too."""
    name = type(env).__name__
    place = {
        "Reach": (0.74, 0.1),
        "Drawer": (0.73, 0.15),
        "Coffee": (0.73, 0.2),
        "Slide": (0.98, 0.06),
    }
    x, z = place.get(name, (0.75, 0.03))
    at = np.array([x, 0, z + rng.uniform(0, 0.02)])
    up, aside = at + (0.03, 0, rng.uniform(0.05, 0.1)), at + (rng.uniform(0, 0.03), 0, 0.01)
    n = len(done) / FPS
    other = way(up, up, at, aside, up, seconds=(0.1 * n, 0.25 * n, 0.3 * n, 0.35 * n))
    steps = np.minimum(np.arange(len(done)), len(other) - 1)
    return [m._replace(other=other[k]) for m, k in zip(done, steps, strict=True)]


# Who does it


def people(rng, env, kind: str, told: list[Moment]) -> list[TurnedArm]:
    """The arms of a story, where they stand; the kit's is put out of sight."""
    env.world.p.resetBasePositionAndOrientation(env.arm.body, FAR_AWAY, (0, 0, 0, 1))
    first = TurnedArm(env.world.p, "human", env.WORKSPACE)
    if kind == "hidden":  # it comes from the camera's side
        first.stand((told[0].thing[0] + 0.09, -0.07), rng.uniform(35, 60))
        return [first]
    first.stand(MIDDLE, rng.uniform(-15, 15), rng.uniform(0, 0.4))
    if kind != "two people":
        return [first]
    second = TurnedArm(env.world.p, "human", env.WORKSPACE)
    there = np.median([moment.other for moment in told], axis=0)
    second.stand(there, 180 + rng.uniform(-15, 15), rng.uniform(0, 0.4))
    return [first, second]


class Tool:
    """A stick, a ruler or a spoon in the hand: its end is the tip."""

    def __init__(self, rng, world):
        self.p, lean, long = world.p, rng.uniform(0.1, 0.5), rng.uniform(0.07, 0.14)
        self.up = long * np.array([-np.sin(lean), 0, np.cos(lean)])  # m, from its end to the hand
        whole = long + 0.08  # m: the hand holds the rest
        self.middle = self.up * whole / 2 / long
        self.turned = self.p.getQuaternionFromEuler((0, -lean, 0))
        ink = (*rng.uniform(0.1, 0.95, 3), 1)
        shape = rng.choice(["stick", "ruler", "spoon"])
        if shape == "ruler":
            body = world.box((0.012, 0.002, whole / 2), (0, 0, 0), ink, solid=False)
        else:
            body = world.cylinder(0.005, whole, (0, 0, 0), ink, solid=False)
        self.parts = [(body, self.middle)]
        if shape == "spoon":
            bowl = world.sphere(0.013, (0, 0, 0), ink, solid=False)
            self.parts.append((bowl, np.array([0, 0, 0.013])))

    def put(self, tip):
        """Put its end there, (3,) m."""
        for body, middle in self.parts:
            self.p.resetBasePositionAndOrientation(body, tip + middle, self.turned)


def staged(env, told: list[Moment], arms: list[TurnedArm], tool: Tool | None):
    """Put everything where the moments have it, and yield the tip (3,) m of each."""
    for moment in told:
        if moment.lamp:
            env.move()
        put_thing(env, moment.thing)
        if tool is not None:
            tool.put(moment.tip)
        arms[0].put(moment.tip + (0 if tool is None else tool.up))
        for arm in arms[1:]:
            arm.put(moment.other)
        yield moment.tip
