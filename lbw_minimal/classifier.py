"""The goal classifier: what the paper's two rivals take for a reward.

A network learns to tell goal images, the ends of expert videos, from all others, and its logit of
the frame after an action is the reward (VICE's naive form: Fu et al. 2018, arXiv 1805.11686; Singh
et al. 2019, arXiv 1904.07854). It is trained once and then frozen. "Classifier-reward" trains it on
videos of the robot, "AVID-m" on translated videos of the human.
In: videos (T, 84, 84, 3) uint8. Out: a reward for every frame (84, 84, 3) uint8.

Batch, learning rate, iterations, image size and mixup are those of VICE's public code.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

from lbw_minimal.images import to_images
from lbw_minimal.training import (
    Checkpoint,
    InputError,
    load_weights,
    pick_device,
    progress,
    quantity,
    save_state,
    seed_everything,
)

GOAL_SHARE = 10  # the last 1 / GOAL_SHARE of a video shows the goal
SIDE = 48  # pixels of a side that the network sees; a frame has three times as many in all
BATCH = 128  # images, half of them goals; the public code takes 128 of either
LEARNING_RATE = 1e-4
MIXUP = 1.0  # both parameters of the Beta distribution: any mixture is equally likely
# Ours; the public code has none. Along push's robot videos logits stay within 4.4 (after 2,000
# iterations), so it bounds only what an image unlike any video can be paid.
CLIP = 10.0
CHANNELS_LAST = torch.channels_last  # in memory; so few channels take 1.8 times as long otherwise
LOG_EVERY = 100  # steps


def goal_frames(videos: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Goal images (P, 84, 84, 3) uint8, the last tenth of each video, and the rest (M, 84, 84, 3).

    A tenth is rounded up. Raises InputError for no videos, for frames of another shape or type, and
    for a video of a single frame, which has no rest.
    """
    if not videos:
        raise InputError("no videos: give at least one in which the task is done.")
    for i, v in enumerate(videos):
        _check(v, f"video {i}", 2)
    firsts = [len(v) - -(-len(v) // GOAL_SHARE) for v in videos]  # of the goal images
    split = [(v[first:], v[:first]) for v, first in zip(videos, firsts, strict=True)]
    positive, negative = zip(*split, strict=True)
    return np.concatenate(positive), np.concatenate(negative)


def _check(frames, name, least):
    if frames.ndim != 4 or frames.shape[1:] != (84, 84, 3) or frames.dtype != np.uint8:
        raise InputError(
            f"{name} is {frames.shape} {frames.dtype}; give frames, (T, 84, 84, 3) uint8."
        )
    if len(frames) < least:
        raise InputError(f"{name} has {quantity(len(frames), 'frame')}; give at least {least}.")


def small_images(frames: np.ndarray, device: torch.device | str = "cpu") -> torch.Tensor:
    """Frames (B, 84, 84, 3) uint8 as images (B, 3, 48, 48) in [-1, 1]."""
    images = to_images(frames, device)
    images = F.interpolate(images, (SIDE, SIDE), mode="bilinear", antialias=True)
    return images.contiguous(memory_format=CHANNELS_LAST)


class GoalClassifier(nn.Module):
    """How much an image looks like the goal: a logit, above 0 if the goal is the likelier.

    The public code has max-pooling and three dense layers where this has strides and one; a step of
    that took ten times as long.
    """

    longest: torch.Tensor  # () int64: steps of the longest video that it was shown

    def __init__(self, longest: int = 0) -> None:
        super().__init__()
        self.register_buffer("longest", torch.tensor(longest))
        self.layers = nn.Sequential(
            nn.Conv2d(3, 8, 4, 2, 1),  # (B, 8, 24, 24)
            nn.ReLU(),
            nn.Conv2d(8, 8, 4, 2, 1),  # (B, 8, 12, 12)
            nn.ReLU(),
            nn.Flatten(),
            nn.Linear(8 * 12 * 12, 128),
            nn.ReLU(),
            nn.Linear(128, 1),
        )
        self.to(memory_format=CHANNELS_LAST)  # type: ignore[call-overload]  # torch's stubs lack it

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        """Logits (B,) of images (B, 3, 48, 48) in [-1, 1]."""
        return self.layers(images).squeeze(1)


def mixup(
    images: torch.Tensor, labels: torch.Tensor, share: torch.Tensor, partner: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Images (B, C, H, W) and labels (B,), each mixed with its partner's (Zhang et al. 2017).

    share (B,) in [0, 1]: what stays of the own. partner (B,): indices into the batch. It keeps the
    classifier from certainty: after 200 iterations on push's human videos logits reach from -3.8 to
    2.7, without it from -5.1 to 3.1.
    """
    own = share.view(-1, 1, 1, 1)
    mixed = own * images + (1 - own) * images[partner]
    return mixed, share * labels + (1 - share) * labels[partner]


def _draw(positive, negative, rng):
    """A batch of images, half of them goals, and labels (B,): 1 for a goal."""
    half = BATCH // 2
    some = [x[rng.integers(len(x), size=half)] for x in (positive, negative)]
    labels = torch.cat([torch.ones(half), torch.zeros(half)])
    return torch.cat(some), labels.to(positive.device)


def _update(model, optimizer, images, labels, rng) -> float:
    """One step; returns its loss, which with these mixtures stays above 1/4 on average.

    Half of the partners have the other label, and there labels are uniform in [0, 1], whose mean
    entropy is 1/2.
    """
    share = torch.tensor(rng.beta(MIXUP, MIXUP, BATCH), dtype=torch.float32)
    partner = torch.from_numpy(rng.permutation(BATCH))
    mixed, target = mixup(images, labels, share.to(images.device), partner.to(images.device))
    loss = F.binary_cross_entropy_with_logits(model(mixed), target)
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    return loss.item()


def train(
    positive: np.ndarray,
    negative: np.ndarray,
    *,
    iterations: int = 10_000,
    seed: int,
    device: str = "cpu",
    checkpoint: Checkpoint | None = None,
) -> tuple[GoalClassifier, list[dict]]:
    """Fit a classifier on goal images and others, each (T, 84, 84, 3) uint8.

    Returns the model, frozen, and a log: step, loss, and accuracy on the step's images before they
    are mixed. Raises InputError for frames of another shape or type, or if there are none.
    """
    _check(positive, "positive", 1)
    _check(negative, "negative", 1)
    checkpoint = checkpoint or Checkpoint(None)
    to, rng = pick_device(device), seed_everything(seed)
    goals, others = small_images(positive, to), small_images(negative, to)
    model = GoalClassifier().to(to)
    optimizer = torch.optim.Adam(model.parameters(), lr=LEARNING_RATE)
    now, state = checkpoint.resume(dict(model=model, optimizer=optimizer, rng=rng), step=0, log=[])

    bar = progress(iterations, "classifier", now.step)
    while now.step < iterations:
        images, labels = _draw(goals, others, rng)
        loss = _update(model, optimizer, images, labels, rng)
        now.step += 1
        bar.update()
        if now.step % LOG_EVERY == 0 or now.step == iterations:
            with torch.no_grad():
                right = ((model(images) > 0) == (labels > 0.5)).float().mean().item()
            now.log.append({"step": now.step, "loss": loss, "accuracy": right})
        checkpoint.save(state, force=now.step == iterations)
    bar.close()
    return model.eval().requires_grad_(False), now.log


@torch.inference_mode()
def logits(model: GoalClassifier, frames: np.ndarray) -> np.ndarray:
    """Logits (T,) float32 of frames (T, 84, 84, 3) uint8."""
    device = next(model.parameters()).device
    return model(small_images(frames, device)).cpu().numpy()


class ClassifierReward:
    """The logit of the frame that a step led to, clipped to [-clip, clip], divided by clip.

    VICE takes logits and not probabilities: those are flat, 0 or 1, almost everywhere. The division
    is ours. A reward of about 1 a step is what SAC's first temperature is meant for; with logits as
    they are the policy lost its noise before it had found a goal. The model is frozen for good.
    """

    def __init__(self, model: GoalClassifier, clip: float = CLIP):
        self.model, self.clip = model.eval().requires_grad_(False), clip

    def __call__(self, frame: np.ndarray) -> tuple[float, dict[str, float]]:
        """The reward of a step that led to `frame` (84, 84, 3) uint8, in [-1, 1], and the logit."""
        logit = float(logits(self.model, frame[None])[0])
        return float(np.clip(logit / self.clip, -1, 1)), {"logit": logit}


def save(path: Path | str, model: GoalClassifier, task: str) -> None:
    """Write the classifier of `task`, atomically."""
    save_state(path, {"kind": "classifier", "task": task, "model": model.state_dict()})


def load(path: Path | str, task: str | None = None) -> GoalClassifier:
    """The model in a file, frozen, on the CPU; any task's if `task` is None.

    Raises InputError if the file holds something else or belongs to another task.
    """
    saved = load_weights(path, "classifier", "a goal classifier", task)
    model = GoalClassifier()
    model.load_state_dict(saved["model"])
    return model.eval().requires_grad_(False)
