"""The networks of soft actor-critic: an actor that draws actions, and two critics in one.

In: observations (B, S), brought to mean 0 and variance 1. Out: actions (B, A) in (-1, 1) with their
log-density, and Q-values. Not in the publication: LayerNorm in the critics, which keeps Q from
running away when steps are few.
"""

from __future__ import annotations

import math
from itertools import pairwise

import torch
import torch.nn.functional as F
from torch import nn

# exp(-5) acts as good as deterministic; exp(2) is past tanh's ends.
LOG_STD_MIN, LOG_STD_MAX = -5.0, 2.0


class Actor(nn.Module):
    """pi(a|s) = tanh(Normal(mean(s), std(s))), every action in (-1, 1)."""

    def __init__(self, obs_dim: int, action_dim: int, width: int):
        super().__init__()
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
        mean, log_std = self(s)
        noise = torch.randn_like(mean)
        u = mean + log_std.exp() * noise
        # log N(u) - log |da/du|, and log(1 - tanh(u)^2) = 2 (log 2 - u - softplus(-2u)) never
        # overflows
        log_normal = -0.5 * noise.square() - log_std - 0.5 * math.log(2 * math.pi)
        log_slope = 2 * (math.log(2) - u - F.softplus(-2 * u))
        return torch.tanh(u), (log_normal - log_slope).sum(-1)


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

    def forward(self, s: torch.Tensor, a: torch.Tensor, frozen: bool = False) -> torch.Tensor:
        """Q_1 and Q_2 (2, B) of s (B, S), a (B, A); `frozen` lets gradients pass to `a` alone."""
        W, b = ([p.detach() if frozen else p for p in ps] for ps in (self.weights, self.biases))
        x = torch.cat([s, a], -1).expand(2, -1, -1)  # (2, B, S + A)
        for i in range(2):
            # The bias goes in before LayerNorm, which forgets scale: Q(s, a) would equal Q(2s, 2a).
            x = F.relu(F.layer_norm(torch.baddbmm(b[i], x, W[i]), W[i].shape[-1:]))  # (2, B, width)
        return torch.baddbmm(b[2], x, W[2]).squeeze(-1)  # (2, B)
