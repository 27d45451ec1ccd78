"""Film the human videos of a task: fifteen of the expert, one of random motion.

Beside the films go two files with what they do not show, `experts.npz` and `random.npz`: actions,
true states and times, from which the same films can be made again.
"""

from __future__ import annotations

import numpy as np

import tasks
from lbw_minimal import video
from lbw_minimal.training import InputError
from tasks.commands import Parser
from tasks.world import Recording, random_takes, record_expert, save_recordings
from tasks.world.scene import FPS

EXPERTS = 15  # videos of the task being done; the method learns from the first alone
TRIES = 3 * EXPERTS  # a human films again when it goes wrong, but not for ever


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
    seed, experts = 0, list[Recording]()
    while len(experts) < EXPERTS:
        if seed == TRIES:
            tries = f"{len(experts)} of {seed} tries"
            raise InputError(f"{name}: its expert succeeds in {tries}; mend its waypoints.")
        film, _, recording = record_expert(env, seed)
        seed += 1
        if recording.success[-1]:
            experts.append(recording)
            video.write(folder / f"expert_{len(experts):02d}.mp4", film, FPS)
    save_recordings(folder / "experts.npz", experts)
    # Demonstration and random motion together have Table I's frames.
    frames = tasks.module(name).RECIPE.human_frames - len(experts[0].states)
    films, _, takes = zip(*random_takes(env, frames, seed=seed, take=20), strict=True)
    video.write(folder / "random.mp4", np.concatenate(films), FPS)
    save_recordings(folder / "random.npz", takes)
    print(f"{name}: {EXPERTS} expert videos and {frames} frames of random motion in {folder}")
