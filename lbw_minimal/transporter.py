"""Transporter (Sec. III-B of the paper): keypoints without labels, from what moves between frames.

Eq. 6 rebuilds frame y from the features of frame x, cut out and pasted at K points; Eq. 7 compares.
Only what stands under a keypoint can change its place, so the points settle on arm and object.
In: videos (T, 84, 84, 3) uint8 of the robot and of the translated human. Out: keypoints z (T, K, 2)
in [-1, 1], x right and y down; (z + 1) * 42 - 0.5 is the pixel.

The comments on the constants say what other values did while the kit was built. No results file
holds those runs; notebook 5 repeats some of them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

from lbw_minimal.augment import degraded, recoloured, shifted
from lbw_minimal.images import median_frame, motion_weight, to_images
from lbw_minimal.training import (
    Checkpoint,
    InputError,
    load_weights,
    pick_device,
    progress,
    save_state,
    seed_everything,
)

SIGMA = 0.1  # width of a keypoint's Gaussian in units of z: one cell of the 21 x 21 map
# A keypoint must first feel the object from afar: if it starts at 0.1, the arm takes all of them.
SIGMA_START = 0.3
GAIN = 3.0  # of the logits: at 1 a peak of 6 among 441 cells is read as half-way to the centre
CROWDING_WEIGHT = 0.06  # at 0 one thing may take all K keypoints, at 0.3 some stay on the wall
# At 0 two keypoints may share arm and object as "the left one" and "the right one".
IDENTITY_WEIGHT = 0.02
PAIR_GAP = 20  # most frames between the two of a pair; further apart is as good as drawn freely
# Share of pairs drawn freely. Within PAIR_GAP frames the object has moved in only 4 of 10 pairs.
FREE_SHARE = 0.5
MOTION = 10.0  # weight of what differs from the median frame, see `motion_weight`
LEARNING_RATE = 2e-3  # falls to 0 along a cosine
BATCH = 32
LOG_EVERY = 50  # steps


def _block(c_in, c_out, kernel, stride):
    # Even kernels at stride 2 keep cell i of the map centred on pixel 4i + 1.5. Group norm with one
    # channel a group is instance norm.
    conv = nn.Conv2d(c_in, c_out, kernel, stride, (kernel - 1) // 2, bias=False)
    return nn.Sequential(conv, nn.GroupNorm(c_out, c_out), nn.ReLU(inplace=True))


def _encoder():
    return nn.Sequential(
        _block(3, 16, 6, 2),  # (B, 16, 42, 42)
        _block(16, 32, 4, 2),  # (B, 32, 21, 21)
        _block(32, 32, 3, 1),
    )


def _cells(n, like):
    # The centres of n cells that fill [-1, 1]: z = -1 and 1 are the edges of the frame.
    return (2 * torch.arange(n, dtype=like.dtype, device=like.device) + 1) / n - 1  # (n,)


def soft_argmax(logits: torch.Tensor) -> torch.Tensor:
    """Keypoints (B, K, 2) of logits (B, K, h, w): the mean position under the map's softmax.

    Kulkarni et al. take a softmax of each marginal; there x may come from the arm and y from the
    object.
    """
    p = (GAIN * logits.flatten(2)).softmax(-1).view(logits.shape)
    x = p.sum(2) @ _cells(logits.shape[3], logits)  # (B, K)
    y = p.sum(3) @ _cells(logits.shape[2], logits)
    return torch.stack([x, y], -1)


def _bumps(z, sigma, size):
    # Each keypoint's Gaussian exp(-d^2 / sigma^2) along x and along y: (B, K, 2, size).
    return torch.exp(-(((_cells(size, z) - z[..., None]) / sigma) ** 2))


def heat_map(z: torch.Tensor, sigma: float = SIGMA, size: int = 21) -> torch.Tensor:
    """H (B, 1, size, size) in [0, 1] of keypoints z (B, K, 2), Gaussians exp(-d^2 / sigma^2)."""
    g = _bumps(z, sigma, size)
    h = g[:, :, 1, :, None] * g[:, :, 0, None, :]  # (B, K, size, size)
    return 1 - (1 - h).prod(1, keepdim=True)  # a sum would exceed 1 where keypoints meet


def transport(
    phi_x: torch.Tensor, phi_y: torch.Tensor, h_x: torch.Tensor, h_y: torch.Tensor
) -> torch.Tensor:
    """Eq. 6: the features of x, cut out at both frames' keypoints, with y's pasted at y's.

    phi (B, C, h, w), h (B, 1, h, w) in [0, 1]. Nothing is learnt through the source x, as in
    Kulkarni et al. (2019).
    """
    phi_x, h_x = phi_x.detach(), h_x.detach()
    return (1 - h_x) * (1 - h_y) * phi_x + h_y * phi_y


def loss(y_hat: torch.Tensor, y: torch.Tensor, weight: torch.Tensor | float = 1.0) -> torch.Tensor:
    """Eq. 7, squared as in Kulkarni et al. (2019).

    Squares make a missing object cost more than a blurred edge.
    """
    return (weight * (y_hat - y) ** 2).mean()


def crowding(z: torch.Tensor, sigma: float) -> torch.Tensor:
    """Mean overlap in [0, 1) of the Gaussians of different keypoints z (B, K, 2).

    Not in the paper. It keeps two keypoints from following the same spot.
    """
    d2 = ((z[:, :, None] - z[:, None]) ** 2).sum(-1)  # (B, K, K)
    K = z.shape[1]
    # minus K, because each overlaps with itself
    return (torch.exp(-d2 / (2 * sigma**2)).sum((1, 2)) - K).mean() / K**2


def identity(z: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    """Variance over the batch of the mean colour of y (B, 3, 84, 84) under each z (B, K, 2).

    Not in the paper. A keypoint has to be the same thing in every frame, and a thing keeps its
    colour.
    """
    g = _bumps(z, SIGMA, 21)
    g = g / g.sum(-1, keepdim=True)
    small = F.avg_pool2d(y, 4)  # (B, 3, 21, 21)
    colour = torch.einsum("bkh,bkw,bchw->bkc", g[:, :, 1], g[:, :, 0], small)  # (B, K, 3)
    return colour.var(0).sum(-1).mean()


class Transporter(nn.Module):
    """Feature encoder Phi, keypoint detector Psi and refiner R, for images (B, 3, 84, 84)."""

    def __init__(self, K: int = 5):
        super().__init__()
        self.K = K
        self.phi = _encoder()
        self.psi = nn.Sequential(_encoder(), nn.Conv2d(32, K, 1))  # (B, K, 21, 21)
        self.refiner = nn.Sequential(
            _block(32, 32, 3, 1),
            nn.Upsample(scale_factor=2),
            _block(32, 16, 3, 1),  # (B, 16, 42, 42)
            nn.ConvTranspose2d(16, 3, 4, 2, 1),  # (B, 3, 84, 84)
        )

    def keypoints(self, images: torch.Tensor) -> torch.Tensor:
        """z (B, K, 2) in [-1, 1], x right and y down, of images (B, 3, 84, 84) in [-1, 1]."""
        return soft_argmax(self.psi(images))

    def forward(
        self,
        x: torch.Tensor,
        y: torch.Tensor,
        y_seen: torch.Tensor | None = None,
        sigma: float = SIGMA,
        moved: torch.Tensor | float = 0.0,
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """y rebuilt from x, (B, 3, 84, 84), and y's keypoints (B, K, 2).

        If `y_seen` is given, the detector looks at it instead of y; there everything has `moved` by
        (B, 1, 2) in units of z.
        """
        with torch.no_grad():  # `transport` would stop the gradient anyway; this saves its cost
            phi_x, h_x = self.phi(x), heat_map(self.keypoints(x), sigma)
        z_y = self.keypoints(y if y_seen is None else y_seen) - moved
        return self.refiner(transport(phi_x, self.phi(y), h_x, heat_map(z_y, sigma))), z_y


def _draw_pairs(lengths, n, rng):
    """Indices (n,) of sources and (n,) of targets into the joined videos.

    Every video is the target equally often.
    """
    ends = np.cumsum(lengths)
    starts = ends - lengths
    video = rng.integers(len(lengths), size=n)
    y = rng.integers(starts[video], ends[video])
    x = np.clip(y + rng.integers(-PAIR_GAP, PAIR_GAP + 1, n), starts[video], ends[video] - 1)
    return np.where(rng.random(n) < FREE_SHARE, rng.integers(ends[-1], size=n), x), y


def _update(model, optimizer, x, y, median, early, shift, hue) -> dict:
    """One step on images x, y (B, 3, 84, 84), and its row of the log; `early` falls from 1 to 0."""
    sigma = SIGMA + (SIGMA_START - SIGMA) * early
    seen, moved = shifted(y, shift) if shift else (y, 0.0)
    seen = degraded(recoloured(seen, hue) if hue else seen)
    y_hat, z_y = model(x, y, seen, sigma, moved)
    error = loss(y_hat, y, motion_weight(y, median, MOTION))
    apart = CROWDING_WEIGHT * early * crowding(z_y, sigma)
    same = IDENTITY_WEIGHT * (1 - early) * identity(z_y, y)
    optimizer.zero_grad()
    (error + apart + same).backward()
    nn.utils.clip_grad_norm_(model.parameters(), 1.0)
    optimizer.step()
    return {"loss": error.item(), "keypoint_std": z_y.detach().std(0).mean(-1).tolist()}


def train(
    videos: list[np.ndarray],
    *,
    iterations: int,
    seed: int,
    K: int = 5,
    shift: int = 0,
    hue: int = 0,
    device: str = "cpu",
    checkpoint: Checkpoint | None = None,
) -> tuple[Transporter, list[dict]]:
    """Fit a Transporter on videos (T, 84, 84, 3) uint8: the translated ones and the robot's.

    Robot frames are targets too, so the detector learns on what it later runs on; the paper names
    only translated targets. shift, hue, for experiments: the detector sees its frames moved by up
    to so many pixels, and half of them with hues turned by up to so many degrees. Returns the model
    and a log: step, loss, and each keypoint's standard deviation (near 0: glued to the background).
    Raises InputError for frames of another shape or type.
    """
    for i, v in enumerate(videos):
        if v.ndim != 4 or v.shape[1:] != (84, 84, 3) or v.dtype != np.uint8 or len(v) < 2:
            raise InputError(
                f"video {i} is {v.shape} {v.dtype}; give two or more frames, (T, 84, 84, 3) uint8."
            )
    checkpoint = checkpoint or Checkpoint(None)
    to, rng = pick_device(device), seed_everything(seed)
    lengths = np.array([len(v) for v in videos])
    few = np.concatenate([v[:: len(v) // 200 + 1] for v in videos])  # enough for the background
    median = to_images(median_frame(few), to)  # (1, 3, 84, 84)
    frames = np.concatenate(videos)
    model = Transporter(K).to(to).train()
    optimizer = torch.optim.Adam(model.parameters(), betas=(0.9, 0.99))
    now, state = checkpoint.resume(dict(model=model, optimizer=optimizer, rng=rng), step=0, log=[])

    bar = progress(iterations, "Transporter", now.step)
    while now.step < iterations:
        done = now.step / iterations
        warm_up = min(1.0, (now.step + 1) / 20)
        optimizer.param_groups[0]["lr"] = LEARNING_RATE * warm_up * (1 + np.cos(np.pi * done)) / 2
        x, y = (to_images(frames[i], to) for i in _draw_pairs(lengths, BATCH, rng))
        row = _update(model, optimizer, x, y, median, early=max(0.0, 1 - 2 * done),
                      shift=shift, hue=hue)  # fmt: skip
        now.step += 1
        bar.update()
        if now.step % LOG_EVERY == 0 or now.step == iterations:
            now.log.append({"step": now.step} | row)
        checkpoint.save(state, force=now.step == iterations)
    bar.close()
    return model.eval(), now.log


@torch.inference_mode()
def detect(model: Transporter, frames: np.ndarray) -> np.ndarray:
    """Keypoints z (T, K, 2) float32, x right and y down, of frames (T, 84, 84, 3) uint8."""
    device = next(model.parameters()).device
    batches = (frames[i : i + 64] for i in range(0, max(len(frames), 1), 64))
    return np.concatenate([model.keypoints(to_images(b, device)).cpu().numpy() for b in batches])


def _probe(z, true_px, z_held, true_held):
    """True and predicted pixels of a least-squares map with intercept, on held-out frames."""
    if z_held is None:
        # The last quarter: neighbouring frames are near copies, so a random split would leak.
        n = 3 * len(z) // 4
        z, z_held, true_px, true_held = z[:n], z[n:], true_px[:n], true_px[n:]
    a, a_held = (np.column_stack([v.reshape(len(v), -1), np.ones(len(v))]) for v in (z, z_held))
    return true_held, a_held @ np.linalg.lstsq(a, true_px, rcond=None)[0]


def r2(
    z: np.ndarray,
    true_px: np.ndarray,
    z_held: np.ndarray | None = None,
    true_held: np.ndarray | None = None,
) -> np.ndarray:
    """R^2 (D,) <= 1 of the best linear map from z (T, K, 2) to true_px (T, D), on held-out frames.

    Without a held-out set the last quarter is held out. A column that hardly moves has no
    meaningful R^2 (an object's height on a table): read its `pixel_error`.
    """
    true, predicted = _probe(z, true_px, z_held, true_held)
    residual, total = ((true - v) ** 2 for v in (predicted, true.mean(0)))
    return 1 - residual.sum(0) / np.maximum(total.sum(0), 1e-9)


def pixel_error(
    z: np.ndarray,
    true_px: np.ndarray,
    z_held: np.ndarray | None = None,
    true_held: np.ndarray | None = None,
) -> np.ndarray:
    """Root mean square error (D,) in pixels of the map of `r2`."""
    true, predicted = _probe(z, true_px, z_held, true_held)
    return np.sqrt(((true - predicted) ** 2).mean(0))


def save(path: Path | str, model: Transporter, task: str) -> None:
    """Write the detector of `task` with its sizes, atomically."""
    what = {"kind": "transporter", "task": task, "K": model.K}
    save_state(path, what | {"model": model.state_dict()})


def load(path: Path | str, task: str | None = None) -> Transporter:
    """The model in a file, on the CPU; any task's if `task` is None.

    Raises InputError if the file holds something else or belongs to another task.
    """
    saved = load_weights(path, "transporter", "a Transporter", task)
    model = Transporter(saved["K"])
    model.load_state_dict(saved["model"])
    return model.eval()
