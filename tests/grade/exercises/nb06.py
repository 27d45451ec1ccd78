"""Notebook 6, the keypoint reward: Eq. 8-10 and what mends them."""

import numpy as np

from tests.grade.exercise import exercise


def _walk(rng, n, K=5):
    """A keypoint trajectory (n, K, 2) that goes somewhere."""
    return np.cumsum(rng.normal(0.02, 0.05, (n, K, 2)), axis=0)


@exercise("6.1", "The nearest frame, r1 (Eq. 9)")
def r1(z, z_E):
    distances = np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=(1, 2)))
    return -distances.min()


r1.check("keypoints anywhere", lambda rng: (rng.normal(size=(5, 2)), _walk(rng, 20)))
r1.check("at a frame of the demonstration it is 0", lambda rng: ((z := _walk(rng, 12))[rng.integers(11)], z))
r1.check("at the last frame it is not: p ends at N - 1", lambda rng: ((z := _walk(rng, 12))[-1] + 1, z + 1))
r1.mistake(
    "A reward is larger when the robot is nearer: Eq. 9 has a minus in front.", "-distances", "distances"
)
r1.mistake(
    "Your distance is squared: Eq. 9 has the norm, with its square root.",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=(1, 2)))",
    "((z_E[:-1] - z) ** 2).sum(axis=(1, 2))",
)
r1.mistake("Your minimum includes the last frame: in Eq. 9 p ends at N - 1.", "z_E[:-1]", "z_E")
r1.mistake("Eq. 9 takes the nearest frame, a minimum over p; you take the mean.", ".min()", ".mean()")
r1.mistake(
    "You add up one distance per keypoint: the norm goes over all K keypoints and both coordinates at once.",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=(1, 2)))",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=2)).sum(axis=1)",
)


@exercise("6.2", "The nearest step, r2 (Eq. 10)")
def r2(z, z_next, z_E):
    step = z_next - z
    steps = z_E[1:] - z_E[:-1]
    return -np.sqrt(((steps - step) ** 2).sum(axis=(1, 2))).min()


r2.check("keypoints anywhere", lambda rng: (rng.normal(size=(5, 2)), rng.normal(size=(5, 2)), _walk(rng, 20)))
r2.check(
    "a step of the demonstration, made elsewhere, earns 0",
    lambda rng: ((z := _walk(rng, 12))[4] + 3, z[5] + 3, z),
)
r2.mistake("A step is z_{t+1} - z_t; yours has the opposite sign.", "z_next - z", "z - z_next")
r2.mistake("A reward is larger when the step is nearer: Eq. 10 has a minus in front.", "-np.sqrt", "np.sqrt")
r2.mistake("You compare places; Eq. 10 compares steps, z^E_{q+1} - z^E_q.", "z_E[1:] - z_E[:-1]", "z_E[:-1]")
r2.mistake("Eq. 10 takes the nearest step, a minimum over q; you take the mean.", ".min()", ".mean()")


@exercise("6.3", "What an episode earns (Eq. 8)", given=(r1, r2))
def episode_return(z, z_E, lam1, lam2):
    total = 0.0
    for t in range(len(z) - 1):
        total += lam1 * r1(z[t], z_E) + lam2 * r2(z[t], z[t + 1], z_E)
    return total


episode_return.check("a random episode", lambda rng: (_walk(rng, 15), _walk(rng, 20), 1.0, 1.0))
episode_return.check("other weights", lambda rng: (_walk(rng, 9), _walk(rng, 20), 0.3, 2.5))
episode_return.check(
    "a robot that never moves beside a demonstration that starts at rest",
    lambda rng: (np.zeros((30, 5, 2)), np.concatenate([np.zeros((4, 5, 2)), _walk(rng, 20)]), 1.0, 1.0),
)
episode_return.mistake(
    "T frames have T - 1 transitions: you leave out the last one.", "range(len(z) - 1)", "range(len(z) - 2)"
)
episode_return.mistake(
    "Eq. 9 judges z_t, the keypoints before the action; you take z_{t+1}.",
    "r1(z[t], z_E)",
    "r1(z[t + 1], z_E)",
)
episode_return.mistake(
    "lambda_r1 weighs r1, lambda_r2 weighs r2; yours are swapped.", "lam1, lam2):", "lam2, lam1):"
)
episode_return.mistake(
    "Rewards add up over an episode; you return their mean.", "return total", "return total / (len(z) - 1)"
)


@exercise("6.4", "Cut the pauses")
def trim(z, least):
    kept = [0]
    for i in range(1, len(z) - 1):
        if np.linalg.norm(z[i] - z[kept[-1]]) >= least:
            kept.append(i)
    return z[kept + [len(z) - 1]]


def _with_pauses(rng):
    z = np.repeat(_walk(rng, 10), rng.integers(1, 5, 10), axis=0)
    return z + rng.normal(0, 1e-3, z.shape), 0.05


trim.check("a demonstration with pauses", _with_pauses)
trim.check(
    "slow motion is kept where it adds up",
    lambda rng: (np.linspace(0, 1, 60)[:, None, None] * np.ones((1, 3, 2)), 0.2),
)
trim.check("first and last frame stay", lambda rng: (np.zeros((8, 4, 2)), 0.1))
trim.mistake(
    "Compare with the last frame you kept, not with the one before: slow motion would vanish as a whole.",
    "z[kept[-1]]",
    "z[i - 1]",
)
trim.mistake("The last frame is the goal: keep it always.", "kept + [len(z) - 1]", "kept")
trim.mistake("You keep what rests and cut what moves.", ">= least", "< least")


@exercise("6.5", "A reward that knows the time")
def timed_r1(z_next, z_E, t):
    target = z_E[min(t + 1, len(z_E) - 1)]
    return -np.linalg.norm(z_next - target)


timed_r1.check("on the way", lambda rng: (rng.normal(size=(5, 2)), _walk(rng, 20), int(rng.integers(18))))
timed_r1.check(
    "after the end the goal stays the goal",
    lambda rng: (rng.normal(size=(5, 2)), _walk(rng, 20), int(rng.integers(19, 60))),
)
timed_r1.mistake(
    "After step t the demonstration is at frame t + 1: the robot would always be a step late.",
    "min(t + 1, len(z_E) - 1)",
    "min(t, len(z_E) - 1)",
)
timed_r1.mistake(
    "After its end the demonstration stays at its last frame; yours starts again.",
    "min(t + 1, len(z_E) - 1)",
    "(t + 1) % len(z_E)",
)
timed_r1.mistake(
    "A reward is larger when the robot is nearer: there is a minus in front.", "-np.linalg", "np.linalg"
)
timed_r1.mistake(
    "Here no minimum is taken: the frame is given by the time.",
    "-np.linalg.norm(z_next - target)",
    "-min(np.linalg.norm(z_next - frame) for frame in z_E)",
)
