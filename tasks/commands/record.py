"""Film the human videos of a task: fifteen of the expert, one of random motion.

Beside the films go two files with what they do not show, `experts.npz` and `random.npz`: actions,
true states and times, from which the same films can be made again. `--robot` films the expert as a
robot instead, to look at what the classifier reward learns from.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import tasks
from lbw_minimal import video
from lbw_minimal.training import counted
from tasks.commands import JITTER, Parser
from tasks.world import Recording, expert_takes, random_takes, save_recordings
from tasks.world.scene import FPS

EXPERTS = 15  # videos of the task being done: AVID-m learns from all, LbW from the first alone


def parser() -> Parser:
    """The arguments of `record`."""
    p = Parser("record", "Film the human videos of a task again, into tasks/videos/TASK.")
    p.add_task()
    p.add_argument(
        "--robot",
        action="store_true",
        help=f"film {tasks.ROBOT_EXPERTS} videos of the robot expert, into runs/robot/TASK",
    )
    return p


def main(argv: list[str]) -> None:
    """Film them. Raises InputError for a mistake in the arguments, or if the expert fails often."""
    args = parser().read(argv)
    if args.robot:
        film_robot(args.task)
    else:
        film_human(args.task)


def film_human(name: str) -> None:
    """The human's expert videos and random motion, where the kit keeps its own."""
    folder = tasks.VIDEOS / name
    folder.mkdir(parents=True, exist_ok=True)
    env = tasks.bare(name, embodiment="human")
    experts = list[Recording]()
    for film, _, recording in counted(expert_takes(env, EXPERTS), EXPERTS, "expert videos"):
        experts.append(recording)
        video.write(folder / f"expert_{len(experts):02d}.mp4", film, FPS)
    save_recordings(folder / "experts.npz", experts)
    # Demonstration and random motion together have Table I's frames.
    frames = tasks.module(name).RECIPE.human_frames - len(experts[0].states)
    takes = random_takes(env, frames, seed=experts[-1].seed + 1, take=20)
    films, _, recordings = zip(*counted(takes, -(-frames // 20), "random motion"), strict=True)
    video.write(folder / "random.mp4", np.concatenate(films), FPS)
    save_recordings(folder / "random.npz", recordings)
    print(f"{name}: {EXPERTS} expert videos and {frames} frames of random motion in {folder}")


def film_robot(name: str) -> None:
    """The robot's expert videos. They are not shipped: a run films its own, the same ones."""
    folder = Path("runs") / "robot" / name
    folder.mkdir(parents=True, exist_ok=True)
    experts = list[Recording]()
    for film, recording in tasks.robot_experts(name, JITTER):
        experts.append(recording)
        video.write(folder / f"expert_{len(experts):02d}.mp4", film, FPS)
    save_recordings(folder / "experts.npz", experts)
    print(f"{name}: {len(experts)} expert videos of the robot in {folder}")
