"""Film the human videos of a task: fifteen of the expert, one of random motion."""

from __future__ import annotations

import numpy as np

import tasks
from lbw_minimal import video
from lbw_minimal.training import InputError
from tasks.commands import Parser
from tasks.world import record_expert, record_random
from tasks.world.scene import FPS

EXPERTS = 15  # videos of the task being done; the method learns from the first alone
TRIES = 3 * EXPERTS  # a human films again when it went wrong, but not for ever


def parser() -> Parser:
    """The arguments of `record`."""
    p = Parser("record", "Film the human videos of a task again, into tasks/videos/TASK.")
    p.add_task()
    return p


def main(argv: list[str]) -> None:
    """Film them. Raises InputError for a mistake in the arguments, or if the expert fails often."""
    name = parser().read(argv).task
    folder = tasks.VIDEOS / name
    folder.mkdir(parents=True, exist_ok=True)
    env = tasks.bare(name, embodiment="human")
    seed, films = 0, list[np.ndarray]()
    while len(films) < EXPERTS:
        if seed == TRIES:
            tries = f"{len(films)} of {seed} tries"
            raise InputError(f"{name}: its expert succeeds in {tries}; mend its waypoints.")
        film, _, done = record_expert(env, seed)
        seed += 1
        if done:
            films.append(film)
            video.write(folder / f"expert_{len(films):02d}.mp4", film, FPS)
    # Demonstration and random motion together have Table I's frames.
    frames = tasks.module(name).RECIPE.human_frames - len(films[0])
    random, _ = record_random(env, frames, seed=seed, take=20)
    video.write(folder / "random.mp4", random, FPS)
    print(f"{name}: {EXPERTS} expert videos and {len(random)} frames of random motion in {folder}")
