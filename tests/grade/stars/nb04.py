"""Star 4, trust in a translation: are frames that came out worse doubted more?"""

import functools
from collections.abc import Callable
from itertools import islice

import numpy as np
import torch

import tasks
from lbw_minimal import gan, video
from lbw_minimal.images import spread, to_images
from lbw_minimal.imitate import load_perception
from lbw_minimal.munit_networks import MUNIT
from tasks.world import TaskEnv, random_actions, record_expert
from tasks.world.recording import film
from tests.grade.star import Star, shaped

JITTER = 0.03  # m, of the starts
RANDOM = 40  # frames of random motion after each expert
SAME = 2  # pixels, by which tip and object of human and robot may differ
GAIN = 0.3  # the light is multiplied by up to e to this, or divided
SIZES = 6, 15  # pixels, of what is in the picture and does not belong there


def wrong(doubt) -> float:
    """Pairs of frames, in per cent, of which doubt(human, there, back), (T,), does not doubt the
    one that is further from the true robot frame more."""
    shares = []
    for human, there, back, error in films():
        said = shaped(doubt(human.copy(), there, back), error, "the row of doubts")
        i, j = np.triu_indices(len(error), 1)
        shares.append(1 - ((said[i] - said[j]) * (error[i] - error[j]) > 0).mean())
    return 100 * float(np.mean(shares))


@functools.cache
def films() -> list[tuple[np.ndarray, Callable, Callable, np.ndarray]]:
    """Of two tasks: human frames (T, 84, 84, 3) uint8, of which many are disturbed; the ways to the
    robot's frames and back; and how far each translation is from the true robot frame, (T,)."""
    found = []
    for task in ("push", "coffee"):
        perception = load_perception(tasks.WEIGHTS / task, task)
        demo = video.read(tasks.VIDEOS / task / "expert_01.mp4")[0]
        back = functools.partial(back_to_human, perception.translator, spread(demo, 64))
        human, robot = twins(task)
        human = disturbed(human, np.random.default_rng(0))
        error = np.abs(perception.translate(human) - robot.astype(float)).mean((1, 2, 3))
        found.append((human, perception.translate, back, error))
    return found


@torch.no_grad()
def back_to_human(model: MUNIT, like: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Robot frames (T, 84, 84, 3) uint8 as the human's, G_X(c_y, s_x), with s_x the mean style of
    the human frames `like` (N, 84, 84, 3)."""
    s_x = model.style(to_images(like), "x").mean(0)

    def swapped(y):
        return model.decode(model.content(y, "y"), s_x.expand(len(y), -1), "x")

    return gan.repaint(frames, swapped, s_x.device)


def twins(task: str) -> tuple[np.ndarray, np.ndarray]:
    """The same movements of a human and of a robot, two films (T, 84, 84, 3) uint8.

    A hand touches things elsewhere than a gripper does. Frames are left out in which tip or object
    are not at the same place.
    """
    human = tasks.bare(task, embodiment="human", jitter=JITTER)
    robot = tasks.bare(task, jitter=JITTER)
    done = [record_expert(human, 50)[2].actions]
    done.append(np.array(list(islice(random_actions(np.random.default_rng(60)), RANDOM))))
    x, at_x = played(human, done)
    y, at_y = played(robot, done)
    same = np.abs(at_x - at_y).max(1) < SAME
    return x[same], y[same]


def played(env: TaskEnv, done: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Takes of the actions (N, 3), one after the other: frames, and true pixels (T, 4)."""
    takes = [film(env, 50 + i, actions, scatter=i > 0) for i, actions in enumerate(done)]
    env.close()
    return np.concatenate([t[0] for t in takes]), np.concatenate([t[1] for t in takes])


def disturbed(frames: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The frames, half of them in another light and half with a square that does not belong."""
    kept = []
    for frame in frames.astype(float):
        if rng.random() < 0.5:
            size = int(rng.integers(*SIZES, endpoint=True))
            y, x = rng.integers(0, 84 - size, 2)
            frame[y : y + size, x : x + size] = rng.uniform(20, 230, 3)
        kept.append(frame * np.exp(rng.uniform(-GAIN, GAIN) * (rng.random() < 0.5)))
    return np.array(kept).clip(0, 255).astype(np.uint8)


STAR = Star(wrong, "% of the pairs in the wrong order", bar=20, naive=25.4, ours=15.9)
