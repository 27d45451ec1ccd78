"""MUNIT (Eq. 1-5): frames of the human domain x become frames of the robot domain y, learnt from no
pair.

The content code c says where things are, the style code s how a domain looks: G_Y(c_x, s_y) is
human frame x as the robot's camera would see it. In: videos (T, 84, 84, 3) uint8 of both domains.
Out: the networks, and the translated video. Not in the paper, because without them small objects
vanish or wall and table swap their brightness: a cycle loss, losses weighted by the distance from
the median frame, least squares.
"""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

from lbw_minimal.training import (
    Checkpoint,
    InputError,
    load_state,
    pick_device,
    progress,
    save_state,
    seed_everything,
)

# Eq. 5; half of MUNIT's, or the arm stays blurred
LAMBDA_IMAGE, LAMBDA_CONTENT, LAMBDA_STYLE = 5.0, 0.5, 0.5
# not in the paper: MUNIT's authors add it where pixels must stay aligned, as here
LAMBDA_CYCLE = 5.0
# Not in the paper: weights of what differs from the median frame, see `motion_weight`.
MOTION_L1 = 4.0  # with 0 the L1 losses forget the object, which covers 1 % of the picture
# with 0 four fifths of the patches are wall, and the critics hardly look at the arm
MOTION_GAN = 20.0
# Of the two Adams, down to 0 over the second half. Critics as slow as the generators leave the arm
# blurred.
LEARNING_RATE, CRITIC_RATE = 4e-4, 1.2e-3
AVERAGE = 0.995  # decay a step of the averaged weights, which flicker less from frame to frame
LOG_EVERY = 50  # steps


def adain(
    h: torch.Tensor, mean: torch.Tensor | None = None, std: torch.Tensor | None = None
) -> torch.Tensor:
    """h (B, C, H, W) with each channel of each image brought to mean and std (B, C), by default 0
    and 1."""
    B, C, H, W = h.shape
    # Batch norm over B * C channels is this very formula in one pass: 3 times faster on a CPU than
    # var_mean.
    mean, std = (None if p is None else p.float().reshape(-1) for p in (mean, std))
    return F.batch_norm(h.reshape(1, B * C, H, W), None, None, std, mean, training=True).reshape(
        h.shape
    )


class _Residual(nn.Module):
    def __init__(self, c):
        super().__init__()
        self.first, self.second = nn.Conv2d(c, c, 3, padding=1), nn.Conv2d(c, c, 3, padding=1)

    def forward(self, h, mean_1=None, std_1=None, mean_2=None, std_2=None):
        return h + adain(self.second(F.relu(adain(self.first(h), mean_1, std_1))), mean_2, std_2)


class _ContentEncoder(nn.Module):
    def __init__(self, width, blocks):
        super().__init__()
        # Half of the published network's time goes into its layers at 84 x 84. Folding 2 x 2 pixels
        # into channels starts at 42 x 42 and loses nothing.
        self.stem = nn.Conv2d(12, 2 * width, 3, padding=1)
        self.down = nn.Conv2d(2 * width, 4 * width, 4, 2, 1)
        self.blocks = nn.Sequential(*(_Residual(4 * width) for _ in range(blocks)))

    def forward(self, x):
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
        self.mlp = nn.Sequential(
            nn.Linear(style_dim, 64), nn.ReLU(), nn.Linear(64, blocks * 4 * 4 * width)
        )
        self.up = nn.ConvTranspose2d(4 * width, 2 * width, 4, 2, 1)
        self.out = nn.ConvTranspose2d(2 * width, 3, 4, 2, 1)
        # start at middle grey: at the ends of tanh a wrong brightness would stick
        with torch.no_grad():
            self.out.weight.mul_(0.1)
            self.out.bias.zero_()

    def forward(self, c, s):
        p = self.mlp(s).view(len(s), len(self.blocks), 4, -1)  # (B, blocks, 4, 4 width)
        for i, block in enumerate(self.blocks):
            c = block(c, p[:, i, 0], 1 + p[:, i, 1], p[:, i, 2], 1 + p[:, i, 3])
        return torch.tanh(self.out(F.relu(self.up(c))))  # (B, 3, 84, 84)


class MUNIT(nn.Module):
    """E^c, E^s and G of both domains, "x" (human) and "y" (robot); images (B, 3, 84, 84) in [-1,
    1]."""

    def __init__(
        self, width: int = 20, style_dim: int = 8, blocks: int = 2, shared_content: bool = True
    ):
        super().__init__()
        self.sizes = dict(
            width=width, style_dim=style_dim, blocks=blocks, shared_content=shared_content
        )
        E_c = _ContentEncoder(width, blocks)
        # Shared, equal things start with equal codes in both domains; apart, the critics alone
        # match them.
        self.E_c = nn.ModuleDict(
            {"x": E_c, "y": E_c if shared_content else _ContentEncoder(width, blocks)}
        )
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
    """D of one domain: scores of all patches of 22 and 44 pixels of (B, 3, 84, 84), 1 real, 0
    translated."""

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

    def forward(self, image):
        # (B, 1, 10, 10), (B, 1, 5, 5)
        return [self.scales[0](image), self.scales[1](F.avg_pool2d(image, 2))]


def motion_weight(image: torch.Tensor, median: torch.Tensor | None, gain: float) -> torch.Tensor:
    """1 + gain * distance of image (B, 3, H, W) from its domain's median frame (1, 3, H, W): (B, 1,
    H, W).

    Not in the paper; without a median it is 1 everywhere, which is the paper.
    """
    if median is None:
        return torch.ones_like(image[:, :1])
    return 1 + gain * (image.detach().float() - median).abs().mean(1, keepdim=True)


def _l1(a, b, weight=1.0):
    return (weight * (a.float() - b.float()).abs()).mean()


def _least_squares(scores, target, weight):
    # Not in the paper: the logarithms of Eq. 1 leave a losing generator without a gradient, squares
    # do not.
    loss = 0.0
    for score in scores:  # (B, 1, h, w) of one scale
        cells = F.adaptive_avg_pool2d(weight, score.shape[2:])
        loss = loss + (cells / cells.mean() * (score.float() - target) ** 2).mean() / len(scores)
    return loss


def swap(model: MUNIT, x: torch.Tensor, y: torch.Tensor) -> tuple[torch.Tensor, ...]:
    """c_x, c_y, s_x, s_y, G_X(c_y, s_x), G_Y(c_x, s_y) of images x and y (B, 3, 84, 84) in [-1,
    1]."""
    c_x, c_y = model.content(x, "x"), model.content(y, "y")
    s_x, s_y = model.style(x, "x"), model.style(y, "y")
    return c_x, c_y, s_x, s_y, model.decode(c_y, s_x, "x"), model.decode(c_x, s_y, "y")


def generator_losses(
    model, critics, x, y, swapped, median_x=None, median_y=None
) -> dict[str, torch.Tensor]:
    """The encoders' and generators' side of Eq. 1 to 4 by the paper's names, and the cycle loss
    L_cyc.

    x, y (B, 3, 84, 84) in [-1, 1], `swapped` from `swap`; medians (1, 3, 84, 84) switch motion
    weights on.
    """
    c_x, c_y, s_x, s_y, x_of_y, y_of_x = swapped
    c_x_again, c_y_again = model.content(y_of_x, "y"), model.content(x_of_y, "x")
    w_x, w_y = motion_weight(x, median_x, MOTION_L1), motion_weight(y, median_y, MOTION_L1)
    w_x_of_y = motion_weight(x_of_y, median_x, MOTION_GAN)
    w_y_of_x = motion_weight(y_of_x, median_y, MOTION_GAN)
    return {
        "L_GAN^x": _least_squares(critics["x"](x_of_y), 1.0, w_x_of_y),  # Eq. 1
        "L_GAN^y": _least_squares(critics["y"](y_of_x), 1.0, w_y_of_x),
        "L_rec^x": _l1(model.decode(c_x, s_x, "x"), x, w_x),  # Eq. 2
        "L_rec^y": _l1(model.decode(c_y, s_y, "y"), y, w_y),
        "L_rec^c_x": _l1(c_x_again, c_x),  # Eq. 3
        "L_rec^c_y": _l1(c_y_again, c_y),
        "L_rec^s_x": _l1(model.style(x_of_y, "x"), s_x),  # Eq. 4
        "L_rec^s_y": _l1(model.style(y_of_x, "y"), s_y),
        "L_cyc^x": _l1(model.decode(c_x_again, s_x, "x"), x, w_x),  # not in the paper
        "L_cyc^y": _l1(model.decode(c_y_again, s_y, "y"), y, w_y),
    }


def total_loss(L: dict[str, torch.Tensor]) -> torch.Tensor:
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
    critics, x, y, swapped, median_x=None, median_y=None
) -> dict[str, torch.Tensor]:
    """The critics' side of Eq. 1 in least squares: real x and y to 1, the translations in `swapped`
    to 0."""

    def loss(D, real, made, median):
        w_real, w_made = (
            motion_weight(real, median, MOTION_GAN),
            motion_weight(made, median, MOTION_GAN),
        )
        return _least_squares(D(real), 1.0, w_real) + _least_squares(D(made), 0.0, w_made)  # Eq. 1

    x_of_y, y_of_x = swapped[4].detach(), swapped[5].detach()
    return {
        "L_D^x": loss(critics["x"], x, x_of_y, median_x),
        "L_D^y": loss(critics["y"], y, y_of_x, median_y),
    }


def to_images(frames: np.ndarray, device: torch.device | str = "cpu") -> torch.Tensor:
    """Frames (B, H, W, 3) uint8 as images (B, 3, H, W) in [-1, 1]."""
    return torch.tensor(frames, device=device).permute(0, 3, 1, 2).contiguous().float() / 127.5 - 1


def to_frames(images: torch.Tensor) -> np.ndarray:
    """Images (B, 3, H, W) in [-1, 1] as frames (B, H, W, 3) uint8."""
    return (
        ((images.float() + 1) * 127.5)
        .round()
        .clamp(0, 255)
        .byte()
        .permute(0, 2, 3, 1)
        .cpu()
        .numpy()
    )


def _bfloat16(device):
    # bfloat16 halves a convolution's time where the processor knows it, and costs time where it
    # does not.
    able = device.type != "cpu" or torch.cpu.get_capabilities().get("avx512_bf16", False)
    return torch.autocast(device.type, torch.bfloat16, enabled=able)


def _draw(frames, n, rng, device):
    return to_images(frames[rng.integers(len(frames), size=n)], device)


def _median(frames, device):
    # (1, 3, 84, 84)
    return to_images(np.median(frames, axis=0, keepdims=True).astype(np.uint8), device)


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
    """Train on human and robot frames (T, 84, 84, 3) uint8; returns the model of averaged weights
    and a log.

    A row of the log holds `step`, each loss's mean since the row before, and how many grey levels
    (0-255) the mean translation is off that domain's mean frame: `mean_image^x`, `mean_image^y`.
    Different poses cost a few; over 20 two regions, such as wall and table, have swapped their
    brightness.
    """
    checkpoint = checkpoint or Checkpoint(None)
    rng = seed_everything(seed)
    device = pick_device(device)
    model = MUNIT(width).to(device)
    critics = nn.ModuleDict({domain: Critic() for domain in "xy"}).to(device)
    average = copy.deepcopy(model)
    adam_G = torch.optim.Adam(model.parameters(), LEARNING_RATE, betas=(0.5, 0.999))
    adam_D = torch.optim.Adam(critics.parameters(), CRITIC_RATE, betas=(0.5, 0.999))
    median_x, median_y = _median(human, device), _median(robot, device)
    stateful = dict(model=model, critics=critics, average=average, adam_G=adam_G, adam_D=adam_D)

    step, log, sums = 0, [], {}
    if saved := checkpoint.load():
        for name, thing in stateful.items():
            thing.load_state_dict(saved[name])
        rng.bit_generator.state = saved["rng"]
        step, log, sums = saved["step"], saved["log"], saved["sums"]

    def state():
        now = {name: thing.state_dict() for name, thing in stateful.items()}
        return now | dict(rng=rng.bit_generator.state, step=step, log=log, sums=sums)

    bar = progress(iterations, "MUNIT", step)
    while step < iterations:
        for adam, rate in ((adam_G, LEARNING_RATE), (adam_D, CRITIC_RATE)):
            adam.param_groups[0]["lr"] = rate * min(1.0, 2 * (1 - step / iterations))
        x, y = _draw(human, batch, rng, device), _draw(robot, batch, rng, device)

        # the generators' step learns through the critics, not in them
        critics.requires_grad_(False)
        with _bfloat16(device):
            swapped = swap(model, x, y)
            L_G = generator_losses(model, critics, x, y, swapped, median_x, median_y)
        adam_G.zero_grad()
        total_loss(L_G).backward()
        adam_G.step()

        critics.requires_grad_(True)
        # on the translations made above: new ones would cost an eighth more
        with _bfloat16(device):
            L_D = discriminator_losses(critics, x, y, swapped, median_x, median_y)
        adam_D.zero_grad()
        sum(L_D.values()).backward()
        adam_D.step()

        step += 1
        # short at first, or the random start stays in for long
        decay = min(AVERAGE, step / (step + 10))
        with torch.no_grad():
            for mean, p in zip(average.parameters(), model.parameters(), strict=True):
                mean.lerp_(p, 1 - decay)
        for name, loss in (L_G | L_D).items():
            sums[name] = sums.get(name, 0.0) + loss.item()
        if step % LOG_EVERY == 0:
            log.append({"step": step} | {name: value / LOG_EVERY for name, value in sums.items()})
            mean = mean_images(average, human, robot)
            log[-1]["mean_image^x"] = float(np.abs(mean["x_of_y"] - mean["x"]).mean())
            log[-1]["mean_image^y"] = float(np.abs(mean["y_of_x"] - mean["y"]).mean())
            sums = {}
            bar.set_postfix_str(f"cycle {log[-1]['L_cyc^y']:.3f}")
        bar.update()
        checkpoint.save(state)
    bar.close()
    checkpoint.save(state, force=True)
    return average.eval(), log


def _spread(frames, n):
    return frames[np.linspace(0, len(frames) - 1, min(n, len(frames))).astype(int)]


@torch.no_grad()
def robot_style(model: MUNIT, robot_frames: np.ndarray) -> torch.Tensor:
    """Mean style code (style_dim,) of up to 64 of the real robot frames (T, 84, 84, 3) uint8."""
    device = next(model.parameters()).device
    return model.style(to_images(_spread(robot_frames, 64), device), "y").mean(0)


def translate(model: MUNIT, frames: np.ndarray, robot_style: torch.Tensor) -> np.ndarray:
    """Human frames (T, 84, 84, 3) uint8 as the robot's, same shape and type: G_Y(c_x, s_y).

    One style (style_dim,) for the whole video: a fresh one a frame would flicker into the
    keypoints.
    """
    return _decoded(model, frames, robot_style, "x", "y")


@torch.no_grad()
def _decoded(model, frames, style, source, target):
    device, made = style.device, []
    for start in range(0, len(frames), 32):
        c = model.content(to_images(frames[start : start + 32], device), source)
        made.append(to_frames(model.decode(c, style.expand(len(c), -1), target)))
    return np.concatenate(made)


@torch.no_grad()
def mean_images(model: MUNIT, human: np.ndarray, robot: np.ndarray) -> dict[str, np.ndarray]:
    """Mean frames (84, 84, 3) in 0-255: "x" and "y" of the domains, "x_of_y" and "y_of_x" of
    translations."""
    human, robot = _spread(human, 32), _spread(robot, 32)
    s_x = model.style(to_images(human, next(model.parameters()).device), "x").mean(0)
    x_of_y, y_of_x = (
        _decoded(model, robot, s_x, "y", "x"),
        translate(model, human, robot_style(model, robot)),
    )
    return {
        k: f.mean(0)
        for k, f in (("x", human), ("x_of_y", x_of_y), ("y", robot), ("y_of_x", y_of_x))
    }


def save(path: Path | str, model: MUNIT, style: torch.Tensor, task: str) -> None:
    """Write the model with its sizes, the robot style (style_dim,) to translate with, and its task.

    In half precision, which is half the file and moves a translated pixel by a grey level at most.
    """
    weights = {name: w.half() for name, w in model.state_dict().items()}
    what = {"kind": "munit", "task": task, "sizes": model.sizes}
    save_state(path, what | {"model": weights, "style": style})


def load(path: Path | str, task: str) -> tuple[MUNIT, torch.Tensor]:
    """Model and style that `save` wrote. Raises InputError if it holds another thing or another
    task."""
    saved = load_state(path)
    if saved.get("kind") != "munit":
        raise InputError(
            f"{path}: not the weights of a MUNIT; give the file that its training wrote."
        )
    if saved["task"] != task:
        raise InputError(
            f"{path}: weights of the task {saved['task']}, not of {task}; give those or train anew."
        )
    model = MUNIT(**saved["sizes"])
    model.load_state_dict(saved["model"])
    return model.eval(), saved["style"]
