"""Star 6, a reward that waits: does who does what is shown earn more than who does not?"""

from itertools import pairwise

import numpy as np

from tests.grade.star import Star

DEMOS, STEPS = 8, 100  # demonstrations; transitions of an episode
NOISE = 0.02  # of a keypoint, in units of half a picture: about a pixel
GLITCH = 0.02  # share of the frames in which one keypoint is somewhere else


def share(make) -> float:
    """Share, 0 to 1, of the pairs in which an honest robot earns more than one that cheats.

    make(z_E) returns reward(z, z_next) of a new episode.
    """
    won = []
    for seed in range(DEMOS):
        rng = np.random.default_rng(seed)
        z_E = demonstration(rng)
        honest = [_earned(make(z_E), z_E, p, rng) for p in honest_robots(len(z_E))]
        cheats = [_earned(make(z_E), z_E, p, rng) for p in cheating_robots(len(z_E))]
        won += [h > c for h in honest for c in cheats]
    return float(np.mean(won))


def demonstration(rng: np.random.Generator) -> np.ndarray:
    """Keypoints (N, 4, 2): one rests, two come and go on, one is pushed from the middle on."""
    n = int(rng.integers(34, 46))
    s = np.clip((np.arange(n) - 4) / (n - 8), 0, 1)  # it rests at both ends
    s = s**2 * (3 - 2 * s)
    bend = np.sin(np.pi * s)[:, None]
    here = rng.uniform(-0.6, -0.2, (4, 2))
    way = rng.uniform(0.5, 1.0, (4, 2)) * (1, rng.choice([-0.3, 0.3]))
    z = here + s[:, None, None] * way + 0.2 * bend[:, None] * rng.normal(size=(4, 2))
    z[:, 0] = here[0]
    z[:, 3] = here[3] + np.maximum(0, 2 * s - 1)[:, None] * way[3]
    return z


def honest_robots(n: int) -> list[np.ndarray]:
    """Places in the demonstration, 0 to n - 1, at every step: in time, ahead, slow, slower, held
    up on the way, late from the start."""
    t = np.arange(STEPS + 1.0)
    held = np.where(t < 15, t, np.maximum(15, t - 25))
    return [np.clip(p, 0, n - 1) for p in (t, 1.3 * t, 0.75 * t, 0.5 * t, held, t - 30)]


def cheating_robots(n: int) -> list[np.ndarray]:
    """Idle; stop half-way, or just before the end; to and fro over the start, the middle, or all;
    begin again and again; go backwards; leap to the end."""
    t = np.arange(STEPS + 1.0)

    def shuttle(low, high):
        return low + np.abs(t % (2 * (high - low)) - (high - low))

    return [
        0 * t,
        np.minimum(t, n // 2),
        np.minimum(t, 0.85 * n),
        shuttle(0, 8),
        shuttle(n // 2 - 4, n // 2 + 4),
        shuttle(0, n - 1),
        t % (n // 2),
        np.maximum(n - 1 - t, 0),
        np.where(t < 2, 0.0, n - 1),
    ]


def _earned(reward, z_E, places, rng):
    """The return of a robot at these places, between frames in a straight line, a little off."""
    low = np.floor(places).astype(int).clip(0, len(z_E) - 2)
    rest = (places - low)[:, None, None]
    z = (1 - rest) * z_E[low] + rest * z_E[low + 1]  # (T, K, 2)
    z = z + NOISE * rng.normal(size=z.shape)
    for t in np.flatnonzero(rng.random(len(z)) < GLITCH):
        z[t, rng.integers(4)] = rng.uniform(-1, 1, 2)
    return sum(float(reward(a, b)) for a, b in pairwise(z))


STAR = Star(share, "of the pairs", bar=0.9, naive=0.859, ours=0.931)
