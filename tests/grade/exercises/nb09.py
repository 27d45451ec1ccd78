"""Notebook 9, drawer: a joint with dry friction, and the whole method put together."""

import numpy as np
import pybullet as p

from tests.grade.exercise import exercise


@exercise(
    "9.1",
    "A drawer on its rail",
    given=("import pybullet as p",),
    probe="""
    import pybullet as p

    def probe(force, friction, seconds, worlds):
        # A call without physicsClientId=client goes to the first of them.
        others = [p.connect(p.DIRECT) for _ in range(worlds)]
        client = p.connect(p.DIRECT)
        try:
            p.setTimeStep(1 / 250, client)
            body = make_drawer(client, friction)
            if not isinstance(body, int | np.integer):
                return body
            mass = p.getDynamicsInfo(body, 0, client)[0]
            low, high = p.getAABB(body, 0, client)
            base = p.getBasePositionAndOrientation(body, client)[0]
            parts = len(p.getCollisionShapeData(body, -1, client))
            q = []
            for step in range(int(250 * seconds) + 75):  # then it is let go for 0.3 s
                if step % 25 == 0:
                    q.append(p.getJointState(body, 0, client)[0])
                if step < 250 * seconds:
                    p.applyExternalForce(body, 0, (force, 0, 0), (0, 0, 0), p.LINK_FRAME, client)
                p.stepSimulation(client)
            size, middle = np.subtract(high, low), np.add(high, low) / 2
            return {
                "joint": np.array(q), "mass": mass, "size": size, "shapes of the base": parts,
                "the base's place": np.array(base), "the drawer's place at its start": middle,
            }
        finally:
            for world in (client, *others):
                p.disconnect(world)
    """,
)
def make_drawer(client, friction):
    shape = p.createCollisionShape(
        p.GEOM_BOX, halfExtents=(0.05, 0.08, 0.04), physicsClientId=client
    )
    body = p.createMultiBody(
        baseMass=0, linkMasses=[0.8], linkParentIndices=[0],
        linkCollisionShapeIndices=[shape], linkVisualShapeIndices=[-1],
        linkPositions=[(0, 0, 0)], linkOrientations=[(0, 0, 0, 1)],
        linkInertialFramePositions=[(0, 0, 0)], linkInertialFrameOrientations=[(0, 0, 0, 1)],
        linkJointTypes=[p.JOINT_PRISMATIC], linkJointAxis=[(1, 0, 0)], physicsClientId=client,
    )  # fmt: skip
    p.changeDynamics(
        body,
        0,
        linearDamping=0,
        jointDamping=0,
        jointLowerLimit=-0.15,
        jointUpperLimit=0,
        physicsClientId=client,
    )
    p.setJointMotorControl2(
        body, 0, p.VELOCITY_CONTROL, targetVelocity=0, force=friction, physicsClientId=client
    )
    p.resetJointState(body, 0, -0.15, physicsClientId=client)
    return body


def _push(rng, least, most, seconds):
    friction = float(rng.uniform(12, 24))
    force = friction + float(rng.uniform(least, most))
    return force, friction, seconds, int(rng.integers(1, 3))


make_drawer.check(
    "a push below the friction does not move it", lambda rng: _push(rng, -10, -2, 0.5), atol=1e-3
)
make_drawer.check(
    "a push above it does, and nothing else brakes", lambda rng: _push(rng, 0.8, 2, 0.36), atol=2e-4
)


def _pull(rng):
    force, *others = _push(rng, 15, 25, 1.0)
    return -force, *others


make_drawer.check(
    "it stops where it is shut, and where it is open",
    lambda rng: _push(rng, 15, 25, 1.0),
    atol=5e-3,
    least=_pull,
)
make_drawer.mistake(
    "The motor has no force of yours, and Bullet's is too strong for any push: force=friction.",
    ", force=friction",
    "",
)
make_drawer.mistake(
    "The drawer slides along x, axis (1, 0, 0); (0, 0, 1) is the way up.",
    "linkJointAxis=[(1, 0, 0)]",
    "linkJointAxis=[(0, 0, 1)]",
)
make_drawer.mistake(
    "It gives way to any push: dry friction is a velocity motor that wants 0 and has at most that "
    "force.",
    "force=friction",
    "force=0",
)
make_drawer.mistake("The friction is the argument, not always 18 N.", "force=friction", "force=18")
make_drawer.mistake(
    "It does not give way along x: is the joint's axis (1, 0, 0), and Bullet's own motor replaced "
    "by yours (setJointMotorControl2)?",
    "linkJointAxis=[(1, 0, 0)]",
    "linkJointAxis=[(0, 1, 0)]",
)
make_drawer.mistake(
    "It turns instead of sliding: the joint is prismatic.", "p.JOINT_PRISMATIC", "p.JOINT_REVOLUTE"
)
make_drawer.mistake(
    "A motor that wants a position pulls the drawer back: friction wants velocity 0, "
    "VELOCITY_CONTROL.",
    "p.VELOCITY_CONTROL, targetVelocity=0",
    "p.POSITION_CONTROL, targetPosition=-0.15",
)
make_drawer.mistake(
    "It starts shut: reset the joint to -0.15, open.",
    "resetJointState(body, 0, -0.15",
    "resetJointState(body, 0, 0.0",
)
make_drawer.mistake(
    "It slides on through the cabinet: set the joint's limits to -0.15 and 0, with jointDamping=0 "
    "in the same call of changeDynamics (without it PyBullet forgets the limits).",
    "jointLowerLimit=-0.15",
    "jointLowerLimit=-9",
    "jointUpperLimit=0",
    "jointUpperLimit=9",
)
make_drawer.mistake(
    "It can be pulled out of its cabinet: the joint's lower limit is -0.15.",
    "jointLowerLimit=-0.15",
    "jointLowerLimit=-9",
)
make_drawer.mistake(
    "Something else brakes it: Bullet damps links and joints by default; linearDamping=0 and "
    "jointDamping=0.",
    "        linearDamping=0,\n        jointDamping=0,\n",
    "",
)
make_drawer.mistake(
    "halfExtents are half the lengths: (0.05, 0.08, 0.04), not twice that.",
    "halfExtents=(0.05, 0.08, 0.04)",
    "halfExtents=(0.1, 0.16, 0.08)",
)
make_drawer.mistake(
    "The base has no shape of its own: it would stand in the drawer's way.",
    "baseMass=0, ",
    "baseMass=0, baseCollisionShapeIndex=shape, ",
)
make_drawer.mistake(
    "Open is said twice: the link stands at the base's place, (0, 0, 0), and the joint alone opens "
    "it, to -0.15.",
    "linkPositions=[(0, 0, 0)]",
    "linkPositions=[(-0.15, 0, 0)]",
)
make_drawer.mistake(
    "The link stands at the base's place: linkPositions=[(0, 0, 0)]. Yours is half a height above.",
    "linkPositions=[(0, 0, 0)]",
    "linkPositions=[(0, 0, 0.04)]",
)
make_drawer.mistake(
    "The base stands at the origin; yours is half a height above it.",
    "baseMass=0, ",
    "baseMass=0, basePosition=(0, 0, 0.04), ",
)
make_drawer.mistake(
    "Your calls go to another world than the one you were given: physicsClientId=client in every "
    "one.",
    "physicsClientId=client",
    "physicsClientId=client - 1",
)
make_drawer.mistake(
    "halfExtents are half the edges, and the text gives these halves already: yours is half "
    "as large.",
    "(0.05, 0.08, 0.04)",
    "(0.025, 0.04, 0.02)",
)
make_drawer.mistake(
    "It runs through its end: PyBullet forgets the limits unless jointLowerLimit, jointUpperLimit "
    "and jointDamping come in one call.",
    "        jointDamping=0,\n",
    "",
)


@exercise("9.2", "What the policy sees")
def observe(recent, target, clock):
    z_2, z_1, z = recent
    steps = (z - z_1).ravel(), (z_1 - z_2).ravel()
    return np.concatenate([z.ravel(), *steps, (target - z).ravel(), [clock]])


def _seen(rng, K=5):
    return rng.normal(size=(3, K, 2)), rng.normal(size=(K, 2)), float(rng.uniform())


observe.check("five keypoints", _seen, least=lambda rng: _seen(rng, 1))
observe.check("any number of them", lambda rng: _seen(rng, 2 * int(rng.integers(1, 5))))
observe.mistake(
    "The second step is missing: how it moved in the step before.",
    "*steps, (",
    "steps[0], (",
)
observe.mistake("z_t itself is missing: it comes first.", "[z.ravel(), *steps", "[*steps")
observe.mistake(
    "The newer step comes first, then the one before; yours are the other way round.",
    "(z - z_1).ravel(), (z_1 - z_2).ravel()",
    "(z_1 - z_2).ravel(), (z - z_1).ravel()",
)
observe.mistake(
    "Steps, not places: what moved is z_t - z_{t-1}, not z_{t-1} itself.",
    "(z - z_1).ravel(), (z_1 - z_2).ravel()",
    "z_1.ravel(), z_2.ravel()",
)
observe.mistake(
    "One vector, all numbers in a row; yours still has rows.",
    "return np.concatenate([z.ravel(), *steps, (target - z).ravel(), [clock]])",
    "return np.stack([z, z - z_1, z_1 - z_2, target - z])",
)
observe.mistake(
    "x and y of keypoint 1, then of keypoint 2: yours has all x first.",
    "z_2, z_1, z = recent",
    "z_2, z_1, z = (a.T for a in recent)\n    target = target.T",
)
observe.mistake(
    "How the keypoints moved is z_t - z_{t-1}; yours has the opposite sign.",
    "(z - z_1).ravel(), (z_1 - z_2).ravel()",
    "(z_1 - z).ravel(), (z_2 - z_1).ravel()",
)
observe.mistake(
    "The last of `recent` is the newest: z_t is recent[2].",
    "z_2, z_1, z = recent",
    "z, z_1, z_2 = recent",
)
observe.mistake(
    "The second step is the one before, z_{t-1} - z_{t-2}; yours reaches from t-2 to t.",
    "(z_1 - z_2)",
    "(z - z_2)",
)
observe.mistake(
    "The second step is a step, z_{t-1} - z_{t-2}; yours is by how much the two steps differ.",
    "(z_1 - z_2)",
    "(z - 2 * z_1 + z_2)",
)
observe.mistake(
    "The way ahead leads from the robot to the demonstration: target minus z.",
    "(target - z)",
    "(z - target)",
)
observe.mistake(
    "Give the way to the demonstration, not its place: or the policy has to learn the video by "
    "heart.",
    "(target - z)",
    "target",
)
observe.mistake(
    "The clock comes last.",
    "[z.ravel(), *steps, (target - z).ravel(), [clock]]",
    "[[clock], z.ravel(), *steps, (target - z).ravel()]",
)
observe.mistake(
    "Flatten each array whole, x and y of keypoint 1 first; yours mixes the arrays keypoint by "
    "keypoint.",
    "return np.concatenate([z.ravel(), *steps, (target - z).ravel(), [clock]])",
    "return np.append(np.stack([z, z - z_1, z_1 - z_2, target - z], 1).ravel(), clock)",
)
observe.mistake(
    "The clock is missing: the same z earns differently at different times.", ", [clock]", ""
)


@exercise(
    "9.3",
    "The method, assembled",
    probe="""
    def probe(demo, robot, colour, scale, kind):
        calls = []

        def translate(frames):
            calls.append("translate")
            return frames + colour

        def detect(frames):
            calls.append("detect")
            return scale * frames

        def make_reward(z_E, z_robot):
            calls.append("make_reward")
            return {"follows": z_E, "pace": z_robot, "kind": kind}

        def train(reward):
            calls.append("train")
            return {"policy for": reward}

        policy = learn_by_watching(demo, robot, translate, detect, make_reward, train)
        counts = {"translations": calls.count("translate"), "trainings": calls.count("train")}
        return {"policy": policy} | counts
    """,
)
def learn_by_watching(demo, robot, translate, detect, make_reward, train):
    z_E = detect(translate(demo))
    reward = make_reward(z_E, detect(robot))
    return train(reward)


def _videos(rng, least, most):
    demo, robot = (rng.normal(size=(n, 2)) for n in rng.integers(least, most, 2))
    return demo, robot, float(rng.uniform(500, 2000)), float(rng.uniform(2, 3)), float(rng.random())


learn_by_watching.check(
    "the reward follows the translated video", lambda rng: _videos(rng, 5, 12), points=2
)
learn_by_watching.check(
    "videos of any length", lambda rng: _videos(rng, 2, 40), least=lambda rng: _videos(rng, 1, 2)
)
learn_by_watching.mistake(
    "You look for keypoints on the human's frames; the detector knows robots: translate first.",
    "detect(translate(demo))",
    "detect(demo)",
)
learn_by_watching.mistake(
    "Translation is for frames, not for keypoints: translate first, then detect.",
    "detect(translate(demo))",
    "translate(detect(demo))",
)
learn_by_watching.mistake(
    "The robot's own frames need no translation.", "detect(robot)", "detect(translate(robot))"
)
learn_by_watching.mistake(
    "make_reward takes the demonstration first, then the robot's keypoints.",
    "make_reward(z_E, detect(robot))",
    "make_reward(detect(robot), z_E)",
)
learn_by_watching.mistake(
    "The pace is read from keypoints, too: detect them on the robot's frames.",
    "detect(robot)",
    "robot",
)
learn_by_watching.mistake(
    "The human's frames are translated; the robot's need no translation: yours are swapped.",
    "detect(translate(demo))",
    "detect(demo)",
    "detect(robot)",
    "detect(translate(robot))",
)
learn_by_watching.mistake(
    "The reward follows the human's video: you pass the robot's motion twice.",
    "make_reward(z_E, detect(robot))",
    "make_reward(detect(robot), detect(robot))",
)
learn_by_watching.mistake(
    "make_reward needs keypoints of random robot motion for the pace: you pass the "
    "demonstration's.",
    "make_reward(z_E, detect(robot))",
    "make_reward(z_E, z_E)",
)
learn_by_watching.mistake(
    "The policy is what training returns: you return nothing.", "return train", "train"
)
learn_by_watching.mistake(
    "Keypoints are missing: the translated frames go through `detect`.",
    "detect(translate(demo))",
    "translate(demo)",
)
learn_by_watching.mistake(
    "Return what `train` returns: the policy.", "return train(reward)", "return reward"
)


@exercise(
    "9.4",
    "Testing it",
    probe="""
    def probe(outcomes):
        def play(seed):
            if not 1_000_000 <= seed < 1_000_000 + len(outcomes):
                raise ValueError(f"{seed} is no test seed")
            return [bool(x) for x in outcomes[int(seed) - 1_000_000]]

        return evaluate(play, len(outcomes))
    """,
)
def evaluate(play, n):
    return sum(any(play(1_000_000 + i)) for i in range(n))


def _episodes(rng, n=10):
    return (rng.random((n, 12)) < 0.08,)


evaluate.check("ten episodes", _episodes)
evaluate.check("any number of episodes", lambda rng: _episodes(rng, int(rng.integers(15, 45))))
evaluate.mistake("The number of episodes is n, not always 10.", "range(n)", "range(10)")
evaluate.mistake(
    "The n test seeds are 1,000,000 to 1,000,000 + n - 1: yours run on by one.",
    "1_000_000 + i",
    "1_000_001 + i",
)
evaluate.mistake(
    "The n test seeds are 1,000,000 to 1,000,000 + n - 1: yours run on by one.",
    "range(n)",
    "range(n + 1)",
)
evaluate.mistake(
    "Return how many were solved; you stop at the first.",
    "sum(any(play(1_000_000 + i)) for i in range(n))",
    "int(any(any(play(1_000_000 + i)) for i in range(n)))",
)
evaluate.mistake(
    "A list of truth values is true as soon as it is not empty: ask whether any of them is.",
    "sum(any(play(1_000_000 + i))",
    "sum(bool(play(1_000_000 + i))",
)
evaluate.check(
    "done at the last step alone",
    lambda rng: (
        np.pad(np.zeros((rng.integers(5, 9), 11), bool), ((0, 0), (0, 1)), constant_values=True),
    ),
)
evaluate.mistake(
    "Success counts at any step of the episode; you ask for the last one.",
    "any(play(1_000_000 + i))",
    "play(1_000_000 + i)[-1]",
)
evaluate.mistake(
    "You count steps; an episode that succeeds counts once.",
    "any(play(1_000_000 + i))",
    "sum(play(1_000_000 + i))",
)
evaluate.mistake(
    "Return how many were solved, not their share.",
    "sum(any(play(1_000_000 + i)) for i in range(n))",
    "sum(any(play(1_000_000 + i)) for i in range(n)) / n",
)
evaluate.mistake("Solved at any step, not at all of them.", "any(play", "all(play")
evaluate.mistake(
    "Test episodes have seeds of their own: they start at 1,000,000.", "1_000_000 + i", "i"
)
evaluate.mistake(
    "You play one episode again and again: each needs a seed of its own.",
    "1_000_000 + i",
    "1_000_000",
)
