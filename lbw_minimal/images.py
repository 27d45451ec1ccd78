"""Frames and images: what cameras, files and people see, and what networks take.

Frames are (T, H, W, 3) uint8, images (B, 3, H, W) float in [-1, 1]. Besides the conversion: how far
an image is from the median frame of its video, which tells moving things from the background.
"""

from __future__ import annotations

import numpy as np
import torch


def to_images(frames: np.ndarray, device: torch.device | str = "cpu") -> torch.Tensor:
    """Frames (B, H, W, 3) in 0-255 as images (B, 3, H, W) in [-1, 1]."""
    return torch.tensor(frames, device=device).permute(0, 3, 1, 2).contiguous().float() / 127.5 - 1


def to_frames(images: torch.Tensor) -> np.ndarray:
    """Images (B, 3, H, W) in [-1, 1] as frames (B, H, W, 3) uint8."""
    grey = ((images.float() + 1) * 127.5).round().clamp(0, 255).byte()
    return grey.permute(0, 2, 3, 1).cpu().numpy()


def spread(frames: np.ndarray, n: int) -> np.ndarray:
    """Up to n of the frames (T, ...), evenly over the video."""
    return frames[np.linspace(0, len(frames) - 1, min(n, len(frames))).astype(int)]


def median_frame(frames: np.ndarray) -> np.ndarray:
    """The frame (1, H, W, 3) float in 0-255 that holds each pixel's median over (T, H, W, 3)."""
    return np.median(frames, axis=0, keepdims=True)


def motion_weight(images: torch.Tensor, median: torch.Tensor | None, gain: float) -> torch.Tensor:
    """1 + gain * distance of images (B, 3, H, W) from the median image (1, 3, H, W): (B, 1, H, W).

    Not in the paper. A small object is 1 % of the frame, and an unweighted loss can do without it.
    Without a median the weight is 1 everywhere, which is the paper.
    """
    if median is None:
        return torch.ones_like(images[:, :1])
    return 1 + gain * (images.detach().float() - median).abs().mean(1, keepdim=True)
