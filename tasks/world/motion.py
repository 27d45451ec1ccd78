"""Who moves the arm in a video: the expert along its waypoints, or chance.

In: an environment and seeds. Out: actions, and films (T, 84, 84, 3) uint8 with the true pixels of
tip and object, which judge perception and are never learnt from, and a recording of what was done.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count, islice

import numpy as np

from lbw_minimal.training import InputError, counted
from tasks.world.env import LOW, TaskEnv
from tasks.world.recording import Recording, film
from tasks.world.scene import DT, SUBSTEPS

TRIES = 3  # a video: a human films again when it goes wrong, but not for ever


def expert_actions(env: TaskEnv, rng: np.random.Generator | None = None) -> Iterator[np.ndarray]:
    """Yield the actions that lead the tip along the task's waypoints; human-like with an `rng`.

    Each leg follows a minimum-jerk profile (Flash and Hogan 1985). With `rng` the legs bend, take
    uneven time, and sometimes end in a short pause.
    """
    start = env.arm.goal.copy()
    for end, seconds, exact in env.waypoints():
        bend = np.zeros(3)
        if rng is not None and not exact:
            seconds *= rng.uniform(0.9, 1.15)
            bend[[0, 2]] = rng.uniform(-1, 1, 2) * 0.08 * abs(end - start)[[2, 0]]
        steps = max(1, round(seconds / (DT * SUBSTEPS)))
        for i in range(1, steps + 1):
            s = i / steps
            s = s**3 * (10 - 15 * s + 6 * s * s)
            wanted = start + s * (end - start) + np.sin(np.pi * s) * bend
            yield np.clip((wanted - env.arm.goal) / env.STEP, -1, 1).astype(np.float32)
        start = np.asarray(end, float)
        if rng is not None and not exact and rng.random() < 0.4:
            for _ in range(rng.integers(1, 4)):
                yield np.zeros(3, np.float32)


def random_actions(rng: np.random.Generator, towards: float = 0.0) -> Iterator[np.ndarray]:
    """Yield random actions for ever, each held for 4 to 12 steps, so that the arm gets about and
    bumps into things; independent ones would tremble on the spot. `towards` -1 or 1 draws the step
    along x from that half, and keeps the height."""
    low, high = np.array([-1, -1, -1.0]), np.array([1, 1, 0.6])  # mostly low, where things are
    if towards:
        low[[0, 2]] = min(towards, 0), -0.4
        high[[0, 2]] = max(towards, 0), 0.2
    while True:
        action = rng.uniform(low, high).astype(np.float32)
        for _ in range(rng.integers(4, 13)):
            yield action


def record_random(
    env: TaskEnv, frames: int, seed: int, take: int = 25
) -> tuple[np.ndarray, np.ndarray]:
    """Film `frames` frames of random motion. Returns the frames (T, 84, 84, 3) uint8 and the true
    pixels (T, 4) of tip and object."""
    takes = counted(random_takes(env, frames, seed, take), -(-frames // take), "random motion")
    films, truth, _ = zip(*takes, strict=True)
    return np.concatenate(films), np.concatenate(truth)


def random_takes(
    env: TaskEnv, frames: int, seed: int, take: int
) -> Iterator[tuple[np.ndarray, np.ndarray, Recording]]:
    """Film `frames` frames of random motion in takes of `take` frames, the object placed anew for
    each. Yields what `film` returns, for each take."""
    rng = np.random.default_rng(seed)
    for start in range(0, frames, take):
        place = int(rng.integers(2**31))
        steps = min(take, frames - start) - 1
        yield film(env, place, islice(_wander(env, rng, take), steps), scatter=True)


def _wander(env, rng, take):
    """Random actions; a take that starts next to the object moves towards it for its first
    half."""
    gap = env.object_position() - env.arm.goal
    low = env.arm.goal[2] < env.WORKSPACE[0][2] + LOW
    beside = env.CONTACT and abs(gap[0]) < env.CONTACT + 0.05 and low
    seek, roam = random_actions(rng, np.sign(gap[0])), random_actions(rng)
    for i in count(1):
        yield next(seek if beside and i < take / 2 else roam)


def record_expert(env: TaskEnv, seed: int) -> tuple[np.ndarray, np.ndarray, Recording]:
    """Film one human-like expert episode. Returns what `film` does."""
    return film(env, seed, expert_actions(env, np.random.default_rng(seed)))


def expert_takes(env: TaskEnv, wanted: int) -> Iterator[tuple[np.ndarray, np.ndarray, Recording]]:
    """Film expert episodes of seeds 0, 1, ... until so many have succeeded.

    Yields what `film` returns, for each that did. Raises InputError if the expert fails too often.
    """
    filmed = 0
    for seed in range(TRIES * wanted):
        take = record_expert(env, seed)
        if take[2].success[-1]:
            yield take
            filmed += 1
            if filmed == wanted:
                return
    name, tries = type(env).__name__.lower(), f"{filmed} of {TRIES * wanted} tries"
    raise InputError(f"{name}: its expert succeeds in {tries}; mend its waypoints.")
