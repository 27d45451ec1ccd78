"""What the translations share: losses, learning rates, averaged weights, and their files.

MUNIT (`munit.py`) and its rival CycleGAN (`cyclegan.py`) turn frames of a human domain x into
frames of a robot domain y, without pairs, against a critic for each domain. Frames are
(T, 84, 84, 3) uint8, images (B, 3, 84, 84) in [-1, 1], weights of pixels (B, 1, 84, 84).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

from lbw_minimal import training
from lbw_minimal.images import median_frame, to_frames, to_images
from lbw_minimal.munit_networks import Critic
from lbw_minimal.training import save_state

# Not in the paper: weights of what differs from the median frame, see `motion_weight`.
MOTION_L1 = 4.0  # with 0 the L1 losses forget the object, which covers 1 % of the picture
MOTION_GAN = 20.0  # with 0 the critics hardly look at the arm: four fifths of the patches are wall
AVERAGE = 0.995  # decay per step of the averaged weights, which flicker less from frame to frame
LOG_EVERY = 50  # steps
MADE = {"x": "x_of_y", "y": "y_of_x"}  # which of the mean images are translations into a domain

Losses = dict[str, torch.Tensor]
Critics = Mapping[str, Critic] | nn.ModuleDict
Model = TypeVar("Model", bound=nn.Module)


def l1(a: torch.Tensor, b: torch.Tensor, weight: torch.Tensor | float = 1.0) -> torch.Tensor:
    """Mean of the weighted |a - b|."""
    return (weight * (a.float() - b.float()).abs()).mean()


def least_squares(
    scores: Sequence[torch.Tensor], target: float, weight: torch.Tensor
) -> torch.Tensor:
    """Mean of a critic's squared errors; a patch counts by the weight (B, 1, 84, 84) within it."""
    # CycleGAN's, and not in the paper. The logarithms of Eq. 1 leave a losing generator without a
    # gradient; squares do not.
    loss = torch.zeros((), device=weight.device)
    for score in scores:  # (B, 1, h, w) of one scale
        h, w = score.shape[2:]
        cells = F.adaptive_avg_pool2d(weight, (h, w))
        loss = loss + (cells / cells.mean() * (score.float() - target) ** 2).mean() / len(scores)
    return loss


def critic_loss(
    D: Critic, real: torch.Tensor, made: torch.Tensor, w_real: torch.Tensor, w_made: torch.Tensor
) -> torch.Tensor:
    """A critic's side in least squares: 1 for real images, 0 for translations."""
    return least_squares(D(real), 1.0, w_real) + least_squares(D(made), 0.0, w_made)


def draw(
    frames: np.ndarray, n: int, rng: np.random.Generator, device: torch.device
) -> torch.Tensor:
    """n of the frames at random, as images."""
    return to_images(frames[rng.integers(len(frames), size=n)], device)


def median_image(frames: np.ndarray, device: torch.device) -> torch.Tensor:
    """The median frame as an image (1, 3, 84, 84)."""
    # in whole grey levels, as when the shipped weights were trained
    return to_images(median_frame(frames).astype(np.uint8), device)


def adam(network: nn.Module, rate: float) -> torch.optim.Adam:
    """Adam with the short memory (0.5 instead of 0.9) that both publications take."""
    return torch.optim.Adam(network.parameters(), rate, betas=(0.5, 0.999))


def set_rate(adam: torch.optim.Adam, rate: float, done: float) -> None:
    """The learning rate when a share `done` of the training is over: it falls to 0 from half on."""
    adam.param_groups[0]["lr"] = rate * min(1.0, 2 * (1 - done))


def descend(adam: torch.optim.Adam, loss: torch.Tensor) -> None:
    """A step down the loss's gradient."""
    adam.zero_grad()
    loss.backward()
    adam.step()


@torch.no_grad()
def follow(average: nn.Module, model: nn.Module, step: int) -> None:
    """Move the averaged weights towards the model's after step 1, 2, ..."""
    # A short memory at first, or the random start would stay in the average for a long time.
    decay = min(AVERAGE, step / (step + 10))
    for mean, p in zip(average.parameters(), model.parameters(), strict=True):
        mean.lerp_(p, 1 - decay)


def log_row(
    step: int, sums: dict[str, float], steps: int, mean: dict[str, np.ndarray]
) -> dict[str, float]:
    """A row of the log: each loss's mean over so many steps, and how far off the translations are.

    mean: mean frames of "x", "y", "x_of_y" and "y_of_x". `mean_image^x` and `mean_image^y` say how
    many grey levels (0-255) the mean translation is off that domain's mean frame. Different poses
    cost a few; over 20 two regions, such as wall and table, have swapped their brightness.
    """
    off = {d: float(np.abs(mean[made] - mean[d]).mean()) for d, made in MADE.items()}
    row = {"step": step} | {name: value / steps for name, value in sums.items()}
    return row | {f"mean_image^{d}": grey_levels for d, grey_levels in off.items()}


@torch.no_grad()
def repaint(
    frames: np.ndarray, network: Callable[[torch.Tensor], torch.Tensor], device: torch.device
) -> np.ndarray:
    """What a network of images makes of frames, same shape and type."""
    images = (to_images(frames[i : i + 32], device) for i in range(0, len(frames), 32))
    return np.concatenate([to_frames(network(image)) for image in images])


def save_weights(path: Path | str, model: Any, task: str, **more: torch.Tensor) -> None:
    """Write a translation with its sizes and its task, and what else it needs.

    In half precision, which halves the file and moves a translated pixel by a grey level at most.
    A shared network is written once.
    """
    weights = {name: w.half() for name, w in model.named_parameters()}
    what = {"kind": type(model).__name__.lower(), "task": task, "sizes": model.sizes}
    save_state(path, what | {"model": weights} | more)


def load_weights(path: Path | str, kind: type[Model], task: str) -> tuple[Model, dict[str, Any]]:
    """The translation of that class, and all else that `save_weights` wrote.

    Raises InputError if the file holds something else or belongs to another task.
    """
    name = kind.__name__
    saved = training.load_weights(path, name.lower(), f"a {name}", task)
    model = kind(**saved["sizes"])
    with torch.no_grad():
        for name, p in model.named_parameters():
            p.copy_(saved["model"][name])
    return model.eval(), saved
