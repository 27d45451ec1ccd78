"""Star 9, a second of practice: how far from what is shown is a robot that was never trained?"""

import functools

import numpy as np

import tasks
from tasks.world.motion import random_takes
from tests.grade.star import Star

TAKES, TAKE = 6, 25  # and frames of a take: a second
STARTS = 3_000_000  # the seed of the first one
JITTER = 0.04  # m


def error(steer) -> float:
    """Mean distance in pixels of the robot's keypoints from the demonstration's, step by step.

    steer(z, actions, z_E) returns act(z, t), the action (3,) of step t at keypoints z (K, 2).
    """
    perception, takes = watched()
    env = tasks.bare("drawer", jitter=JITTER)
    off = []
    for number, (z, actions) in enumerate(takes):
        act = steer(z.copy(), actions.copy(), perception.z_E.copy())
        off.append(_episode(env, perception, act, STARTS + number))
    env.close()
    return float(np.mean(off))


@functools.cache
def watched():
    """The drawer's perception, which has seen the demonstration; keypoints (25, K, 2) and actions
    (24, 3) of takes of random motion."""
    perception, env = tasks.trained_perception("drawer"), tasks.bare("drawer")
    takes = random_takes(env, TAKES * TAKE, 0, TAKE)
    found = [(perception.detect(frames), recording.actions) for frames, _, recording in takes]
    env.close()
    return perception, found


def _episode(env, perception, act, seed):
    z, off = perception.detect(env.reset(seed=seed)[0][None])[0], []
    for t, wanted in enumerate(perception.z_E[1:]):
        frame = env.step(np.asarray(act(z.copy(), t), np.float32))[0]
        z = perception.detect(frame[None])[0]
        off.append(42 * np.linalg.norm(z - wanted, axis=-1).mean())
    return np.mean(off)


STAR = Star(error, "pixels", bar=2, naive=7.07, ours=1.44)
