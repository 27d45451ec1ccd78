"""What soft actor-critic remembers: transitions over n steps, drawn again and again.

In: the steps of an episode, one by one. Out: batches of (s_t, a_t, R, s_{t+n}, discount), where R
is the discounted sum of n rewards: the n-step return (Watkins 1989; in deep Q-learning Hessel et
al. 2018, arXiv 1710.02298). SAC's publication has n = 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

Batch = dict[str, torch.Tensor]  # transitions: obs, action, reward, next_obs, discount


class ReplayBuffer:
    """The last `capacity` transitions in arrays, each over `n` steps or to the episode's end.

    `reward` holds r_t + gamma r_{t+1} + ..., `discount` what Q(next_obs) is worth after that:
    gamma^n, and 0 where the task itself ended.
    """

    def __init__(self, obs_dim: int, action_dim: int, capacity: int, n: int, gamma: float):
        shapes: dict[str, tuple[int, ...]] = {"obs": (obs_dim,), "action": (action_dim,)}
        shapes |= {"next_obs": (obs_dim,), "reward": (), "discount": ()}
        self.data = {k: np.zeros((capacity, *s), np.float32) for k, s in shapes.items()}
        self.capacity, self.added, self.n, self.gamma = capacity, 0, n, gamma
        self._open: list[dict[str, Any]] = []  # steps whose n are not over

    def __len__(self) -> int:
        return min(self.added, self.capacity)

    def add(
        self,
        *,
        obs: np.ndarray,
        action: np.ndarray,
        reward: float,
        next_obs: np.ndarray,
        terminal: bool,
        truncated: bool,
    ) -> None:
        """Take one step of an episode. It can be drawn n - 1 steps later, or when that ends."""
        self._open.append({"obs": obs, "action": action, "reward": 0.0, "discount": 1.0})
        for step in self._open:
            step["reward"] += step["discount"] * reward
            step["discount"] *= self.gamma
        over = len(self._open) if terminal or truncated else int(len(self._open) == self.n)
        for step in self._open[:over]:
            # `truncated` stays out: the time limit is the clock's doing, and s' keeps its value.
            end = {"next_obs": next_obs, "discount": (1 - terminal) * step["discount"]}
            for name, value in (step | end).items():
                self.data[name][self.added % self.capacity] = value
            self.added += 1
        self._open = self._open[over:]

    def sample(self, rng: np.random.Generator, batch: int) -> Batch:
        """`batch` of the transitions, drawn with replacement."""
        i = rng.integers(len(self), size=batch)
        return {k: torch.from_numpy(v[i]) for k, v in self.data.items()}

    def state_dict(self) -> dict[str, Any]:
        """The transitions, and how many there have been; to be asked for between episodes."""
        return {"added": self.added, "data": {k: v[: len(self)] for k, v in self.data.items()}}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Hold what the buffer held whose `state_dict` came through a checkpoint."""
        self.added = state["added"]
        for k, v in state["data"].items():
            self.data[k][: len(self)] = v.numpy()
