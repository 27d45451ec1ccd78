"""Star 0, push in the dark: how soon is the cube home, whatever the start?"""

import gymnasium as gym
import numpy as np

import tasks
from tests.grade.star import Star

STARTS = range(3_000_000, 3_000_030)
JITTER = 0.05  # m, as far as the task can be moved
STEPS, FAILED = 50, 100  # an episode; what a failed one counts


def steps(blind) -> float:
    """Mean steps until the cube is at the target when blind(t) (3,) acts, without any look."""
    env = gym.make(tasks.id_of("push"), observation="state", jitter=JITTER)
    taken = [_episode(env, blind, seed) for seed in STARTS]
    env.close()
    return float(np.mean(taken))


def _episode(env, blind, seed):
    env.reset(seed=seed)
    for t in range(STEPS):
        if env.step(np.asarray(blind(t), np.float32))[4]["is_success"]:
            return t + 1
    return FAILED


STAR = Star(steps, "steps", bar=36, naive=58.1, ours=30.4)
