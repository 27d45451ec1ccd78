"""The five tasks, registered with Gymnasium when this package is imported."""

from __future__ import annotations

import tasks.needs  # noqa: F401  # isort: skip  # first: it says what the others lack
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, cast

import gymnasium as gym

from lbw_minimal.training import InputError, counted

if TYPE_CHECKING:
    import numpy as np

    from lbw_minimal.imitate import Perception
    from tasks.world import Recording, TaskEnv

ROOT = Path(__file__).resolve().parent.parent
VIDEOS = ROOT / "tasks" / "videos"
WEIGHTS = ROOT / "solutions" / "weights"
ROBOT_EXPERTS = 35  # videos that the classifier reward learns from, as in the paper
TASKS = ("reach", "push", "slide", "coffee", "drawer")


def module(name: str) -> ModuleType:
    """The task's file."""
    return import_module(f"tasks.{name}")


def sentence(name: str) -> str:
    """What is to be done in the task: the first sentence of its file."""
    return " ".join((module(name).__doc__ or "").partition("\n\n")[0].split())


def goal(name: str) -> str:
    """What success is in the task, in words without a full stop; "" if its file does not say."""
    return getattr(module(name), name.capitalize()).GOAL


def id_of(name: str) -> str:
    """What Gymnasium calls the task."""
    return f"LbW-{name.capitalize()}-v0"


def moves_object(name: str) -> bool:
    """Whether the task is to move something; reach is not, there nothing is touched."""
    return getattr(module(name), name.capitalize()).CONTACT is not None


def bare(name: str, **options: Any) -> TaskEnv:
    """The task's environment without Gymnasium's wrappers: its arm, scene and truth at hand."""
    return cast("TaskEnv", gym.make(id_of(name), **options).unwrapped)


def trained_perception(name: str, weights: Path | None = None) -> Perception:
    """Perception in the folder `weights`, or the shipped one, that has watched the human video.

    Raises InputError if a file is missing, damaged, or another task's.
    """
    from lbw_minimal import imitate, video

    perception = imitate.load_perception(weights or WEIGHTS / name, name)
    perception.watch(video.read(VIDEOS / name / "expert_01.mp4")[0])
    return perception


def pace_film(name: str, seed: int = 0, frames: int | None = None) -> np.ndarray:
    """Random robot motion (frames, 84, 84, 3) uint8; None: as much as shows the robot's pace."""
    from lbw_minimal.imitate import PACE
    from tasks.world import record_random

    env = bare(name)
    robot, _ = record_random(env, frames or PACE, seed=seed)
    env.close()
    return robot


def robot_experts(name: str, jitter: float) -> Iterator[tuple[np.ndarray, Recording]]:
    """The robot's expert videos (T, 84, 84, 3) uint8 and their recordings, for the classifier
    reward alone. Starts differ by up to `jitter` (m); so do the ways, as the human's do.

    Filming takes 10 to 22 s of processor time and gives the same every time, so nothing is kept.
    """
    from tasks.world import expert_takes

    env = bare(name, jitter=jitter)
    try:
        takes = counted(expert_takes(env, ROBOT_EXPERTS), ROBOT_EXPERTS, "robot experts")
        for frames, _, recording in takes:
            yield frames, recording
    finally:  # also if not all of them are wanted
        env.close()


def keypoint_env(name: str, reward: str | None = "mended", **options: Any) -> gym.Env:
    """Task `name` as the paper's agent sees it, for any agent that speaks Gymnasium.

    Observation: keypoints found by the shipped perception, (2K,) in [-1, 1], and what
    `KeypointRewardWrapper` adds to them. reward: "mended" or "literal", for following the task's
    human video; None leaves what the task itself pays, 1 where it is done and 0 elsewhere, and z_t
    alone is observed. options: of the task's environment, such as `jitter` (m). Takes a few
    seconds, because the robot is filmed to learn its pace. Raises InputError for an unknown task or
    reward.
    """
    from lbw_minimal import imitate, wrappers

    if name not in TASKS:
        raise InputError(f"{name}: there is no such task; choose one of {', '.join(TASKS)}.")
    env = gym.make(id_of(name), **options)
    if reward is None:
        perception = imitate.load_perception(WEIGHTS / name, name)
        return wrappers.KeypointObservation(env, perception.detect)
    return imitate.watched(env, trained_perception(name), pace_film(name), reward)[0]


for _name in TASKS:
    gym.register(
        id_of(_name), f"tasks.{_name}:{_name.capitalize()}", max_episode_steps=module(_name).HORIZON
    )
