"""Notebook 1, reach: a critically damped tip by Operational Space Control, and an environment."""

import gymnasium as gym
import numpy as np

from tests.grade.exercise import exercise


@exercise("1.1", "A spring that does not overshoot")
def response(t, x0, kp):
    w = np.sqrt(kp)
    return x0 * (1 + w * t) * np.exp(-w * t)


def _spring(rng):
    return (
        np.linspace(0, 0.5, rng.integers(10, 40)),
        float(rng.uniform(0.01, 0.3)),
        float(rng.uniform(50, 1600)),
    )


response.check("any stiffness, any distance", _spring, rtol=1e-4, atol=1e-8)
response.check("at t = 0 it is x0", lambda rng: (np.zeros(1), float(rng.uniform(0.1, 1)), 400.0))
response.mistake(
    "omega is sqrt(kp); 2 sqrt(kp) is the damping kd.", "np.sqrt(kp)", "2 * np.sqrt(kp)"
)
response.mistake("It starts at x0: you leave out x0.", "x0 * (1", "(1")
response.mistake("In the bracket stands omega t, not t.", "(1 + w * t)", "(1 + t)")
response.mistake(
    "Your spring overshoots: the bracket is 1 plus omega t.", "(1 + w * t)", "(1 - w * t)"
)
response.mistake("kp is the square of the natural frequency: take its root.", "np.sqrt(kp)", "kp")
response.mistake(
    "It starts at rest; exp(-wt) alone starts with a jerk: the factor 1 + w t is missing.",
    "(1 + w * t) * ",
    "",
)
response.mistake(
    "That oscillates: with kd = 2 sqrt(kp) there is no cosine.", "(1 + w * t)", "np.cos(w * t)"
)
response.mistake(
    "Your spring runs away: the exponent is negative.", "np.exp(-w * t)", "np.exp(w * t)"
)


def _arm(rng):
    J, A = rng.normal(size=(6, 7)), rng.normal(size=(7, 7))
    return J, A @ A.T + 7 * np.eye(7)


response.mistake(
    "omega is sqrt(kp), whatever kp is; 20 belongs to kp = 400 alone.",
    "np.sqrt(kp)",
    "20",
)
response.mistake(
    "omega need not be a whole number: keep the root as it is.",
    "np.sqrt(kp)",
    "int(np.sqrt(kp))",
)
response.mistake(
    "The response is what is left to go; yours is the way that lies behind.",
    "x0 * (1 + w * t) * np.exp(-w * t)",
    "x0 - x0 * (1 + w * t) * np.exp(-w * t)",
)
response.mistake(
    "x0 times the bracket (1 + w t) times the exponential: without its brackets x0 never decays.",
    "x0 * (1 + w * t) * np.exp(-w * t)",
    "x0 * 1 + w * t * np.exp(-w * t)",
)
response.mistake(
    "The exponential multiplies the whole bracket, (1 + w t); yours damps w t alone.",
    "x0 * (1 + w * t) * np.exp(-w * t)",
    "x0 * (1 + w * t * np.exp(-w * t))",
)


@exercise("1.2", "The inertia that the tip feels")
def task_inertia(J, M):
    return np.linalg.inv(J @ np.linalg.inv(M) @ J.T)


task_inertia.check("a seven-joint arm", _arm)
task_inertia.check(
    "a two-joint arm, one direction",
    lambda rng: (rng.normal(size=(1, 2)), np.diag(rng.uniform(0.3, 3, 2))),
    least=lambda rng: (rng.uniform(0.3, 3, (1, 1)), rng.uniform(0.3, 3, (1, 1))),
)
task_inertia.mistake(
    "You left out the last inverse: J M^-1 J^T is mobility, Lambda is its inverse.",
    "np.linalg.inv(J @ np.linalg.inv(M) @ J.T)",
    "J @ np.linalg.inv(M) @ J.T",
)
task_inertia.mistake(
    "Mobilities add up along J, inertias do not: M has to be inverted inside.",
    "np.linalg.inv(M)",
    "M",
)
task_inertia.mistake(
    "J maps joints to the tip, (6, 7): the transpose goes last.",
    "J @ np.linalg.inv(M) @ J.T",
    "J.T @ J",
)
task_inertia.mistake(
    "J maps joints to the tip, (6, 7): the transpose goes last, behind the inverse of M.",
    "J @ np.linalg.inv(M) @ J.T",
    "J.T @ np.linalg.inv(M) @ J",
)
task_inertia.mistake(
    "1 / A divides number by number; the inverse of a matrix is np.linalg.inv(A).",
    "np.linalg.inv(J @ np.linalg.inv(M) @ J.T)",
    "1 / (J @ np.linalg.inv(M) @ J.T)",
)
task_inertia.mistake(
    "* multiplies number by number; matrices are multiplied with @.",
    "J @ np.linalg.inv(M) @ J.T",
    "J * np.linalg.inv(M) * J.T",
)
task_inertia.mistake(
    "1 / M turns over each number by itself; the inverse of a matrix is np.linalg.inv(M).",
    "np.linalg.inv(M)",
    "(1 / M)",
)
task_inertia.mistake(
    "J keeps all its rows, those of rotation, too: Lambda is (m, m), for any m.",
    "    return np.linalg.inv(J",
    "    J = J[:3]\n    return np.linalg.inv(J",
)
task_inertia.mistake(
    "Joints feel each other: M has numbers beside its diagonal, and you leave them out.",
    "np.linalg.inv(M)",
    "np.diag(1 / np.diag(M))",
)
task_inertia.mistake(
    "A redundant arm has joints that give way: pinv(J)^T M pinv(J) holds them still. Invert "
    "J M^-1 J^T.",
    "np.linalg.inv(J @ np.linalg.inv(M) @ J.T)",
    "np.linalg.pinv(J).T @ M @ np.linalg.pinv(J)",
)


@exercise("1.3", "The torque of Operational Space Control", given=(task_inertia,))
def osc(J, M, h, e, v, kp):
    kd = 2 * np.sqrt(kp)
    return J.T @ task_inertia(J, M) @ (kp * e - kd * v) + h


def _errors(rng):
    h, e, v = (rng.normal(size=n) for n in (7, 6, 6))
    return *_arm(rng), h, e, v, float(rng.uniform(50, 900))


osc.check("an arm on its way", _errors, points=2)
osc.check(
    "at the goal and at rest only gravity is left",
    lambda rng: (*_arm(rng), rng.normal(size=7), np.zeros(6), np.zeros(6), 400.0),
)
osc.mistake(
    "Nothing holds the arm up: gravity and Coriolis torques, h, have to be added.", " + h", ""
)
osc.mistake(
    "Without Lambda the gains are forces, not accelerations: stiff in one pose, slack in another.",
    "task_inertia(J, M) @ ",
    "",
)
osc.mistake("Damping pulls against the speed: its sign is minus.", "- kd * v", "+ kd * v")
osc.mistake("h is the torque that carries the arm: add it, do not take it away.", " + h", " - h")
osc.mistake(
    "e leads from the tip to the goal, so the spring pulls along it: kp e has a plus.",
    "kp * e - kd * v",
    "-kp * e - kd * v",
)
osc.mistake("Critical damping is kd = 2 sqrt(kp).", "2 * np.sqrt(kp)", "np.sqrt(kp)")
osc.mistake("Critical damping is kd = 2 sqrt(kp), with the root.", "2 * np.sqrt(kp)", "2 * kp")
osc.mistake(
    "Lambda turns the whole acceleration into a force, the damping, too: mind the brackets.",
    "(kp * e - kd * v)",
    "(kp * e) - J.T @ (kd * v)",
)
osc.mistake(
    "A force at the tip becomes torques by J's transpose.", "J.T @ task_inertia", "J @ task_inertia"
)
osc.mistake(
    "A force at the tip becomes torques by J's transpose, J.T: the pseudo-inverse is for motions.",
    "J.T @ task_inertia",
    "np.linalg.pinv(J) @ task_inertia",
)
osc.mistake("The damping is missing: - kd v.", " - kd * v", "")
osc.mistake(
    "kd is 2 sqrt(kp), whatever kp is; 40 belongs to kp = 400 alone.",
    "2 * np.sqrt(kp)",
    "40",
)
osc.mistake(
    "h is a torque already: add it at the end. Yours is multiplied by M.",
    "J.T @ task_inertia(J, M) @ (kp * e - kd * v) + h",
    "J.T @ task_inertia(J, M) @ (kp * e - kd * v) + M @ h",
)
osc.mistake(
    "M pinv(J) takes the shortest joint motion, which is not the one of least force: J^T Lambda.",
    "J.T @ task_inertia(J, M) @ (kp * e - kd * v)",
    "M @ (np.linalg.pinv(J) @ (kp * e - kd * v))",
)
osc.mistake(
    "The 2 stands before the root: k_d = 2 sqrt(k_p).",
    "2 * np.sqrt(kp)",
    "np.sqrt(2 * kp)",
)


@exercise("1.4", "Torques the tip does not feel", given=(task_inertia,))
def nullspace(J, M):
    return np.eye(len(M)) - J.T @ task_inertia(J, M) @ J @ np.linalg.inv(M)


nullspace.check("a seven-joint arm", _arm, points=2)
nullspace.check(
    "a four-joint arm, three directions",
    lambda rng: (rng.normal(size=(3, 4)), np.diag(rng.uniform(0.5, 2, 4))),
    least=lambda rng: (rng.uniform(0.3, 3, (1, 1)), rng.uniform(0.3, 3, (1, 1))),
)
nullspace.mistake(
    "That is the projector of geometry, for velocities: forces need the one weighted with M.",
    "J.T @ task_inertia(J, M) @ J @ np.linalg.inv(M)",
    "np.linalg.pinv(J) @ J",
)
nullspace.mistake(
    "You return the part the tip does feel: subtract it from the identity.", "np.eye(len(M)) - ", ""
)
nullspace.mistake("M^-1 stands at the end of it; yours is without.", " @ np.linalg.inv(M)", "")
nullspace.mistake("At the end of it stands the inverse of M.", " @ np.linalg.inv(M)", " @ M")
nullspace.mistake(
    "The identity has the size of M, n by n; J has only as many rows as the tip has directions.",
    "np.eye(len(M))",
    "np.eye(len(J))",
)
nullspace.mistake(
    "An arm may have any number of joints n, the size of M: the identity is (n, n), not (7, 7).",
    "np.eye(len(M))",
    "np.eye(7)",
)
nullspace.mistake(
    "That is N, which acts on velocities; torques need its transpose.",
    "J.T @ task_inertia(J, M) @ J @ np.linalg.inv(M)",
    "np.linalg.inv(M) @ J.T @ task_inertia(J, M) @ J",
)
nullspace.mistake(
    "The identity is a matrix, np.eye(n): a plain 1 is subtracted from in every entry.",
    "np.eye(len(M))",
    "1",
)


@exercise(
    "1.5",
    "An environment",
    given=("import gymnasium as gym",),
    probe="""
    class Edge(np.random.Generator):
        # Begins where success begins, so that no sum has to come out at that very number.
        def __init__(self, place):
            super().__init__(np.random.PCG64(0))
            self.place = place

        def uniform(self, low=0.0, high=1.0, size=None):
            return self.place if size is None else np.full(size, self.place)

        def random(self, size=None):
            return (self.uniform(size=size) + 1) / 2

    def seeded(env, seed):
        '''reset, and whether its start is drawn from np.random instead of self.np_random.'''
        shared = np.random.get_state()
        np.random.seed(0)
        before = np.random.get_state()
        start, info = env.reset(seed=seed)
        after = np.random.get_state()
        np.random.set_state(shared)
        drawn = before[2] != after[2] or (before[1] != after[1]).any()
        right = gym.utils.seeding.np_random(seed)[0].uniform(-1, 1)
        if drawn and not np.isclose(start, right).all():
            raise ValueError("the start is drawn from np.random, not from self.np_random")
        return start, info

    def of_truth(x):
        return "a truth value" if isinstance(x, bool | np.bool_) else type(x).__name__

    def probe(actions, seed, ask):
        env = Point()
        if not np.array_equal(*(seeded(Point(), seed)[0] for _ in range(2))):
            raise ValueError(
                "the same seed starts at another place the second time: call "
                "super().reset(seed=seed), then draw from self.np_random"
            )
        episodes = []
        edge = 0.05 if seed % 2 else -0.05
        for seed in (seed,) if ask in ("episode", "kind") else (seed, None):
            if ask == "edge" and seed is None:
                env.np_random, actions = Edge(edge), 0 * actions
            start, info = env.reset() if seed is None else seeded(env, seed)
            seen, rows = np.copy(start), []
            for action in actions:
                rows.append(env.step(action))
                if not np.array_equal(seen, start):
                    raise ValueError(
                        "an observation changes after it was returned, by later steps: return a "
                        "new array each time, np.array([x], np.float32)"
                    )
            obs, reward, terminated, truncated, infos = zip(*rows)
            episodes.append({
                "start": start, "obs": np.stack(obs), "reward": np.array(reward, float),
                "terminated": [bool(x) for x in terminated],
                "truncated": [bool(x) for x in truncated],
                "success": [bool(i["is_success"]) for i in infos],
            })
        if ask == "kind":
            kinds = [f"{x.dtype} of shape {x.shape}" for x in map(np.asarray, (start, *obs))]
            other = Point()
            other.reset(seed=seed + 1)
            other.step(np.ones(1))
            return {
                "reset": kinds[0], "step": kinds[-1], "place": float(start[0]),
                "what reset returns beside it": info,
                "terminated": of_truth(terminated[0]), "truncated": of_truth(truncated[0]),
                "the next place, after another Point has moved": env.step(np.zeros(1))[0],
            }
        return episodes if len(episodes) > 1 else episodes[0]
    """,
)
class Point(gym.Env):
    observation_space = gym.spaces.Box(-4, 4, (1,), np.float32)
    action_space = gym.spaces.Box(-1, 1, (1,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x, self.t = self.np_random.uniform(-1, 1), 0
        return np.array([self.x], np.float32), {}

    def step(self, action):
        self.x += 0.05 * float(np.clip(action[0], -1, 1))
        self.t += 1
        done = abs(self.x) < 0.05
        observation = np.array([self.x], np.float32)
        return observation, float(done), False, self.t >= 50, {"is_success": done}


def _walk(rng, most=1, steps=20, ask="episode"):
    return rng.uniform(-most, most, (steps, 1)), int(rng.integers(1000)), ask


def _far(rng):
    """More than fifty steps, mostly in one direction, so that it leaves [-4, 4]."""
    actions, seed, ask = _walk(rng, 1, 140, "two episodes")
    return rng.choice([-1, 1]) * np.where(rng.random((140, 1)) < 0.9, 1, actions), seed, ask


def _home(rng):
    """From its start straight to 0, and about it until the 45th step; then at |x| = 0.05."""
    seed = int(rng.integers(1000))
    start = gym.utils.seeding.np_random(seed)[0].uniform(-1, 1)
    steps = np.sign(-start) * np.ones(int(abs(start) / 0.05))
    return np.append(steps, rng.uniform(-1, 1, 45 - len(steps)))[:, None], seed, "edge"


Point.check("a random walk", _walk)
Point.check("actions out of bounds are clipped", lambda rng: _walk(rng, 4))
Point.check("at 0 there is reward and success, and it goes on", _home)
Point.check(
    "after 50 steps it is truncated, never terminated, and reset begins anew",
    _far,
)
Point.check(
    "observations, flags and info are of the kind that the text promises",
    lambda rng: _walk(rng, 1, 2, "kind"),
)
Point.mistake(
    "The seed never reaches the generator: call super().reset(seed=seed) first.",
    "super().reset(seed=seed)",
    "super().reset(seed=None if seed is None else seed + 1)",
)
Point.mistake(
    "Success is below 0.05: a place at just 0.05 is none, < and not <=.",
    "abs(self.x) < 0.05",
    "abs(self.x) <= 0.05",
)
Point.mistake(
    "What is known beside the observation is nothing yet: reset returns {}.",
    "np.array([self.x], np.float32), {}",
    'np.array([self.x], np.float32), {"is_success": False}',
)
Point.mistake(
    "truncated is True or False, not a number.",
    "False, self.t >= 50",
    "False, int(self.t >= 50)",
)
Point.mistake(
    "Keep the place and the count in self: two points at once would share yours.",
    "self.x",
    "Point.x",
    "self.t",
    "Point.t",
)
Point.mistake(
    "Actions may lie out of bounds: clip them to [-1, 1].",
    "float(np.clip(action[0], -1, 1))",
    "float(action[0])",
)
Point.mistake(
    "The time limit is the clock's doing, not the task's end: it belongs in truncated.",
    "False, self.t >= 50",
    "self.t >= 50, False",
)
Point.mistake(
    "The fiftieth step is the last: count steps, and compare with >=.",
    "self.t >= 50",
    "self.t > 50",
)
Point.mistake(
    "The step after reset is the first: yours is over at the 49th.",
    "self.t >= 50",
    "self.t >= 49",
)
Point.mistake(
    "Success does not end the episode: it never terminates.",
    "float(done), False",
    "float(done), done",
)
Point.mistake(
    "At 0 the reward is 1.0 and is_success is True: yours never say so.",
    "float(done), False",
    "0.0, False",
    '{"is_success": done}',
    '{"is_success": False}',
)
Point.mistake(
    "A full action moves the point by 0.05, not by 1.",
    "self.x += 0.05 * float",
    "self.x += float",
)
Point.mistake(
    "The action is clipped; the position is free.",
    "self.t += 1",
    "self.x = float(np.clip(self.x, -1, 1))\n        self.t += 1",
)
Point.mistake(
    "The action is clipped; the position is free, and may leave observation_space.",
    "self.t += 1",
    "self.x = float(np.clip(self.x, -4, 4))\n        self.t += 1",
)
Point.mistake(
    "reset returns two things: the observation, and {} for what else there is to know.",
    "return np.array([self.x], np.float32), {}",
    "return np.array([self.x], np.float32)",
)
Point.mistake(
    "step returns five things: observation, reward, terminated, truncated, info.",
    "float(done), False, self.t >= 50, {",
    "float(done), self.t >= 50, {",
)
Point.mistake("Success is |x| < 0.05; your bound is another.", "< 0.05", "< 0.1")
for theirs in (
    "np.random.uniform(-1, 1), 0",
    "np.random.seed(seed) or np.random.uniform(-1, 1), 0",
    "np.random.rand() * 2 - 1, 0",
):
    Point.mistake(
        "You draw the start from np.random, which the whole program shares. The environment has a "
        "generator of its own, self.np_random, and super().reset(seed=seed) seeds that one.",
        "self.np_random.uniform(-1, 1), 0",
        theirs,
    )
Point.mistake(
    "Success is judged after the move, where the observation is: yours is judged before it.",
    "        done = abs(self.x) < 0.05\n",
    "",
    "self.x += 0.05",
    "done = abs(self.x) < 0.05\n        self.x += 0.05",
)
Point.mistake(
    "Every episode has its own 50 steps: set the counter back in reset.",
    "self.np_random.uniform(-1, 1), 0",
    'self.np_random.uniform(-1, 1), getattr(self, "t", 0)',
)
Point.mistake(
    "An observation is float32, as observation_space says: np.array([x], np.float32), also in "
    "step.",
    "np.array([self.x], np.float32)",
    "np.array([self.x])",
)
Point.mistake(
    "From the 50th step on the time is over, also for who goes on: >= and not ==.",
    "self.t >= 50",
    "self.t == 50",
)
