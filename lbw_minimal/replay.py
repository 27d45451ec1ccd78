"""What soft actor-critic remembers: transitions, drawn again and again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch

from lbw_minimal.training import InputError

STACK = 3  # frames seen at once: one shows no motion
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
        """Keep obs, action, reward, next_obs, terminal of a transition, and nothing else."""
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


class FrameBuffer:
    """Transitions between stacks of the last three frames, every frame kept once.

    A stack is put together when it is drawn. Before an episode's third frame its first one fills
    the gap, as in `gymnasium.wrappers.FrameStackObservation`. frame: shape of a frame of uint8, as
    (84, 84, 3). capacity: of frames, at most the steps and episodes of the whole training; memory
    is taken as they come. path: a file that holds the frames, and must stay with the checkpoint, so
    that a checkpoint has no need to write them all again.
    """

    def __init__(
        self, frame: tuple[int, ...], action_dim: int, capacity: int, path: Path | None = None
    ):
        self.path, self.is_new = path, path is None or not path.exists()
        self.frames: np.ndarray
        if path is None:
            self.frames = np.zeros((capacity, *frame), np.uint8)
        else:
            mode: Any = "w+" if self.is_new else "r+"
            self.frames = np.memmap(path, np.uint8, mode, shape=(capacity, *frame))
        self.data = {k: np.zeros(capacity, np.float32) for k in ("reward", "terminal")}
        self.data["action"] = np.zeros((capacity, action_dim), np.float32)
        self.data |= {k: np.zeros(capacity, np.int64) for k in ("row", "start")}
        self.added, self.kept = 0, 0  # transitions and frames

    def __len__(self) -> int:
        return self.added

    def add(self, *, first: bool, obs: np.ndarray, next_obs: np.ndarray, **rest: Any) -> None:
        """Keep a transition between stacks (3, H, W, 3), the `first` of its episode or not.

        rest: action, reward, terminal. Raises IndexError when the buffer is full.
        """
        if first:
            self._start = self._keep(obs[-1])
        rest |= {"row": self.kept - 1, "start": self._start}
        for k, v in self.data.items():
            v[self.added] = rest[k]
        self._keep(next_obs[-1])
        self.added += 1

    def _keep(self, frame):
        """Keep a frame; its row."""
        self.frames[self.kept] = frame
        self.kept += 1
        return self.kept - 1

    def sample(self, rng: np.random.Generator, batch: int) -> Batch:
        """`batch` of the transitions, drawn with replacement."""
        i = rng.integers(len(self), size=batch)
        drawn = {k: v[i] for k, v in self.data.items()}
        ages = np.arange(1 - STACK, 2)  # the stack, and one frame more for the next one
        rows = np.maximum(drawn.pop("row")[:, None] + ages, drawn.pop("start")[:, None])
        frames = torch.from_numpy(self.frames[rows])  # (B, 4, H, W, 3)
        tensors = {k: torch.from_numpy(v) for k, v in drawn.items()}
        return tensors | {"obs": frames[:, :-1], "next_obs": frames[:, 1:]}

    def state_dict(self) -> dict[str, Any]:
        """The transitions, and the frames if they have no file; between episodes only."""
        state: dict[str, Any] = {"added": self.added, "kept": self.kept}
        state["data"] = {k: v[: self.added] for k, v in self.data.items()}
        if isinstance(self.frames, np.memmap):
            self.frames.flush()
            return state
        return state | {"frames": self.frames[: self.kept]}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Hold what the buffer held whose `state_dict` came through a checkpoint.

        Raises InputError if the file of frames that belongs to it is missing.
        """
        if self.path and self.is_new:
            raise InputError(f"{self.path}: lost beside its checkpoint; delete that, start anew.")
        self.added, self.kept = state["added"], state["kept"]
        for k, v in state["data"].items():
            self.data[k][: self.added] = v.numpy()
        if "frames" in state:
            self.frames[: self.kept] = state["frames"].numpy()
