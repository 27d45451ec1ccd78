"""The five tasks, registered with Gymnasium when this package is imported."""

import gymnasium as gym

TASKS = ("reach", "push")

for _name in TASKS:
    gym.register(f"LbW-{_name.capitalize()}-v0", f"tasks.{_name}:{_name.capitalize()}", max_episode_steps=50)
