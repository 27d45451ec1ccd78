"""Transporter (Sec. III-B): keypoints of a video without labels, from what has to move between two frames.

Eq. 6 rebuilds frame y from the features of frame x, cut out and pasted at K points; Eq. 7 compares.
Only what sits under a keypoint can change place, so the K points settle on what moves: arm and object.
In: videos (T, 84, 84, 3) uint8 of the robot and of the translated human. Out: keypoints z (T, K, 2)
in [-1, 1], x right and y down. `(z + 1) * 42 - 0.5` is the pixel.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

from lbw_minimal.training import Checkpoint, InputError, load_state, pick_device, progress, save_state, seed_everything

SIGMA = 0.1  # width of a keypoint's Gaussian in units of z: one cell of the 21 x 21 map
GAIN = 10.0  # marginal means are small; without a gain the soft-argmax starts, and stays, at the centre
GAP = 20  # frames; a pair further apart shares little but the background
ACROSS = 0.2  # share of pairs whose frames are drawn freely from two videos
MOTION = 10.0  # weight of what differs from the median frame; at 0 a small object gets no keypoint


def _block(c_in, c_out, kernel, stride):
    # Even kernels at stride 2 keep cell i centred on pixel 4i + 1.5. A group of one channel is instance norm.
    conv = nn.Conv2d(c_in, c_out, kernel, stride, (kernel - 1) // 2, bias=False)
    return nn.Sequential(conv, nn.GroupNorm(c_out, c_out), nn.ReLU(inplace=True))


def _encoder():
    return nn.Sequential(
        _block(3, 16, 6, 2),  # (B, 16, 42, 42)
        _block(16, 32, 4, 2),  # (B, 32, 21, 21)
        _block(32, 32, 3, 1),
    )


def _cells(n, like):
    return (2 * torch.arange(n, dtype=like.dtype, device=like.device) + 1) / n - 1  # centres of n cells in [-1, 1]


def soft_argmax(logits: torch.Tensor) -> torch.Tensor:
    """Keypoints (B, K, 2) of logits (B, K, h, w): the mean position under the softmax of each marginal mean."""
    x = (GAIN * logits.mean(2)).softmax(-1) @ _cells(logits.shape[3], logits)  # (B, K)
    y = (GAIN * logits.mean(3)).softmax(-1) @ _cells(logits.shape[2], logits)
    return torch.stack([x, y], -1)


def heat_map(z: torch.Tensor, size: int = 21, sigma: float = SIGMA) -> torch.Tensor:
    """H (B, 1, size, size) in [0, 1] of keypoints z (B, K, 2): H = 1 - prod_k (1 - h_k), h = exp(-d^2 / sigma^2)."""
    cells = _cells(size, z)
    g = torch.exp(-(((cells - z[..., None]) / sigma) ** 2))  # (B, K, 2, size), the two factors of each h_k
    h = g[:, :, 1, :, None] * g[:, :, 0, None, :]  # (B, K, size, size)
    return 1 - (1 - h).prod(1, keepdim=True)  # a sum would exceed 1 where keypoints meet


def transport(phi_x: torch.Tensor, phi_y: torch.Tensor, h_x: torch.Tensor, h_y: torch.Tensor) -> torch.Tensor:
    """Eq. 6: features of x without what stood at either frame's keypoints, and with y's at y's.

    phi (B, C, h, w), h (B, 1, h, w) in [0, 1]. As in Kulkarni et al. (2019) nothing is learnt through
    the source x: else the features of x could carry y's picture by themselves.
    """
    phi_x, h_x = phi_x.detach(), h_x.detach()
    return (1 - h_x) * (1 - h_y) * phi_x + h_y * phi_y


class Transporter(nn.Module):
    """Feature encoder Phi, keypoint detector Psi and refiner R for frames (B, 3, 84, 84) in [-1, 1]."""

    def __init__(self, K: int = 5):
        super().__init__()
        self.K = K
        self.phi = _encoder()
        self.psi = nn.Sequential(_encoder(), nn.Conv2d(32, K, 1))
        self.refiner = nn.Sequential(
            _block(32, 32, 3, 1),
            nn.Upsample(scale_factor=2),
            _block(32, 16, 3, 1),  # (B, 16, 42, 42)
            nn.ConvTranspose2d(16, 3, 4, 2, 1),  # (B, 3, 84, 84)
        )

    def keypoints(self, images: torch.Tensor) -> torch.Tensor:
        """z (B, K, 2) in [-1, 1], x right and y down, of images (B, 3, 84, 84) in [-1, 1]."""
        return soft_argmax(self.psi(images))

    def forward(self, x, y, y_seen=None):
        """y rebuilt from x by Eq. 6, (B, 3, 84, 84), and y's keypoints (B, K, 2)."""
        with torch.no_grad():
            phi_x, z_x = self.phi(x), self.keypoints(x)
        z_y = self.keypoints(y if y_seen is None else y_seen)
        return self.refiner(transport(phi_x, self.phi(y), heat_map(z_x), heat_map(z_y))), z_y
