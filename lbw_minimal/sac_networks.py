"""The networks of soft actor-critic: an actor that draws actions, and two critics in one.

In: observations (B, S), brought to mean 0 and variance 1. Out: actions (B, A) in (-1, 1) with their
log-density, and Q-values. Not in the publication: running normalisation of observations, and
LayerNorm in the critics, which keeps Q from running away when steps are few.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import gymnasium as gym
import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

# Below this lies a keypoint's noise: dividing by less would blow it up into a signal.
MIN_OBS_STD = 0.02
# exp(-5) is as good as deterministic; exp(2) is past tanh's ends.
LOG_STD_MIN, LOG_STD_MAX = -5.0, 2.0


def length(space: gym.Space) -> int:
    """Of the vectors in a Box."""
    assert isinstance(space, gym.spaces.Box)
    return space.shape[0]


class Normaliser(nn.Module):
    """Observations (..., S) with mean 0 and variance 1 over all that were observed."""

    count: torch.Tensor
    mean: torch.Tensor
    var: torch.Tensor

    def __init__(self, obs_dim: int):
        super().__init__()
        self.register_buffer("count", torch.tensor(0))
        self.register_buffer("mean", torch.zeros(obs_dim))
        self.register_buffer("var", torch.ones(obs_dim))

    def observe(self, obs: np.ndarray) -> None:
        """Take one observation (S,) into the running mean and variance (Welford)."""
        self.count += 1
        delta, share = torch.as_tensor(obs) - self.mean, 1 / int(self.count)
        self.mean = self.mean + share * delta
        self.var = (1 - share) * (self.var + share * delta.square())

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        return ((obs - self.mean) / self.var.sqrt().clamp(min=MIN_OBS_STD)).clamp(-5, 5)


class Actor(nn.Module):
    """pi(a|s) = tanh(Normal(mean(s), std(s))), every action in (-1, 1)."""

    def __init__(self, obs_dim: int, action_dim: int, width: int):
        super().__init__()
        self.sizes: dict[str, Any] = {"obs_dim": obs_dim, "action_dim": action_dim, "width": width}
        self.net = nn.Sequential(
            *(nn.Linear(obs_dim, width), nn.ReLU()),
            *(nn.Linear(width, width), nn.ReLU()),
            nn.Linear(width, 2 * action_dim),
        )

    def forward(self, s: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        mean, log_std = self.net(s).chunk(2, dim=-1)  # (B, A), (B, A)
        # A tanh keeps a gradient at both bounds; a hard clamp would not.
        log_std = LOG_STD_MIN + 0.5 * (LOG_STD_MAX - LOG_STD_MIN) * (torch.tanh(log_std) + 1)
        return mean, log_std

    def sample(self, s: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Draw actions (B, A) with their log-density (B,), differentiable in the weights."""
        return draw(*self(s))


def draw(mean: torch.Tensor, log_std: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw a = tanh(u) (B, A), u ~ Normal(mean, std), with its log-density (B,)."""
    noise = torch.randn_like(mean)
    u = mean + log_std.exp() * noise
    # log N(u) - log |da/du|, and log(1 - tanh(u)^2) = 2 (log 2 - u - softplus(-2u)) never
    # overflows
    log_normal = -0.5 * noise.square() - log_std - 0.5 * math.log(2 * math.pi)
    log_slope = 2 * (math.log(2) - u - F.softplus(-2 * u))
    return torch.tanh(u), (log_normal - log_slope).sum(-1)


class Policy:
    """All that acting takes: an actor, and what brings observations to the range it knows."""

    def __init__(self, actor: Actor, normalise: nn.Module):
        self.actor, self.normalise, self.sizes = actor, normalise, actor.sizes

    @torch.no_grad()
    def act(self, obs: np.ndarray, deterministic: bool = False) -> np.ndarray:
        """Action (A,) float32 in [-1, 1] for an observation: a sample, or the mean."""
        device = next(self.actor.parameters()).device
        s = self.normalise(torch.as_tensor(obs, dtype=torch.float32, device=device))
        a = torch.tanh(self.actor(s)[0]) if deterministic else self.actor.sample(s)[0]
        return a.cpu().numpy()


class TwinCritic(nn.Module):
    """Two independent Q(s, a) as one batched network: half the calls of two modules."""

    def __init__(self, obs_dim: int, action_dim: int, width: int):
        super().__init__()
        sizes = [obs_dim + action_dim, width, width, 1]
        self.weights, self.biases = nn.ParameterList(), nn.ParameterList()
        for n_in, n_out in pairwise(sizes):
            bound = n_in**-0.5  # as nn.Linear
            self.weights.append(torch.empty(2, n_in, n_out).uniform_(-bound, bound))
            self.biases.append(torch.empty(2, 1, n_out).uniform_(-bound, bound))

    def forward(self, s: torch.Tensor, a: torch.Tensor) -> torch.Tensor:
        """Q_1 and Q_2 (2, B) of s (B, S) and a (B, A)."""
        W, b = self.weights, self.biases
        x = torch.cat([s, a], -1).expand(2, -1, -1)  # (2, B, S + A)
        for i in range(2):
            # The bias goes in before LayerNorm, which forgets scale: Q(s, a) would equal Q(2s, 2a).
            x = F.relu(F.layer_norm(torch.baddbmm(b[i], x, W[i]), W[i].shape[-1:]))  # (2, B, width)
        return torch.baddbmm(b[2], x, W[2]).squeeze(-1)  # (2, B)
