"""MUNIT's networks: content and style encoders, the decoder with AdaIN, and the critics.

Images are (B, 3, 84, 84) in [-1, 1], content codes c (B, 4 width, 21, 21), style codes s
(B, style_dim). The networks are the published ones made small enough for two cores; comments say
where more than the width differs.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import nn


def adain(
    h: torch.Tensor, mean: torch.Tensor | None = None, std: torch.Tensor | None = None
) -> torch.Tensor:
    """h (B, C, H, W) with each channel of each image at mean and std (B, C), by default 0 and 1."""
    B, C, H, W = h.shape
    # Batch norm over B * C channels is this very formula in one pass. Measured on a CPU, it takes a
    # third of the time of var_mean and arithmetic.
    mean, std = (None if p is None else p.float().reshape(-1) for p in (mean, std))
    flat = h.reshape(1, B * C, H, W)
    return F.batch_norm(flat, None, None, std, mean, training=True).reshape(h.shape)


class _Residual(nn.Module):
    def __init__(self, c):
        super().__init__()
        self.first, self.second = nn.Conv2d(c, c, 3, padding=1), nn.Conv2d(c, c, 3, padding=1)

    def forward(self, h, mean_1=None, std_1=None, mean_2=None, std_2=None):
        return h + adain(self.second(F.relu(adain(self.first(h), mean_1, std_1))), mean_2, std_2)


class ContentEncoder(nn.Module):
    """E^c: images to content codes (B, 4 width, 21, 21)."""

    def __init__(self, width: int, blocks: int):
        super().__init__()
        # Half of the published network's time goes into its layers at 84 x 84. With 2 x 2 pixels
        # folded into channels, this one starts at 42 x 42 and loses nothing.
        self.stem = nn.Conv2d(12, 2 * width, 3, padding=1)
        self.down = nn.Conv2d(2 * width, 4 * width, 4, 2, 1)
        self.blocks = nn.Sequential(*(_Residual(4 * width) for _ in range(blocks)))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """c of images x."""
        h = F.relu(self.stem(F.pixel_unshuffle(x, 2)))  # (B, 2 width, 42, 42)
        return self.blocks(F.relu(adain(self.down(h))))  # (B, 4 width, 21, 21)


def _style_encoder(style_dim):
    # No normalisation: it would remove the very means and contrasts that are the style.
    return nn.Sequential(
        *(nn.Conv2d(3, 16, 6, 2, 2), nn.ReLU(inplace=True)),
        *(nn.Conv2d(16, 32, 4, 2, 1), nn.ReLU(inplace=True)),
        *(nn.Conv2d(32, 64, 4, 2, 1), nn.ReLU(inplace=True)),
        *(nn.AdaptiveAvgPool2d(1), nn.Flatten(), nn.Linear(64, style_dim)),
    )


class _Decoder(nn.Module):
    def __init__(self, width, style_dim, blocks):
        super().__init__()
        self.blocks = nn.ModuleList(_Residual(4 * width) for _ in range(blocks))
        sizes = blocks * 4 * 4 * width  # two means and two deviations a block
        self.mlp = nn.Sequential(nn.Linear(style_dim, 64), nn.ReLU(), nn.Linear(64, sizes))
        self.up = nn.ConvTranspose2d(4 * width, 2 * width, 4, 2, 1)
        self.out = nn.ConvTranspose2d(2 * width, 3, 4, 2, 1)
        # Start at middle grey. At the ends of tanh a wrong brightness would stick.
        with torch.no_grad():
            self.out.weight.mul_(0.1)
        self.out.bias = nn.Parameter(torch.zeros(3))

    def forward(self, c, s):
        p = self.mlp(s).view(len(s), len(self.blocks), 4, -1)  # (B, blocks, 4, 4 width)
        for i, block in enumerate(self.blocks):
            c = block(c, p[:, i, 0], 1 + p[:, i, 1], p[:, i, 2], 1 + p[:, i, 3])
        return torch.tanh(self.out(F.relu(self.up(c))))  # (B, 3, 84, 84)


class MUNIT(nn.Module):
    """E^c, E^s and G of both domains, "x" (human) and "y" (robot)."""

    def __init__(
        self, width: int = 20, style_dim: int = 8, blocks: int = 2, shared_content: bool = True
    ):
        super().__init__()
        self.sizes = dict(
            width=width, style_dim=style_dim, blocks=blocks, shared_content=shared_content
        )
        E_c = ContentEncoder(width, blocks)
        # With a shared encoder equal things start with equal codes in both domains. With two, only
        # the critics match them.
        E_c_y = E_c if shared_content else ContentEncoder(width, blocks)
        self.E_c = nn.ModuleDict({"x": E_c, "y": E_c_y})
        self.E_s = nn.ModuleDict({domain: _style_encoder(style_dim) for domain in "xy"})
        self.G = nn.ModuleDict({domain: _Decoder(width, style_dim, blocks) for domain in "xy"})

    def content(self, image: torch.Tensor, domain: str) -> torch.Tensor:
        """c (B, 4 width, 21, 21) of images of that domain."""
        return self.E_c[domain](image)

    def style(self, image: torch.Tensor, domain: str) -> torch.Tensor:
        """s (B, style_dim) of images of that domain."""
        return self.E_s[domain](image)

    def decode(self, c: torch.Tensor, s: torch.Tensor, domain: str) -> torch.Tensor:
        """Images (B, 3, 84, 84) of that domain with content c and style s (B, style_dim)."""
        return self.G[domain](c, s)


class Critic(nn.Module):
    """D of one domain: scores of all patches of 22 and 44 pixels, 1 for real, 0 for translated."""

    def __init__(self, width: int = 32):
        super().__init__()
        self.scales = nn.ModuleList(
            nn.Sequential(
                *(nn.Conv2d(3, width, 4, 2, 1), nn.LeakyReLU(0.2, inplace=True)),
                *(nn.Conv2d(width, 2 * width, 4, 2, 1), nn.LeakyReLU(0.2, inplace=True)),
                *(nn.Conv2d(2 * width, 4 * width, 4, 2, 1), nn.LeakyReLU(0.2, inplace=True)),
                nn.Conv2d(4 * width, 1, 1),
            )
            for _ in range(2)  # at 84 pixels a third scale would see single cells
        )

    def forward(self, image: torch.Tensor) -> list[torch.Tensor]:
        """Scores (B, 1, 10, 10) of the small patches and (B, 1, 5, 5) of the large ones."""
        return [self.scales[0](image), self.scales[1](F.avg_pool2d(image, 2))]


def bfloat16(device: torch.device) -> torch.autocast:
    """A context of bfloat16 where the processor knows it; there it halves a convolution's time."""
    able = device.type != "cpu" or torch.cpu.get_capabilities().get("avx512_bf16", False)
    return torch.autocast(device.type, torch.bfloat16, enabled=able)
