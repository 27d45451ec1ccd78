"""Notebook 3, push: a hand's path, contact, and what random data has to contain."""

import numpy as np
import pybullet as p

from tests.grade.exercise import exercise


@exercise("3.1", "The path of a hand")
def minimum_jerk(t, duration, start, end):
    s = np.clip(t / duration, 0, 1)
    s = s**3 * (10 - 15 * s + 6 * s**2)
    return start + s[:, None] * (end - start)


def _reach(rng):
    T = float(rng.uniform(0.5, 2))
    return np.linspace(0, T, 9), T, rng.normal(size=3), rng.normal(size=3)


minimum_jerk.check("from a place to another", _reach, points=2)
minimum_jerk.check(
    "after its time it stays at the end",
    lambda rng: (np.array([1.5, 2.0, 9.0]), 1.5, rng.normal(size=3), rng.normal(size=3)),
)
minimum_jerk.mistake(
    "The polynomial takes the share of the time, t / T: yours takes seconds.",
    "np.clip(t / duration, 0, 1)",
    "np.clip(t, 0, 1)",
)
minimum_jerk.mistake(
    "A straight share of the time starts and ends with a jolt: use the polynomial.",
    "s**3 * (10 - 15 * s + 6 * s**2)",
    "s",
)
minimum_jerk.mistake(
    "After t = T the polynomial runs away: keep the share between 0 and 1.",
    "np.clip(t / duration, 0, 1)",
    "t / duration",
)
minimum_jerk.mistake("The hand begins at `start`: add the share of the way to it.", "start + ", "")
minimum_jerk.mistake(
    "The polynomial is 10 s^3 - 15 s^4 + 6 s^5: one sign is wrong.", "+ 6 * s**2", "- 6 * s**2"
)


@exercise(
    "3.2",
    "A cube on a table",
    given=("import pybullet as p",),
    probe="""
    import pybullet as p

    def probe(speed):
        client = p.connect(p.DIRECT)
        try:
            p.setGravity(0, 0, -9.81, client)
            p.setTimeStep(1 / 250, client)
            table, cube = make_push(client)
            mu = [p.getDynamicsInfo(body, -1, client)[1] for body in (table, cube)]
            mass = p.getDynamicsInfo(cube, -1, client)[0]
            place = p.getBasePositionAndOrientation(cube, client)[0]
            p.resetBaseVelocity(cube, (speed, 0, 0), physicsClientId=client)
            for _ in range(500):
                p.stepSimulation(client)
            end = p.getBasePositionAndOrientation(cube, client)[0]
            return {"friction": mu[0] * mu[1], "mass": mass, "place": list(place), "slid": end[0] - place[0],
                    "height": end[2]}
        finally:
            p.disconnect(client)
    """,
)
def make_push(client):
    box = p.createCollisionShape(p.GEOM_BOX, halfExtents=(0.8, 0.3, 0.02), physicsClientId=client)
    table = p.createMultiBody(0, box, -1, (0.8, 0, -0.02), physicsClientId=client)
    box = p.createCollisionShape(p.GEOM_BOX, halfExtents=(0.025, 0.025, 0.025), physicsClientId=client)
    cube = p.createMultiBody(0.4, box, -1, (0.53, 0, 0.025), physicsClientId=client)
    p.changeDynamics(table, -1, lateralFriction=1.0, physicsClientId=client)
    p.changeDynamics(cube, -1, lateralFriction=0.6, linearDamping=0, angularDamping=0, physicsClientId=client)
    return table, cube


make_push.check(
    "it stands where it should, and slides as it should",
    lambda rng: (float(rng.uniform(0.3, 0.6)),),
    points=2,
    atol=3e-3,
)
make_push.check("at rest it stays at rest", lambda rng: (0.0,), atol=2e-3)
make_push.mistake(
    "Bullet multiplies both bodies' friction, and a table has 0.5 at birth: set the table's, too.",
    "p.changeDynamics(table, -1, lateralFriction=1.0, physicsClientId=client)",
    "pass",
)
make_push.mistake(
    "halfExtents are half the edges: your cube is twice as large.",
    "halfExtents=(0.025, 0.025, 0.025)",
    "halfExtents=(0.05, 0.05, 0.05)",
)
make_push.mistake(
    "The table's top has to be at z = 0: its middle lies half its thickness below.",
    "(0.8, 0, -0.02)",
    "(0.8, 0, 0)",
)
make_push.mistake(
    "A body of mass 0 stands fast for ever: the cube weighs 0.4 kg.",
    "createMultiBody(0.4",
    "createMultiBody(0",
)
make_push.mistake("Return the table first, then the cube.", "return table, cube", "return cube, table")


@exercise("3.3", "How often does it move?")
def moving_share(x, take, least):
    moved = np.abs(np.diff(x.reshape(-1, take), axis=1)) > least
    return float(moved.mean())


def _takes(rng, take=25, n=8):
    x = np.repeat(rng.uniform(0.5, 0.7, n), take).reshape(n, take)
    for row in x:
        if rng.random() < 0.6:
            start = rng.integers(take - 8)
            row[start:] += np.minimum(np.arange(take - start), 6) * rng.uniform(0.002, 0.01)
    return x.ravel(), take, 0.0005


moving_share.check("eight takes", _takes, points=2)
moving_share.check("takes of another length", lambda rng: _takes(rng, 12, 20))
moving_share.check(
    "nothing ever moves within a take", lambda rng: (np.repeat(rng.uniform(0.5, 0.7, 6), 10), 10, 0.0005)
)
moving_share.mistake(
    "Between two takes the cube is put elsewhere, and nobody pushed it: compare only within a take.",
    "np.diff(x.reshape(-1, take), axis=1)",
    "np.diff(x)",
)
moving_share.mistake(
    "A cube pushed back moves as well: take the absolute difference.", "np.abs(np.diff", "-(np.diff"
)
moving_share.mistake("Return the share of the transitions, not their number.", ".mean()", ".sum()")
moving_share.mistake(
    "You compare with the take's first frame: ask from frame to frame.",
    "np.diff(x.reshape(-1, take), axis=1)",
    "x.reshape(-1, take)[:, 1:] - x.reshape(-1, take)[:, :1]",
)


@exercise("3.4", "From wish to action")
def to_action(wanted, goal, step):
    return np.clip((wanted - goal) / step, -1, 1)


def _wish(rng, far=1.0):
    goal = rng.normal(size=3)
    return goal + rng.uniform(-far, far, 3) * 0.03, goal, 0.03


to_action.check("a place within one step", _wish)
to_action.check("a place far away: full action, no more", lambda rng: _wish(rng, 5.0))
to_action.mistake(
    "An action is at most 1: clip it.", "np.clip((wanted - goal) / step, -1, 1)", "(wanted - goal) / step"
)
to_action.mistake("An action is a share of the largest step: divide by it.", " / step", "")
to_action.mistake(
    "It leads from the goal now to the place wanted; yours leads back.", "wanted - goal", "goal - wanted"
)
to_action.mistake(
    "Clip each coordinate by itself: yours shortens the whole vector.",
    "np.clip((wanted - goal) / step, -1, 1)",
    "(wanted - goal) / step / max(1, np.abs((wanted - goal) / step).max())",
)
