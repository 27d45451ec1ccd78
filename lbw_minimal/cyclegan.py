"""CycleGAN (Zhu et al. 2017): how the rival AVID-m makes human frames x look like robot frames y.

Two generators, G: X -> Y and F: Y -> X, each against a critic, and one tie: there and back again
must end at the start, F(G(x)) = x and G(F(y)) = y. Nothing else says that the arm keeps its place.
In: videos (T, 84, 84, 3) uint8 of both domains. Out: the generators, and the translated video.

As published: least squares, cycle weight 10, no identity loss, the pool of 50 translations,
instance norm, residual blocks, Adam's rates, weights that start at a deviation of 0.02. Different,
to fit 84 x 84 pixels and two cores, and shared with `munit.py`: folded pixels instead of 7 x 7
layers at full size, zeros instead of reflections beyond the border, 4 x 4 kernels that double the
size, critics of patches of 22 and 44 pixels instead of 70 that have no norm and start as torch's
layers do, batches of 4 instead of 1, averaged weights. Six blocks of 80 channels make an iteration
about as long as one of MUNIT's; the publication has six of 256 for images of 128 pixels.
"""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from lbw_minimal import gan
from lbw_minimal.gan import LOG_EVERY, MOTION_GAN, MOTION_L1, Critics, Losses, l1, least_squares
from lbw_minimal.images import motion_weight, spread
from lbw_minimal.munit_networks import ContentEncoder, Critic, adain, bfloat16
from lbw_minimal.training import Checkpoint, pick_device, progress, seed_everything

LAMBDA_CYCLE = 10.0
LEARNING_RATE, CRITIC_RATE = 2e-4, 2e-4  # of the two Adams; both fall to 0 over the second half
POOL = 50  # earlier translations of a domain that its critic may be shown again


class Generator(nn.Module):
    """Images (B, 3, 84, 84) in [-1, 1] of one domain to those of the other."""

    def __init__(self, width: int, blocks: int):
        super().__init__()
        self.encode = ContentEncoder(width, blocks)
        self.up = nn.ConvTranspose2d(4 * width, 2 * width, 4, 2, 1)
        self.out = nn.ConvTranspose2d(2 * width, 3, 4, 2, 1)
        for name, p in self.named_parameters():
            nn.init.normal_(p, 0.0, 0.02) if name.endswith("weight") else nn.init.zeros_(p)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        """The translated images. `adain` without a style is instance norm."""
        h = torch.relu(adain(self.up(self.encode(image))))  # (B, 2 width, 42, 42)
        return torch.tanh(self.out(h))


class CycleGAN(nn.Module):
    """G and F between the domains "x" (human) and "y" (robot)."""

    def __init__(self, width: int = 20, blocks: int = 6):
        super().__init__()
        self.sizes = dict(width=width, blocks=blocks)
        self.G, self.F = Generator(width, blocks), Generator(width, blocks)

    def y_of_x(self, x: torch.Tensor) -> torch.Tensor:
        """G(x): human images as the robot's."""
        return self.G(x)

    def x_of_y(self, y: torch.Tensor) -> torch.Tensor:
        """F(y): robot images as the human's."""
        return self.F(y)


class ImagePool:
    """The last translations into one domain, so that its critic does not forget earlier ones."""

    def __init__(self, seed: int):
        self.images: list[torch.Tensor] = []  # up to POOL of (3, 84, 84)
        self.rng = np.random.default_rng(seed)

    def swap(self, made: torch.Tensor) -> torch.Tensor:
        """New translations (B, 3, 84, 84), about half of them exchanged for older ones.

        An older one leaves the pool, and the new one takes its place. Until the pool is full it
        only takes in. What it returns is detached from the generator.
        """
        return torch.stack([self._swap_one(image) for image in made.detach()])

    def _swap_one(self, new):
        if len(self.images) < POOL:
            self.images.append(new)
            return new
        if self.rng.random() >= 0.5:
            return new
        i = self.rng.integers(POOL)
        old, self.images[i] = self.images[i], new
        return old.to(new.device)  # one from a checkpoint is on the CPU

    def state_dict(self) -> dict[str, Any]:
        """All of it, to go through a file."""
        return {"images": self.images, "rng": self.rng.bit_generator.state}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Be the pool whose `state_dict` came through a file."""
        self.images = list(state["images"])
        self.rng.bit_generator.state = state["rng"]


def generator_losses(
    model: CycleGAN,
    critics: Critics,
    x: torch.Tensor,
    y: torch.Tensor,
    x_of_y: torch.Tensor,
    y_of_x: torch.Tensor,
    median_x: torch.Tensor | None = None,
    median_y: torch.Tensor | None = None,
) -> Losses:
    """The generators' side: L_GAN(F, D_X) and L_GAN(G, D_Y), and both halves of L_cyc(G, F).

    All images (B, 3, 84, 84) in [-1, 1]; x_of_y is F(y), y_of_x is G(x). Medians (1, 3, 84, 84)
    switch the motion weights on.
    """
    w_x, w_y = motion_weight(x, median_x, MOTION_L1), motion_weight(y, median_y, MOTION_L1)
    w_x_of_y = motion_weight(x_of_y, median_x, MOTION_GAN)
    w_y_of_x = motion_weight(y_of_x, median_y, MOTION_GAN)
    return {
        "L_GAN^x": least_squares(critics["x"](x_of_y), 1.0, w_x_of_y),
        "L_GAN^y": least_squares(critics["y"](y_of_x), 1.0, w_y_of_x),
        "L_cyc^x": l1(model.x_of_y(y_of_x), x, w_x),  # F(G(x)) against x
        "L_cyc^y": l1(model.y_of_x(x_of_y), y, w_y),  # G(F(y)) against y
    }


def total_loss(L: Losses) -> torch.Tensor:
    """L(G, F): both adversarial losses and the weighted cycle loss."""
    return L["L_GAN^x"] + L["L_GAN^y"] + LAMBDA_CYCLE * (L["L_cyc^x"] + L["L_cyc^y"])


def discriminator_losses(
    critics: Critics,
    x: torch.Tensor,
    y: torch.Tensor,
    x_of_y: torch.Tensor,
    y_of_x: torch.Tensor,
    median_x: torch.Tensor | None = None,
    median_y: torch.Tensor | None = None,
) -> Losses:
    """The critics' side: 1 for real x and y, 0 for translations, which come from the pools.

    The publication halves it, to slow the critics down. Adam divides a gradient by its size, so
    the half would change nothing.
    """

    def loss(D, real, made, median):
        weights = (motion_weight(v, median, MOTION_GAN) for v in (real, made))
        return gan.critic_loss(D, real, made, *weights)

    return {
        "L_D^x": loss(critics["x"], x, x_of_y, median_x),
        "L_D^y": loss(critics["y"], y, y_of_x, median_y),
    }


def _update(model, critics, pools, adam_G, adam_D, x, y, medians) -> dict[str, float]:
    """A step of the generators, then one of the critics, on images x and y; all their losses."""
    critics.requires_grad_(False)  # the generators' step learns through the critics, not in them
    with bfloat16(x.device):
        x_of_y, y_of_x = model.x_of_y(y), model.y_of_x(x)
        L_G = generator_losses(model, critics, x, y, x_of_y, y_of_x, *medians)
    gan.descend(adam_G, total_loss(L_G))

    critics.requires_grad_(True)
    x_of_y, y_of_x = pools["x"].swap(x_of_y), pools["y"].swap(y_of_x)
    with bfloat16(x.device):
        L_D = discriminator_losses(critics, x, y, x_of_y, y_of_x, *medians)
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
    motion: bool = False,
) -> tuple[CycleGAN, list[dict]]:
    """Train on human and robot frames (T, 84, 84, 3) uint8.

    motion: MUNIT's weights by the distance from the median frame, the kit's own mend, which neither
    publication has. Returns the model of averaged weights and a log of `log_row`s.
    """
    checkpoint = checkpoint or Checkpoint(None)
    rng, to = seed_everything(seed), pick_device(device)
    model = CycleGAN(width).to(to)
    critics = nn.ModuleDict({domain: Critic() for domain in "xy"}).to(to)
    pools = {domain: ImagePool(int(rng.integers(2**32))) for domain in "xy"}
    average = copy.deepcopy(model)
    adam_G, adam_D = gan.adam(model, LEARNING_RATE), gan.adam(critics, CRITIC_RATE)
    medians = [gan.median_image(frames, to) if motion else None for frames in (human, robot)]
    stateful = dict(model=model, critics=critics, average=average, adam_G=adam_G, adam_D=adam_D)
    stateful |= dict(pool_x=pools["x"], pool_y=pools["y"], rng=rng)
    now, state = checkpoint.resume(stateful, step=0, log=[], sums={})

    bar = progress(iterations, "CycleGAN", now.step)
    while now.step < iterations:
        gan.set_rate(adam_G, LEARNING_RATE, now.step / iterations)
        gan.set_rate(adam_D, CRITIC_RATE, now.step / iterations)
        x, y = (gan.draw(frames, batch, rng, to) for frames in (human, robot))
        losses = _update(model, critics, pools, adam_G, adam_D, x, y, medians)
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


def translate(model: CycleGAN, frames: np.ndarray) -> np.ndarray:
    """Human frames (T, 84, 84, 3) uint8 as the robot's, same shape and type: G(x)."""
    return gan.repaint(frames, model.y_of_x, next(model.parameters()).device)


def mean_images(model: CycleGAN, human: np.ndarray, robot: np.ndarray) -> dict[str, np.ndarray]:
    """Mean frames (84, 84, 3) in 0-255 of the domains, "x" and "y", and of their translations."""
    human, robot = spread(human, 32), spread(robot, 32)
    x_of_y = gan.repaint(robot, model.x_of_y, next(model.parameters()).device)
    y_of_x = translate(model, human)
    named = {"x": human, "x_of_y": x_of_y, "y": robot, "y_of_x": y_of_x}
    return {name: frames.mean(0) for name, frames in named.items()}


def save(path: Path | str, model: CycleGAN, task: str) -> None:
    """Write the model and its task."""
    gan.save_weights(path, model, task)


def load(path: Path | str, task: str) -> CycleGAN:
    """The model that `save` wrote.

    Raises InputError if the file holds something else or belongs to another task.
    """
    return gan.load_weights(path, CycleGAN, task)[0]
