"""Eyes for any clip: where the tip of the arm is, and the object that it moves. Not from the paper.

A small network that has seen nothing but clips that were made for it, as `drawings.py` draws and
`tasks/world/renderings.py` renders them, looks at a frame and, for reference, at its clip's median,
first and last frame: what differs from those is arm or object.
Both have a place, or are nowhere. The clip is looked at twice: as a whole, and closer where
something happens.
In: frames (T, H, W, 3) uint8 of one clip with a still camera. Out: `Found`, in pixels of these
frames from their left and upper edge; `refine` then follows the object by its own texture.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import torch
from torch import nn
from torch.utils.data import DataLoader, Dataset

from lbw_minimal.clips.corners import followed
from lbw_minimal.clips.detector_networks import Network, both_ways, loss, read
from lbw_minimal.clips.drawings import Clip, draw_clip
from lbw_minimal.clips.drawn_shapes import SIZE
from lbw_minimal.images import median_frame, to_images
from lbw_minimal.munit_networks import bfloat16
from lbw_minimal.training import (
    Checkpoint,
    InputError,
    load_weights,
    pick_device,
    progress,
    save_state,
    seed_everything,
)

SURE = 0.5  # more is taken for there
MOST = 60  # frames that the median is taken of, spread over the clip
CLOSER = 0.8  # of the frame's longer side: a second look pays if it takes in less than this
BATCH = 32
LEARNING_RATE = 2e-3
SETTLE = 0.75  # share of the training, at its end, in which the learning rate falls to 0
POOL = 512  # clips that batches are drawn from
# Of them that make room for new ones in each iteration. Drawing takes long; but when each clip was
# seen 32 times, and not 16, the loss on clips of the pool was 0.6 lower than on any others.
NEW = 2
AHEAD = 8  # clips that a process draws before they are asked for
LOG_EVERY = 50  # iterations


@dataclass(frozen=True)
class Found:
    """Tip and object in T frames: pixels from the left and the upper edge, and how sure, 0 to 1.

    A place is a number even where the sureness says that nothing is there.
    """

    tip: np.ndarray  # (T, 2) float32
    object: np.ndarray  # (T, 2) float32
    tip_sure: np.ndarray  # (T,) float32
    object_sure: np.ndarray  # (T,) float32


class Look(NamedTuple):
    """What the network says of T frames, in one pass."""

    place: np.ndarray  # (T, 2, 2) pixels: of tip and object, x and y
    sure: np.ndarray  # (T, 2) 0 to 1
    # (T, h, w) 0 to 1: how sure each cell shows an arm. It is two pixels wide where the longer side
    # has 84.
    arms: np.ndarray


class Detector:
    """Finds tip and object in clips, with a network that `train` taught."""

    def __init__(self, network: Network):
        self.network = network.eval().requires_grad_(False)

    def detect(self, frames: np.ndarray, first: Look | None = None) -> Found:
        """Tip and object in the frames (T, H, W, 3) uint8 of one clip with a still camera.

        first: the look at all of them, if it has been taken. Raises InputError for frames of
        another shape or type.
        """
        place, sure, _ = first or self.look(frames)
        left, top, side = _closer(place, sure, frames.shape[1:3])
        if side < CLOSER * max(frames.shape[1:3]):
            near, near_sure, _ = self.look(frames[:, top : top + side, left : left + side])
            better = (near_sure > SURE) | (near_sure > sure)
            place = np.where(better[..., None], near + np.array([left, top], np.float32), place)
            sure = np.where(better, near_sure, sure)
        return Found(place[:, 0], place[:, 1], sure[:, 0], sure[:, 1])

    @torch.inference_mode()
    def look(self, frames: np.ndarray) -> Look:
        """One look at the frames (T, H, W, 3) uint8 of one clip with a still camera.

        Raises InputError for frames of another shape or type.
        """
        if frames.ndim != 4 or frames.shape[3] != 3 or frames.dtype != np.uint8 or not len(frames):
            raise InputError(
                f"frames are {frames.shape} {frames.dtype}; give a clip, (T, H, W, 3) uint8."
            )
        small, scale, corner = _fitted(frames)
        around = references(small)
        device, said = next(self.network.parameters()).device, []
        for i in range(0, len(small), 64):
            images = to_images(with_references(small[i : i + 64], around), device)
            said.append([one.cpu() for one in both_ways(self.network, images)])
        logits, shown = map(torch.cat, zip(*said, strict=True))
        place, sure = read(logits)
        ends = corner, corner + scale * frames.shape[2:0:-1]
        columns, rows = (slice(round(a / 2), round(b / 2)) for a, b in zip(*ends, strict=True))
        arms = shown[:, 0, rows, columns].sigmoid().numpy()
        return Look((place.numpy() - corner) / scale, sure.numpy(), arms)

    def save(self, path: Path | str) -> None:
        """Write the weights as half-precision numbers, atomically."""
        half = {name: value.half() for name, value in self.network.state_dict().items()}
        save_state(path, {"kind": "eyes", "task": "any", "model": half})

    @staticmethod
    def load(path: Path | str) -> Detector:
        """The detector in a file, on the CPU. Raises InputError if the file holds another thing."""
        network = Network()
        network.load_state_dict(load_weights(path, "eyes", "a detector", None)["model"])
        return Detector(network)


def refine(frames: np.ndarray, found: Found, cuts: Sequence[int] = ()) -> Found:
    """Found, with the object's places as its own corners moved, where these can be followed.

    cuts: frames with which a new shot begins, over which nothing is followed.
    """
    sure = found.object_sure
    path = np.where(sure[:, None] > SURE, found.object, np.nan)
    shots = [slice(*shot) for shot in pairwise([0, *cuts, len(frames)])]
    parts = [followed(frames[shot], path[shot]) for shot in shots]
    path, known = (np.concatenate(part) for part in zip(*parts, strict=True))
    level = np.median(sure[known & (sure > SURE)]) if known.any() else 0
    return replace(
        found,
        object=np.where(known[:, None], path, found.object).astype(np.float32),
        object_sure=np.where(known, np.maximum(sure, level), sure).astype(np.float32),
    )


def _closer(place, sure, shape):
    """The square (left, top, side) in which tip and object are when they are found."""
    h, w = shape
    tip, object_ = (place[:, i][sure[:, i] > SURE] for i in (0, 1))
    if len(object_) < 3:
        return 0, 0, max(h, w)
    low, high = np.percentile(np.concatenate([object_, tip]), (2, 98), axis=0)
    side = round(1.5 * (high - low).max() + 0.3 * max(h, w))
    left, top = np.round((low + high) / 2 - side / 2).astype(int)
    return max(0, min(left, w - side)), max(0, min(top, h - side)), side


def _fitted(frames):
    """Frames (T, 84, 84, 3) that show all of `frames` between black bars, the scale, the corner."""
    h, w = frames.shape[1:3]
    scale = SIZE / max(h, w)
    size = max(1, round(w * scale)), max(1, round(h * scale))
    left, top = (SIZE - size[0]) // 2, (SIZE - size[1]) // 2
    out = np.zeros((len(frames), SIZE, SIZE, 3), np.uint8)
    for small, frame in zip(out, frames, strict=True):
        how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        small[top : top + size[1], left : left + size[0]] = cv2.resize(
            frame, size, interpolation=how
        )
    scales, corner = [size[0] / w, size[1] / h], [left, top]
    return out, np.array(scales, np.float32), np.array(corner, np.float32)


def references(frames: np.ndarray) -> np.ndarray:
    """The clip's median, first and last frame, (3, H, W, 3) uint8, of frames (T, H, W, 3)."""
    some = frames[np.linspace(0, len(frames) - 1, min(len(frames), MOST)).round().astype(int)]
    return np.stack([median_frame(some)[0].astype(np.uint8), frames[0], frames[-1]])


def with_references(frames: np.ndarray, around: np.ndarray) -> np.ndarray:
    """Frames (B, H, W, 3) with the references (3, H, W, 3) behind them: (B, H, W, 12)."""
    return np.concatenate([frames, *(np.broadcast_to(one, frames.shape) for one in around)], axis=3)


class _Drawings(Dataset):
    """Clips and their references: clip i is the same whoever draws it, and whenever."""

    def __init__(self, seed, draw):
        self.seed, self.draw = seed, draw

    def __getitem__(self, i):
        clip = self.draw(np.random.default_rng([self.seed, i]))
        return clip, references(clip.frames)


def _as_drawn(clip):
    return clip  # and not as tensors in shared memory, of which small machines have little


class _Pool:
    """The clips that batches are drawn from. Other processes draw them while a network learns."""

    def __init__(self, seed, steps, workers, draw):
        first, end = NEW * steps.start, NEW * (steps.stop - 1) + POOL
        self.drawn = iter(
            DataLoader(
                _Drawings(seed, draw), batch_size=None, sampler=range(first, end),
                num_workers=workers, prefetch_factor=AHEAD if workers else None,
                collate_fn=_as_drawn,
                # The only way on macOS and Windows, and the only safe one beside CUDA.
                multiprocessing_context="spawn" if workers else None,
                generator=torch.Generator(),  # or a resumed training would draw from torch's own
            )
        )  # fmt: skip
        self.clips = deque((next(self.drawn) for _ in range(POOL - NEW)), maxlen=POOL)

    def batch(self, rng, device):
        """Images (B, 12, 84, 84), places (B, 2, 2) and masks (B, 2, 42, 42) for an iteration."""
        self.clips.extend(next(self.drawn) for _ in range(NEW))
        images, places, masks = [], [], []
        for i in rng.choice(POOL, BATCH, replace=False):
            clip, around = self.clips[i]
            t = rng.integers(len(clip.frames))
            if rng.random() < 0.5:
                around = around[[0, 2, 1]]  # as if the clip ran backwards
            images += [clip.frames[t : t + 1], around]
            places.append(np.stack([clip.tip[t], clip.object[t]]))
            masks.append(clip.masks[t])
        shown = torch.from_numpy(np.stack(masks)).to(device).permute(0, 3, 1, 2).float() / 255
        seen = to_images(np.concatenate(images), device).unflatten(0, (BATCH, 4)).flatten(1, 2)
        return seen, torch.from_numpy(np.stack(places)).to(device), shown


def train(
    *,
    iterations: int,
    seed: int,
    device: str = "cpu",
    workers: int = 0,
    checkpoint: Checkpoint | None = None,
    draw: Callable[[np.random.Generator], Clip] = draw_clip,
) -> tuple[Detector, list[dict]]:
    """Teach a detector with made clips. Returns it and a log: step, and the mean loss up to there.

    workers: processes that draw, whose number changes nothing else; 0 draws in this one. draw: what
    makes a clip; other processes find it by its name.
    """
    checkpoint = checkpoint or Checkpoint(None)
    to, rng = pick_device(device), seed_everything(seed)
    network = Network().to(to).train()
    optimizer = torch.optim.AdamW(network.parameters(), betas=(0.9, 0.99), weight_decay=0.01)
    now, state = checkpoint.resume(
        dict(network=network, optimizer=optimizer, rng=rng), step=0, log=[], sum=0.0
    )
    pool = _Pool(seed, range(now.step, iterations), workers, draw)
    bar = progress(iterations, "eyes", now.step)
    while now.step < iterations:
        # A constant rate soon learns no more: its noise hides what is left to learn.
        left = (1 - now.step / iterations) / SETTLE
        rate = LEARNING_RATE * min(1.0, (now.step + 1) / 100, left)
        optimizer.param_groups[0]["lr"] = rate
        images, places, masks = pool.batch(rng, to)
        # Channels last are a fifth faster on a CPU.
        with bfloat16(to):
            said, drawn = network(images.contiguous(memory_format=torch.channels_last))
        error = loss(said.float(), drawn.float(), places, masks)
        optimizer.zero_grad()
        error.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        now.step += 1
        now.sum += error.item()
        bar.update()
        if now.step % LOG_EVERY == 0:
            now.log.append({"step": now.step, "loss": round(now.sum / LOG_EVERY, 4)})
            now.sum = 0.0
        checkpoint.save(state, force=now.step == iterations)
    bar.close()
    return Detector(network), now.log
