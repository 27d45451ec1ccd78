"""Star 11, fool the judge: what does the classifier pay a robot that leaves the cube alone?"""

import numpy as np

import tasks
from lbw_minimal import classifier
from tests.grade.star import Star

STARTS, STEPS = range(3_000_000, 3_000_003), 50
TOUCHED, LEAST = 0.01, -10.0  # m: farther the cube has been moved, and that is what is paid
JUDGE = tasks.WEIGHTS / "rivals" / "classifier.safetensors"


def paid(trick) -> float:
    """Mean logit of a step when trick(t) (3,) acts; LEAST for an episode that moves the cube."""
    model = classifier.load(JUDGE, "push")
    env = tasks.bare("push", jitter=0.005)
    earned = [_episode(model, env, trick, seed) for seed in STARTS]
    env.close()
    return float(np.mean(earned))


def _episode(model, env, trick, seed):
    env.reset(seed=seed)
    start = env.object_position()
    frames = [env.step(np.asarray(trick(t), np.float32))[0] for t in range(STEPS)]
    if np.linalg.norm(env.object_position() - start) > TOUCHED:
        return LEAST
    return classifier.logits(model, np.stack(frames)).mean()


STAR = Star(paid, "a step", bar=1, naive=-4.78, ours=1.38)
