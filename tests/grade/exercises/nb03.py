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
    return np.linspace(0, T, rng.integers(6, 16)), T, rng.normal(size=3), rng.normal(size=3)


minimum_jerk.check(
    "from a place to another",
    _reach,
    points=2,
    least=lambda rng: ((r := _reach(rng))[0][2:3], *r[1:]),
)
minimum_jerk.check(
    "after its time it stays at the end",
    lambda rng: (
        (T := float(rng.uniform(0.5, 2))) + np.sort(rng.uniform(0, 5, rng.integers(4, 8))),
        T,
        rng.normal(size=3),
        rng.normal(size=3),
    ),
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
minimum_jerk.mistake(
    "s has one number a time, (n,), a place has three: give s a second dimension, s[:, None].",
    "s[:, None] *",
    "s *",
)
minimum_jerk.mistake(
    "s has one number a time, (n,), a place has three: give s a second dimension, s[:, None].",
    "s[:, None] * (end - start)",
    "(end - start) * s",
)
minimum_jerk.mistake(
    "The coefficients are 10 for s^3 and 6 for s^5: yours are exchanged.",
    "(10 - 15 * s + 6 * s**2)",
    "(6 - 15 * s + 10 * s**2)",
)
minimum_jerk.mistake(
    "From start to end the way is end - start; yours is end alone.", "(end - start)", "end"
)
minimum_jerk.mistake(
    "The hand goes from start to end; yours comes back.", "start, end):", "end, start):"
)
minimum_jerk.mistake(
    "A row is a time and a column a coordinate: (n, 3).",
    "start + s[:, None] * (end - start)",
    "(start + s[:, None] * (end - start)).T",
)
minimum_jerk.mistake("The powers in the polynomial are 3, 4 and 5.", "s**3 * (10", "s * (10")
minimum_jerk.mistake("The hand begins at `start`: add the share of the way to it.", "start + ", "")
minimum_jerk.mistake(
    "The polynomial is 10 s^3 - 15 s^4 + 6 s^5: one sign is wrong.", "+ 6 * s**2", "- 6 * s**2"
)
minimum_jerk.mistake(
    "That polynomial, 3 s^2 - 2 s^3, starts and ends with a jolt: take the one of degree 5.",
    "s**3 * (10 - 15 * s + 6 * s**2)",
    "s**2 * (3 - 2 * s)",
)
minimum_jerk.mistake(
    "Clip the share, not the seconds: t / duration first.",
    "np.clip(t / duration, 0, 1)",
    "np.clip(t, 0, 1) / duration",
)
minimum_jerk.mistake(
    "The share is that of `duration`, not of the last time that is asked for.",
    "t / duration",
    "t / t[-1]",
)


@exercise(
    "3.2",
    "A cube on a table",
    given=("import pybullet as p",),
    probe="""
    import pybullet as p

    STEPS = 100  # 0.4 s; a cube of 0.6 m/s has stopped after 0.2

    def _body(body, client):
        low, high = p.getAABB(body, -1, client)
        place, _ = p.getBasePositionAndOrientation(body, client)
        info = p.getDynamicsInfo(body, -1, client)
        more = dict(zip(("bounce", "rolling friction", "spinning friction"), info[5:8]))
        found = {"mass": info[0], "friction": info[1], "place": np.array(place)}
        return found | {"size": np.subtract(high, low)} | more

    def _world(client):
        bodies = [p.getBodyUniqueId(i, client) for i in range(p.getNumBodies(client))]
        frictions = [p.getDynamicsInfo(body, -1, client)[1] for body in bodies]
        shape = p.createCollisionShape(p.GEOM_SPHERE, radius=1, physicsClientId=client)
        return shape, frictions

    def probe(speed, worlds, ask):
        # A call without physicsClientId=client goes to the first of them.
        other, *more = [p.connect(p.DIRECT) for _ in range(worlds)]
        client = p.connect(p.DIRECT)
        try:
            for _ in range(2):  # what such a call changes there
                p.createMultiBody(1, physicsClientId=other)
            shape, frictions = _world(other)
            p.setGravity(0, 0, -5, client)
            p.setTimeStep(1 / 250, client)
            try:
                bodies = make_push(client)
            finally:
                if _world(other) != (shape + 1, frictions):
                    raise ValueError(
                        "a call went to another world: physicsClientId=client in every one"
                    )
            if p.getNumBodies(client) < 2:
                raise ValueError(
                    "two bodies are not in this world: physicsClientId=client in every call"
                )
            try:
                table, cube = bodies
            except (TypeError, ValueError):
                return bodies
            if ask == "bodies":
                gravity = p.getPhysicsEngineParameters(client)["gravityAccelerationZ"]
                return {
                    "table": _body(table, client), "cube": _body(cube, client),
                    "bodies in this world": p.getNumBodies(client), "gravity in it": gravity,
                }
            if ask == "flight":  # nothing in the way, no weight
                p.setGravity(0, 0, 0, client)
                p.resetBasePositionAndOrientation(cube, (0, 0, 9), (0, 0, 0, 1), client)
            p.resetBaseVelocity(cube, (speed, 0, 0), (0, 0, speed * (ask == "flight")), client)
            for _ in range(STEPS):
                p.stepSimulation(client)
            if ask == "flight":
                v, w = p.getBaseVelocity(cube, client)
                return {
                    "share of its speed after 0.4 s": v[0] / speed,
                    "share of its turning": w[2] / speed,
                }
            end = p.getBasePositionAndOrientation(cube, client)[0]
            return {"slid to x": end[0], "height": end[2]}
        finally:
            for world in (client, other, *more):
                p.disconnect(world)
    """,
)
def make_push(client):
    box = p.createCollisionShape(p.GEOM_BOX, halfExtents=(0.8, 0.3, 0.02), physicsClientId=client)
    table = p.createMultiBody(0, box, -1, (0.8, 0, -0.02), physicsClientId=client)
    box = p.createCollisionShape(
        p.GEOM_BOX, halfExtents=(0.025, 0.025, 0.025), physicsClientId=client
    )
    cube = p.createMultiBody(0.4, box, -1, (0.53, 0, 0.025), physicsClientId=client)
    p.changeDynamics(table, -1, lateralFriction=1.0, physicsClientId=client)
    p.changeDynamics(
        cube, -1, lateralFriction=0.6, linearDamping=0, angularDamping=0, physicsClientId=client
    )
    return table, cube


def _speed(rng, ask):
    return float(rng.uniform(0.3, 0.6)), int(rng.integers(1, 3)), ask


make_push.check(
    "both stand where they should, with mass and friction", lambda rng: _speed(rng, "bodies")
)
make_push.check("it slides as it should", lambda rng: _speed(rng, "slide"), atol=2e-3)
make_push.check(
    "flying free it keeps its speed and its turning", lambda rng: _speed(rng, "flight"), atol=2e-3
)
make_push.mistake(
    "Bullet multiplies both bodies' friction, and a new table has 0.5: set the table's, too.",
    "p.changeDynamics(table, -1, lateralFriction=1.0, physicsClientId=client)",
    "pass",
)
make_push.mistake(
    "halfExtents are half the edges: your cube is twice as large.",
    "halfExtents=(0.025, 0.025, 0.025)",
    "halfExtents=(0.05, 0.05, 0.05)",
)
make_push.mistake(
    "halfExtents are half the edges: your table is twice as large.",
    "halfExtents=(0.8, 0.3, 0.02)",
    "halfExtents=(1.6, 0.6, 0.04)",
)
make_push.mistake(
    "halfExtents are half the edges: your table and your cube are twice as large.",
    "halfExtents=(0.8, 0.3, 0.02)",
    "halfExtents=(1.6, 0.6, 0.04)",
    "halfExtents=(0.025, 0.025, 0.025)",
    "halfExtents=(0.05, 0.05, 0.05)",
)
make_push.mistake(
    "The table's top has to be at z = 0: its middle lies half its thickness below.",
    "(0.8, 0, -0.02)",
    "(0.8, 0, 0)",
)
make_push.mistake("The table's middle is at x = 0.8.", "(0.8, 0, -0.02)", "(0, 0, -0.02)")
make_push.mistake(
    "The cube stands on the table: its middle lies half an edge above z = 0.",
    "(0.53, 0, 0.025)",
    "(0.53, 0, 0)",
)
make_push.mistake(
    "The table has friction 1.0 and the cube 0.6: yours are swapped. The product hides it from a "
    "slide.",
    "table, -1, lateralFriction=1.0",
    "table, -1, lateralFriction=0.6",
    "cube, -1, lateralFriction=0.6",
    "cube, -1, lateralFriction=1.0",
)
make_push.mistake(
    "Bullet damps what moves by itself: linearDamping=0 and angularDamping=0 for the cube.",
    ", linearDamping=0, angularDamping=0",
    "",
)
make_push.mistake(
    "Bullet still damps the cube's turning: angularDamping=0.",
    ", angularDamping=0",
    "",
)
make_push.mistake(
    "Bullet still damps the cube's flight: linearDamping=0.",
    ", linearDamping=0",
    "",
)
make_push.mistake(
    "A body of mass 0 never moves: the cube weighs 0.4 kg.",
    "createMultiBody(0.4",
    "createMultiBody(0",
)
make_push.mistake(
    "The world and its gravity are the caller's: leave setGravity out.",
    "    return table, cube",
    "    p.setGravity(0, 0, -9.81, physicsClientId=client)\n    return table, cube",
)
make_push.mistake(
    "Nothing bounces: leave restitution at 0, as it is.",
    "linearDamping=0, angularDamping=0",
    "linearDamping=0, angularDamping=0, restitution=0.9",
)
make_push.mistake(
    "A table and a cube, and nothing more: yours has a third body.",
    "    return table, cube",
    "    p.createMultiBody(0, box, -1, (0, 0, -1), physicsClientId=client)\n    return table, cube",
)
make_push.mistake(
    "The table's top is at z = 0, not its middle, and the cube stands on it: both of yours are "
    "half the table's thickness too high.",
    "(0.8, 0, -0.02)",
    "(0.8, 0, 0)",
    "(0.53, 0, 0.025)",
    "(0.53, 0, 0.045)",
)
make_push.mistake(
    "Masses are in kilograms: 0.4, not 400.", "createMultiBody(0.4", "createMultiBody(400"
)
make_push.mistake(
    "Return the table first, then the cube.", "return table, cube", "return cube, table"
)
make_push.mistake(
    "halfExtents are half the edges: your cube is twice as large, and its middle as high as that "
    "asks for.",
    "halfExtents=(0.025, 0.025, 0.025)",
    "halfExtents=(0.05, 0.05, 0.05)",
    "(0.53, 0, 0.025)",
    "(0.53, 0, 0.05)",
)
make_push.mistake(
    "halfExtents are half the edges: your table and your cube are twice as large, and their "
    "middles where that asks for.",
    "halfExtents=(0.8, 0.3, 0.02)",
    "halfExtents=(1.6, 0.6, 0.04)",
    "(0.8, 0, -0.02)",
    "(0.8, 0, -0.04)",
    "halfExtents=(0.025, 0.025, 0.025)",
    "halfExtents=(0.05, 0.05, 0.05)",
    "(0.53, 0, 0.025)",
    "(0.53, 0, 0.05)",
)
make_push.mistake(
    "The table has friction 1.0. Bullet multiplies the two: 0.6 on both makes 0.36 where they "
    "touch.",
    "table, -1, lateralFriction=1.0",
    "table, -1, lateralFriction=0.6",
)


@exercise("3.3", "How often does it move?")
def moving_share(x, take, least):
    moved = np.abs(np.diff(x.reshape(-1, take), axis=1)) > least
    return float(moved.mean())


def _takes(rng, take, n, paces=(-5, -2, 2, 8)):
    """Cubes pushed for a while, forth or back, by some `least` a frame. Sums are exact."""
    least = 2.0 ** -int(rng.integers(9, 13))
    x = np.repeat(rng.integers(1024, 1434, n), take).reshape(n, take) * least
    for row in x:
        if rng.random() < 0.8:
            start, pace = rng.integers(take - 8), rng.choice(paces)
            row[start:] += np.minimum(np.arange(take - start), 6) * pace * least
    return x.ravel(), take, least


moving_share.check("a few takes", lambda rng: _takes(rng, 25, int(rng.integers(6, 12))))
moving_share.check(
    "a step of just `least` does not count",
    lambda rng: _takes(rng, 24, int(rng.integers(6, 12)), (-1, 1, 8)),
    least=lambda rng: (0.25 * np.cumsum([1, 2, 1, 0, *rng.integers(0, 3, 2)]), 6, 0.25),
)
moving_share.check(
    "takes of another length", lambda rng: _takes(rng, int(rng.integers(12, 20)), 20)
)
moving_share.check(
    "nothing ever moves within a take",
    lambda rng: (np.repeat(rng.uniform(0.5, 0.7, rng.integers(4, 8)), 10), 10, 0.0005),
)
moving_share.mistake(
    "A row is a take: reshape(-1, take), not reshape(take, -1).",
    "x.reshape(-1, take), axis=1",
    "x.reshape(take, -1), axis=1",
)
moving_share.mistake(
    "Within a take frames follow each other along a row, axis 1; along axis 0 you go from take to "
    "take.",
    "axis=1",
    "axis=0",
)
moving_share.mistake(
    "Between two takes the cube is put elsewhere, and nobody pushed it: compare only within a "
    "take.",
    "np.diff(x.reshape(-1, take), axis=1)",
    "np.diff(x)",
)
moving_share.mistake(
    "A cube pushed back moves as well: take the absolute difference.", "np.abs(np.diff", "(np.diff"
)
moving_share.mistake(
    "More than `least`: a step of just `least` does not count.", "> least", ">= least"
)
moving_share.mistake(
    "A take of n frames has n - 1 transitions: divide by their number, not by that of the frames.",
    "moved.mean()",
    "moved.sum() / len(x)",
)
moving_share.mistake(
    "A video has T - 1 transitions, but those from take to take do not count: divide by the "
    "others.",
    "moved.mean()",
    "moved.sum() / (len(x) - 1)",
)
moving_share.mistake("Return the share of the transitions, not their number.", ".mean()", ".sum()")
moving_share.mistake(
    "The share is that of the transitions, not of the takes in which anything moves.",
    "moved.mean()",
    "moved.any(axis=1).mean()",
)
moving_share.mistake(
    "You compare with the take's first frame: ask from frame to frame.",
    "np.diff(x.reshape(-1, take), axis=1)",
    "x.reshape(-1, take)[:, 1:] - x.reshape(-1, take)[:, :1]",
)
moving_share.mistake(
    "Your loop stops before the last take: the range has to reach the end.",
    "x.reshape(-1, take)",
    "x.reshape(-1, take)[:-1]",
)
moving_share.mistake(
    "The frames of a take are neighbours in x, and reshape fills row by row: x.reshape(-1, take) "
    "has a take in each row.",
    "x.reshape(-1, take)",
    "x.reshape(take, -1).T",
)


@exercise("3.4", "From wish to action")
def to_action(wanted, goal, step):
    return np.clip((wanted - goal) / step, -1, 1)


def _wish(rng, far):
    goal, step = rng.normal(size=3), float(rng.uniform(0.01, 0.08))
    return goal + rng.uniform(-far, far, 3) * step, goal, step


to_action.check("a place within one step", lambda rng: _wish(rng, 0.5))
to_action.check("a place far away: full action, no more", lambda rng: _wish(rng, 5.0))
to_action.mistake(
    "An action is at most 1 and at least -1, and what you return is not: clip last, after the "
    "division by step.",
    "np.clip((wanted - goal) / step, -1, 1)",
    "(wanted - goal) / step",
)
to_action.mistake("The largest step is the argument, not always 3 cm.", "/ step", "/ 0.03")
to_action.mistake(
    "An action is a share of the largest step, not a way in m: divide by step, then clip to "
    "[-1, 1].",
    "np.clip((wanted - goal) / step, -1, 1)",
    "np.clip(wanted - goal, -step, step)",
)
to_action.mistake(
    "A tip can go back: clip to [-1, 1], not to [0, 1].", "/ step, -1, 1)", "/ step, 0, 1)"
)
to_action.mistake(
    "A place nearer than a step needs a part of it: yours goes a full step, always.",
    "np.clip((wanted - goal) / step, -1, 1)",
    "np.sign(wanted - goal)",
)
to_action.mistake("An action is a share of the largest step: divide by it.", " / step", "")
to_action.mistake(
    "It leads from the goal now to the place wanted; yours leads back.",
    "wanted - goal",
    "goal - wanted",
)
to_action.mistake(
    "Clip each coordinate by itself: yours shortens the vector to length 1.",
    "np.clip((wanted - goal) / step, -1, 1)",
    "(wanted - goal) / step / max(1, np.linalg.norm((wanted - goal) / step))",
)
to_action.mistake(
    "That is a direction, of length 1 however near the place is: divide by step.",
    "np.clip((wanted - goal) / step, -1, 1)",
    "(wanted - goal) / np.linalg.norm(wanted - goal)",
)
to_action.mistake(
    "Clip each coordinate by itself: yours shortens the whole vector.",
    "np.clip((wanted - goal) / step, -1, 1)",
    "(wanted - goal) / step / max(1, np.abs((wanted - goal) / step).max())",
)
to_action.mistake(
    "Mind the brackets: (wanted - goal) / step.",
    "(wanted - goal) / step",
    "wanted - goal / step",
)
to_action.mistake(
    "An action has a least value, too: clip to [-1, 1].",
    "np.clip((wanted - goal) / step, -1, 1)",
    "np.minimum((wanted - goal) / step, 1)",
)
