"""Star 5, a passer-by: how far from the object is what is read from its keypoint's maps?"""

import functools

import numpy as np
import torch

import tasks
from lbw_minimal import transporter
from lbw_minimal.images import to_images
from tasks.world import record_expert
from tests.grade.star import Star, shaped

FOLLOWS = {"push": 2, "slide": 1, "coffee": 1, "drawer": 1}  # the keypoint that is the object's
PASSERS = 6  # films of each task, with another passer-by in each
NOISE = 8.0  # grey levels
RED = 150, 40, 36  # as objects are drawn


def error(read) -> float:
    """Mean distance in pixels of read(maps), (T, 2), from where the keypoint belongs."""
    off = []
    for maps, belongs in films():
        z = shaped(read(maps.copy()), belongs, "the path")
        off.append(42 * np.linalg.norm(z - belongs, axis=-1).mean())
    return float(np.mean(off))


@functools.cache
def films() -> list[tuple[np.ndarray, np.ndarray]]:
    """The logits (T, 21, 21) of the object's keypoint as something like it passes, and where the
    keypoint is without, (T, 2)."""
    found = []
    for task, k in FOLLOWS.items():
        detector = transporter.load(tasks.WEIGHTS / task / "keypoints.safetensors", task)
        env = tasks.bare(task)
        film = record_expert(env, 0)[0]
        env.close()
        belongs = transporter.detect(detector, film)[:, k]
        for seed in range(PASSERS):
            passed = walked_past(film, np.random.default_rng(seed))
            with torch.inference_mode():
                found.append((detector.psi(to_images(passed))[:, k].numpy(), belongs))
    return found


def walked_past(film: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The film (T, 84, 84, 3) uint8 with a red square that crosses it."""
    T, size = len(film), int(rng.integers(8, 14))  # frames, pixels
    top = np.linspace(*rng.integers(20, 70, 2), T).astype(int)
    left = np.linspace(-size, 84, T)[:: rng.choice([-1, 1])].round().astype(int)
    film = film + rng.normal(0, NOISE, film.shape)
    for frame, y, x in zip(film, top, left, strict=True):
        frame[y : y + size, max(0, x) : max(0, x + size)] = RED
    return film.clip(0, 255).astype(np.uint8)


STAR = Star(error, "pixels", bar=2, naive=12.1, ours=1.29)
