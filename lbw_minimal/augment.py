"""Random changes to images that a keypoint detector has to cope with: poor cameras, shifts, hues.

In and out: images (B, 3, 84, 84) in [-1, 1] or somewhat beyond. Everything is drawn on the CPU,
whose random state is in the checkpoint.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F


def degraded(y: torch.Tensor) -> torch.Tensor:
    """y as a poor camera or an imperfect translation would show it; nothing moves, z must stay."""
    b = len(y)
    gain, bias = 1 + 0.15 * torch.randn(b, 3, 1, 1), 0.1 * torch.randn(b, 3, 1, 1)
    noise = 0.1 * torch.rand(b, 1, 1, 1) * torch.randn(y.shape)
    blurred = torch.rand(b, 1, 1, 1).to(y.device) < 0.5
    seen = y * gain.to(y.device) + (bias + noise).to(y.device)
    return torch.where(blurred, F.avg_pool2d(seen, 3, 1, 1), seen)


def shifted(y: torch.Tensor, most: int) -> tuple[torch.Tensor, torch.Tensor]:
    """y moved by up to `most` whole pixels, its edges repeated, and how far: (B, 1, 2) of z."""
    by = torch.randint(-most, most + 1, (len(y), 2))  # right and down
    wide, size = F.pad(y, 4 * [most], mode="replicate"), y.shape[-1]
    views = [
        image[:, most - down : most - down + size, most - right : most - right + size]
        for image, (right, down) in zip(wide, by.tolist(), strict=True)
    ]
    return torch.stack(views), (2 * by / size)[:, None].to(y)


def recoloured(y: torch.Tensor, degrees: float) -> torch.Tensor:
    """Half of the images y with their hues turned by up to so many degrees; grey stays grey."""
    angle = torch.deg2rad(degrees * (2 * torch.rand(len(y), 1, 1) - 1))
    cross = torch.tensor([[0.0, -1, 1], [1, 0, -1], [-1, 1, 0]]) / 3**0.5  # with the grey axis
    along = torch.full((3, 3), 1 / 3)
    turn = angle.cos() * torch.eye(3) + angle.sin() * cross + (1 - angle.cos()) * along
    chosen = (torch.rand(len(y), 1, 1, 1) < 0.5).to(y.device)
    return torch.where(chosen, torch.einsum("bij,bjhw->bihw", turn.to(y), y), y)
