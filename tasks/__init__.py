"""The five tasks, registered with Gymnasium when this package is imported."""

from importlib import import_module

import gymnasium as gym

TASKS = ("reach", "push")

for _name in TASKS:
    _module = import_module(f"tasks.{_name}")
    gym.register(
        f"LbW-{_name.capitalize()}-v0",
        f"tasks.{_name}:{_name.capitalize()}",
        max_episode_steps=_module.HORIZON,
    )
