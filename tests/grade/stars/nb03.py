"""Star 3, random data that touches: how many different pushes does blind wandering bring about?"""

from itertools import islice

import numpy as np

import tasks
from tests.grade.star import Star

TAKES, TAKE = 40, 25  # and frames of a take
CELL = 0.02  # m: places of tip and cube that are nearer than that are alike
LEAST = 0.0006  # m a step, a tenth of a pixel: less is rest


def pushes(wander) -> float:
    """Number of different (tip x, tip z, cube x), in cells, from which the cube moves.

    wander(rng) yields actions (3,) for a take. The cube is anywhere, and no take begins beside it.
    """
    env = tasks.bare("push", observation="state")
    env.CONTACT = None  # or half of the takes would begin beside the cube
    seen = set()
    for seed in range(TAKES):
        state = env.reset(seed=seed, options={"scatter": True})[0]
        for action in islice(wander(np.random.default_rng(seed)), TAKE - 1):
            before, state = state, env.step(np.asarray(action, np.float32))[0]
            if abs(state[3] - before[3]) > LEAST:
                seen.add(tuple(np.floor(before[[0, 2, 3]] / CELL).astype(int)))
    env.close()
    return len(seen)


STAR = Star(pushes, "different pushes", bar=40, naive=5, ours=56)
