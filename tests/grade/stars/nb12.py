"""Star 12, a path that was badly seen: how far from the hand's is what is made of it?"""

import numpy as np

from tests.grade.star import Star, shaped

CLIPS, SIZE = 20, 84.0  # and pixels of a picture
NOISE, WRONG = 1.0, 0.06  # pixels; share of the frames in which a burst of wrong finds begins


def error(mend) -> float:
    """Mean distance in pixels of mend(times, found), (T, 2), from the hand's path."""
    off = []
    for seed in range(CLIPS):
        times, truth, found = clip(np.random.default_rng(seed))
        path = shaped(mend(times.copy(), found.copy()), truth, "the path")
        off.append(np.linalg.norm(path - truth, axis=1).mean())
    return float(np.mean(off))


def clip(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (T,) in s, not even; the hand's places (T, 2) in pixels, and where it was found."""
    times = np.cumsum(rng.choice([1, 1, 1, 2], 90) / 30)
    corners = rng.uniform(15, SIZE - 15, (4, 2))
    ways = np.sort(rng.uniform(times[0], times[-1], 6)).reshape(3, 2)  # it rests between them
    truth = np.tile(corners[0], (len(times), 1))
    for (start, end), a, b in zip(ways, corners[:-1], corners[1:], strict=True):
        s = np.clip((times - start) / max(end - start, 0.3), 0, 1)[:, None]
        truth += (10 * s**3 - 15 * s**4 + 6 * s**5) * (b - a)
    found = truth + rng.normal(0, NOISE, truth.shape)
    for t in np.flatnonzero(rng.random(len(times)) < WRONG):
        burst = slice(t, t + rng.integers(1, 5))
        found[burst] = rng.uniform(0, SIZE, 2) + rng.normal(0, NOISE, found[burst].shape)
    return times, truth, found


STAR = Star(error, "pixels", bar=2, naive=4.45, ours=1.67)
