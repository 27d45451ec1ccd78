"""The networks of SAC+AE (Yarats et al. 2019, arXiv 1910.01741): an encoder, its
mirror, an actor and two critics.

In: stacks of three frames (B, 3, 84, 84, 3) uint8. Out: latents h (B, 50) in (-1, 1), frames that
were decoded from them, actions. Not in the publication: in the slim size a patch of 4x4 pixels is
one position with 48 numbers a frame, which leaves a sixteenth of the positions to the convolutions.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import nn

from lbw_minimal.replay import STACK
from lbw_minimal.sac_networks import Actor, TwinCritic

FRAME = 84  # pixels of a frame's side
LATENT, CHANNELS = 50, 32


@dataclass(frozen=True)
class Size:
    """How large the networks and batches are, and how often the decoder learns."""

    patch: int  # pixels of a patch's side
    strides: tuple[int, ...]  # of the 3x3 convolutions
    shrink: int  # the decoder draws frames this many times smaller
    hidden: int  # width of actor and critics
    batch: int
    decode_every: int  # updates


SIZES = {
    "slim": Size(patch=4, strides=(2, 1), shrink=2, hidden=256, batch=64, decode_every=2),
    "published": Size(1, (2, 1, 1, 1), shrink=1, hidden=1024, batch=128, decode_every=1),
}


class Patches(nn.Module):
    """Stacks (..., 3, 84, 84, 3) in 0..255 -> x (..., 9 p p, 84 / p, 84 / p) in [-0.5, 0.5].

    Channels are frame, row and column in the patch, colour. They lie next to each other in memory
    (`channels_last`), which makes the convolutions after it faster.
    """

    def __init__(self, patch: int):
        super().__init__()
        self.patch = patch

    def forward(self, frames: torch.Tensor) -> torch.Tensor:
        p, n = self.patch, FRAME // self.patch
        x = frames.unflatten(-2, (n, p)).unflatten(-4, (n, p))  # (..., 3, n, p, n, p, 3)
        x = x.movedim((-5, -3), (-6, -5)).flatten(-4)  # (..., n, n, 9 p p)
        return x.movedim(-1, -3).float().div_(255).sub_(0.5)

    def shrunk(self, x: torch.Tensor, k: int) -> torch.Tensor:
        """x (B, 9 p p, n, n) with every k x k pixels averaged: (B, 9 p p / k^2, n, n)."""
        q = self.patch // k
        # Sums of slices: a mean over two dimensions of six takes ten times as long.
        y = x.movedim(1, -1).unflatten(-1, (STACK * q, k, q * k * 3))
        rows = sum(y.unbind(-2), torch.zeros(())).unflatten(-1, (q, k, 3))
        return (sum(rows.unbind(-2), torch.zeros(())) / k**2).flatten(-3).movedim(-1, 1)


def _sides(size: Size) -> list[int]:
    """Of the maps before, between and after the convolutions."""
    sides = [FRAME // size.patch]
    for stride in size.strides:
        sides.append((sides[-1] - 3) // stride + 1)
    return sides


class Encoder(nn.Module):
    """x (B, 9 p p, n, n) -> h (B, 50): 3x3 convolutions, a linear layer, LayerNorm, tanh."""

    def __init__(self, size: Size):
        super().__init__()
        channels = [3 * STACK * size.patch**2, *(CHANNELS for _ in size.strides)]
        convs = [
            layer
            for c_in, c_out, stride in zip(channels, channels[1:], size.strides, strict=False)
            for layer in (nn.Conv2d(c_in, c_out, 3, stride), nn.ReLU())
        ]
        self.convs = nn.Sequential(*convs)
        features = CHANNELS * _sides(size)[-1] ** 2
        self.out = nn.Sequential(nn.Linear(features, LATENT), nn.LayerNorm(LATENT), nn.Tanh())

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.out(self.convs(x).flatten(-3))


class Decoder(nn.Module):
    """h (B, 50) -> frames as patches (B, 9 q q, n, n), q = p / shrink: the encoder's mirror."""

    def __init__(self, size: Size):
        super().__init__()
        sides = _sides(size)[::-1]
        self.start = sides[0]
        self.linear = nn.Linear(LATENT, CHANNELS * self.start**2)
        channels = [CHANNELS for _ in size.strides]
        channels.append(3 * STACK * (size.patch // size.shrink) ** 2)
        self.convs = nn.ModuleList()
        for i, stride in enumerate(size.strides[::-1]):
            # the rows that the stride left over at the edge
            rest = sides[i + 1] - ((sides[i] - 1) * stride + 3)
            self.convs.append(
                nn.ConvTranspose2d(channels[i], channels[i + 1], 3, stride, output_padding=rest)
            )

    def forward(self, h: torch.Tensor) -> torch.Tensor:
        x = self.linear(h).unflatten(1, (CHANNELS, self.start, self.start))
        x = x.contiguous(memory_format=torch.channels_last)
        for conv in self.convs:
            x = conv(F.relu(x))
        return x


class PixelCritic(TwinCritic):
    """Q_1 and Q_2 of x: twin critics on latents, with the encoder that they train."""

    def __init__(self, encoder: Encoder, action_dim: int, size: Size):
        super().__init__(LATENT, action_dim, size.hidden)
        self.encoder = encoder

    def head(self, h: torch.Tensor, a: torch.Tensor) -> torch.Tensor:
        """Q_1 and Q_2 (2, B) of latents h (B, 50) and a (B, A)."""
        return super().forward(h, a)

    def forward(self, s: torch.Tensor, a: torch.Tensor) -> torch.Tensor:
        return self.head(self.encoder(s), a)


class PixelActor(Actor):
    """pi(a|x): an actor on latents, with the encoder that makes them.

    The two are averaged, chosen and saved together: another encoder's latents mean nothing to the
    actor's head. size: one of `SIZES`.
    """

    def __init__(self, encoder: Encoder, action_dim: int, size: str):
        super().__init__(LATENT, action_dim, SIZES[size].hidden)
        self.sizes = {"action_dim": action_dim, "size": size}
        self.encoder = encoder

    def head(self, h: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Mean and log standard deviation (B, A), before the tanh, of latents h (B, 50)."""
        return super().forward(h)

    def forward(self, s: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        return self.head(self.encoder(s))
