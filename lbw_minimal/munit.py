"""MUNIT (Eq. 1-5): frames of the human domain x become frames of the robot domain y, without pairs.

The content code c says where things are, the style code s how a domain looks: G_Y(c_x, s_y) is
human frame x as the robot's camera would see it. In: videos (T, 84, 84, 3) uint8 of both domains.
Out: the networks, and the translated video. Three things are not in the paper: a cycle loss, losses
weighted by the distance from the median frame, and least squares. Without them small objects
vanish, or wall and table swap their brightness.

The comments on the constants, here and in `gan.py`, say what other values did while the kit was
built. No results file holds those runs; notebook 4 repeats some of them.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import nn

from lbw_minimal import gan
from lbw_minimal.gan import LOG_EVERY, MOTION_GAN, MOTION_L1, Critics, Losses, l1, least_squares
from lbw_minimal.images import motion_weight, spread, to_images
from lbw_minimal.munit_networks import MUNIT, Critic, bfloat16
from lbw_minimal.training import Checkpoint, pick_device, progress, seed_everything

# Of Eq. 5. They are half of MUNIT's; with MUNIT's own the arm stays blurred.
LAMBDA_IMAGE, LAMBDA_CONTENT, LAMBDA_STYLE = 5.0, 0.5, 0.5
# Not in the paper. MUNIT's authors add it where pixels must stay aligned, as here.
LAMBDA_CYCLE = 5.0
# Of the two Adams; both fall to 0 over the second half. With critics as slow as the generators the
# arm stays blurred.
LEARNING_RATE, CRITIC_RATE = 4e-4, 1.2e-3


def swap(model: MUNIT, x: torch.Tensor, y: torch.Tensor) -> tuple[torch.Tensor, ...]:
    """c_x, c_y, s_x, s_y, G_X(c_y, s_x), G_Y(c_x, s_y) of images x and y."""
    c_x, c_y = model.content(x, "x"), model.content(y, "y")
    s_x, s_y = model.style(x, "x"), model.style(y, "y")
    return c_x, c_y, s_x, s_y, model.decode(c_y, s_x, "x"), model.decode(c_x, s_y, "y")


def generator_losses(
    model: MUNIT,
    critics: Critics,
    x: torch.Tensor,
    y: torch.Tensor,
    swapped: Sequence[torch.Tensor],
    median_x: torch.Tensor | None = None,
    median_y: torch.Tensor | None = None,
) -> Losses:
    """The encoders' and generators' side of Eq. 1 to 4 by the paper's names, and the cycle loss.

    x, y: images (B, 3, 84, 84) in [-1, 1]. swapped: what `swap` made of them. Medians
    (1, 3, 84, 84) switch the motion weights on.
    """
    c_x, c_y, s_x, s_y, x_of_y, y_of_x = swapped
    c_x_again, c_y_again = model.content(y_of_x, "y"), model.content(x_of_y, "x")
    w_x, w_y = motion_weight(x, median_x, MOTION_L1), motion_weight(y, median_y, MOTION_L1)
    w_x_of_y = motion_weight(x_of_y, median_x, MOTION_GAN)
    w_y_of_x = motion_weight(y_of_x, median_y, MOTION_GAN)
    return {
        "L_GAN^x": least_squares(critics["x"](x_of_y), 1.0, w_x_of_y),  # Eq. 1
        "L_GAN^y": least_squares(critics["y"](y_of_x), 1.0, w_y_of_x),
        "L_rec^x": l1(model.decode(c_x, s_x, "x"), x, w_x),  # Eq. 2
        "L_rec^y": l1(model.decode(c_y, s_y, "y"), y, w_y),
        "L_rec^c_x": l1(c_x_again, c_x),  # Eq. 3
        "L_rec^c_y": l1(c_y_again, c_y),
        "L_rec^s_x": l1(model.style(x_of_y, "x"), s_x),  # Eq. 4
        "L_rec^s_y": l1(model.style(y_of_x, "y"), s_y),
        "L_cyc^x": l1(model.decode(c_x_again, s_x, "x"), x, w_x),  # not in the paper
        "L_cyc^y": l1(model.decode(c_y_again, s_y, "y"), y, w_y),
    }


def total_loss(L: Losses) -> torch.Tensor:
    """L_MUNIT of Eq. 5 plus the cycle loss."""
    return (
        L["L_GAN^x"]
        + L["L_GAN^y"]
        + LAMBDA_IMAGE * (L["L_rec^x"] + L["L_rec^y"])
        + LAMBDA_CONTENT * (L["L_rec^c_x"] + L["L_rec^c_y"])
        + LAMBDA_STYLE * (L["L_rec^s_x"] + L["L_rec^s_y"])  # Eq. 5
        + LAMBDA_CYCLE * (L["L_cyc^x"] + L["L_cyc^y"])  # not in the paper
    )


def discriminator_losses(
    critics: Critics,
    x: torch.Tensor,
    y: torch.Tensor,
    swapped: Sequence[torch.Tensor],
    median_x: torch.Tensor | None = None,
    median_y: torch.Tensor | None = None,
) -> Losses:
    """The critics' side of Eq. 1 in least squares: 1 for real x and y, 0 for their translations."""

    def loss(D, real, made, median):
        weights = (motion_weight(v, median, MOTION_GAN) for v in (real, made))
        return gan.critic_loss(D, real, made, *weights)  # Eq. 1

    x_of_y, y_of_x = swapped[4].detach(), swapped[5].detach()
    return {
        "L_D^x": loss(critics["x"], x, x_of_y, median_x),
        "L_D^y": loss(critics["y"], y, y_of_x, median_y),
    }


def _update(model, critics, adam_G, adam_D, x, y, medians) -> dict[str, float]:
    """A step of the generators, then one of the critics, on images x and y; all their losses."""
    critics.requires_grad_(False)  # the generators' step learns through the critics, not in them
    with bfloat16(x.device):
        swapped = swap(model, x, y)
        L_G = generator_losses(model, critics, x, y, swapped, *medians)
    gan.descend(adam_G, total_loss(L_G))

    critics.requires_grad_(True)
    with bfloat16(x.device):  # on the translations made above: new ones would cost an eighth more
        L_D = discriminator_losses(critics, x, y, swapped, *medians)
    gan.descend(adam_D, L_D["L_D^x"] + L_D["L_D^y"])
    return {name: loss.item() for name, loss in (L_G | L_D).items()}


def train(
    human: np.ndarray,
    robot: np.ndarray,
    *,
    iterations: int,
    seed: int,
    width: int = 20,
    batch: int = 4,
    device: str = "cpu",
    checkpoint: Checkpoint | None = None,
) -> tuple[MUNIT, list[dict]]:
    """Train on human and robot frames (T, 84, 84, 3) uint8.

    Returns the model of averaged weights and a log of `log_row`s.
    """
    checkpoint = checkpoint or Checkpoint(None)
    rng, to = seed_everything(seed), pick_device(device)
    model = MUNIT(width).to(to)
    critics = nn.ModuleDict({domain: Critic() for domain in "xy"}).to(to)
    average = copy.deepcopy(model)
    adam_G, adam_D = gan.adam(model, LEARNING_RATE), gan.adam(critics, CRITIC_RATE)
    medians = [gan.median_image(frames, to) for frames in (human, robot)]
    now, state = checkpoint.resume(
        dict(model=model, critics=critics, average=average, adam_G=adam_G, adam_D=adam_D, rng=rng),
        step=0, log=[], sums={},
    )  # fmt: skip

    bar = progress(iterations, "MUNIT", now.step)
    while now.step < iterations:
        gan.set_rate(adam_G, LEARNING_RATE, now.step / iterations)
        gan.set_rate(adam_D, CRITIC_RATE, now.step / iterations)
        x, y = (gan.draw(frames, batch, rng, to) for frames in (human, robot))
        losses = _update(model, critics, adam_G, adam_D, x, y, medians)
        now.step += 1
        gan.follow(average, model, now.step)
        now.sums = {name: now.sums.get(name, 0.0) + loss for name, loss in losses.items()}
        if now.step % LOG_EVERY == 0:
            mean = mean_images(average, human, robot)
            now.log.append(gan.log_row(now.step, now.sums, LOG_EVERY, mean))
            now.sums = {}
            bar.set_postfix_str(f"cycle {now.log[-1]['L_cyc^y']:.3f}")
        bar.update()
        checkpoint.save(state)
    bar.close()
    checkpoint.save(state, force=True)
    return average.eval(), now.log


@torch.no_grad()
def robot_style(model: MUNIT, robot_frames: np.ndarray) -> torch.Tensor:
    """Mean style code (style_dim,) of up to 64 of the real robot frames (T, 84, 84, 3) uint8."""
    device = next(model.parameters()).device
    return model.style(to_images(spread(robot_frames, 64), device), "y").mean(0)


def translate(model: MUNIT, frames: np.ndarray, robot_style: torch.Tensor) -> np.ndarray:
    """Human frames (T, 84, 84, 3) uint8 as the robot's, same shape and type: G_Y(c_x, s_y).

    The whole video gets one style (style_dim,). One for each frame would make the keypoints
    flicker.
    """
    return _decoded(model, frames, robot_style, "x", "y")


def _decoded(model, frames, style, source, target):
    def swapped(image):
        c = model.content(image, source)
        return model.decode(c, style.expand(len(c), -1), target)

    return gan.repaint(frames, swapped, style.device)


@torch.no_grad()
def mean_images(model: MUNIT, human: np.ndarray, robot: np.ndarray) -> dict[str, np.ndarray]:
    """Mean frames (84, 84, 3) in 0-255 of the domains, "x" and "y", and of their translations.

    "x_of_y" is what the robot's frames look like in the human domain, "y_of_x" the other way round.
    """
    human, robot = spread(human, 32), spread(robot, 32)
    s_x = model.style(to_images(human, next(model.parameters()).device), "x").mean(0)
    x_of_y = _decoded(model, robot, s_x, "y", "x")
    y_of_x = translate(model, human, robot_style(model, robot))
    named = {"x": human, "x_of_y": x_of_y, "y": robot, "y_of_x": y_of_x}
    return {name: frames.mean(0) for name, frames in named.items()}


def save(path: Path | str, model: MUNIT, style: torch.Tensor, task: str) -> None:
    """Write the model, the robot style (style_dim,) to translate with, and its task."""
    gan.save_weights(path, model, task, style=style)


def load(path: Path | str, task: str) -> tuple[MUNIT, torch.Tensor]:
    """Model and style that `save` wrote.

    Raises InputError if the file holds something else or belongs to another task.
    """
    model, saved = gan.load_weights(path, MUNIT, task)
    return model, saved["style"]
