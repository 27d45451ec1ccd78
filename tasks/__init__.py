"""The five tasks, registered with Gymnasium when this package is imported."""

from importlib import import_module
from pathlib import Path
from types import ModuleType

import gymnasium as gym

ROOT = Path(__file__).resolve().parent.parent
VIDEOS = ROOT / "tasks" / "videos"
WEIGHTS = ROOT / "solutions" / "weights"
TASKS = ("reach", "push", "slide", "coffee", "drawer")


def module(name: str) -> ModuleType:
    """The task's file."""
    return import_module(f"tasks.{name}")


def sentence(name: str) -> str:
    """What is to be done in the task: the first sentence of its file."""
    return " ".join((module(name).__doc__ or "").partition("\n\n")[0].split())


def id_of(name: str) -> str:
    """What Gymnasium calls the task."""
    return f"LbW-{name.capitalize()}-v0"


for _name in TASKS:
    gym.register(
        id_of(_name), f"tasks.{_name}:{_name.capitalize()}", max_episode_steps=module(_name).HORIZON
    )
