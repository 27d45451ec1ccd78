"""What soft actor-critic remembers: transitions, drawn again and again."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

Batch = dict[str, torch.Tensor]  # transitions: obs, action, reward, next_obs, terminal


class ReplayBuffer:
    """The last `capacity` transitions in arrays; `terminal` is 1 where the task itself ended."""

    def __init__(self, obs_dim: int, action_dim: int, capacity: int):
        shapes: dict[str, tuple[int, ...]] = {"obs": (obs_dim,), "action": (action_dim,)}
        shapes |= {"next_obs": (obs_dim,), "reward": (), "terminal": ()}
        self.data = {k: np.zeros((capacity, *s), np.float32) for k, s in shapes.items()}
        self.capacity, self.added = capacity, 0

    def __len__(self) -> int:
        return min(self.added, self.capacity)

    def add(self, **transition: Any) -> None:
        """Keep a transition: obs, action, reward, next_obs, terminal."""
        for k, v in self.data.items():
            v[self.added % self.capacity] = transition[k]
        self.added += 1

    def sample(self, rng: np.random.Generator, batch: int) -> Batch:
        """`batch` of the transitions, drawn with replacement."""
        i = rng.integers(len(self), size=batch)
        return {k: torch.from_numpy(v[i]) for k, v in self.data.items()}

    def state_dict(self) -> dict[str, Any]:
        """The transitions, and how many there have been."""
        return {"added": self.added, "data": {k: v[: len(self)] for k, v in self.data.items()}}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Hold what the buffer held whose `state_dict` came through a checkpoint."""
        self.added = state["added"]
        for k, v in state["data"].items():
            self.data[k][: len(self)] = v.numpy()
