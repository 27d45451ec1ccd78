"""A shot's frames, and what is seen in them without a clip's other findings. Not from the paper.

Several rules ask the same of a shot. It is worked out when the first of them asks, and once.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np

from lbw_minimal.clips import arms
from lbw_minimal.clips.detector import Detector, Look
from lbw_minimal.clips.footage import Footage
from lbw_minimal.clips.motion import some, told
from lbw_minimal.clips.vanished import Vanished, vanished


def shots(model: Detector, frames: np.ndarray, cuts: Sequence[int]) -> list[Sight]:
    """A clip's shots, of which a new one begins with each frame of `cuts`: each is seen by itself,
    as another shot is another camera's."""
    return [Sight(model, frames[a:b]) for a, b in pairwise([0, *cuts, len(frames)])]


class Sight:
    """The frames (T, H, W, 3) uint8 of one shot, as a detector sees them."""

    def __init__(self, model: Detector, frames: np.ndarray):
        self.model, self.frames = model, frames

    @cached_property
    def told(self) -> np.ndarray:
        """Indices (n,) of the frames in which something has moved since the last of them."""
        return told(self.frames)

    @cached_property
    def whole(self) -> Look:
        """The model's look at all frames."""
        return self.model.look(self.frames)

    @cached_property
    def moving(self) -> Look:
        """The model's look at the n frames of `told`."""
        return self.model.look(self.frames[self.told])

    @cached_property
    def vanished(self) -> Vanished | None:
        """What has left its place by the end."""
        return vanished(self.frames)

    def unmoved(self, seen: Footage) -> bool:
        """Whether nothing has left its place by the end, as far as is seen: the last frames look as
        the first ones, but for what comes in, or nothing that stood is gone."""
        return seen.unmoved or self.vanished is None

    def room(self, seen: Footage) -> float:
        """By how much the room moves though it was steadied, see `arms.room`; 0 if it was not."""
        return arms.room(some(self.whole.arms), seen.off) if seen.warnings else 0.0

    def beside(self, off: np.ndarray, tip: np.ndarray, sure: np.ndarray) -> float:
        """The share of the frames in which an arm moves beside another, see `arms.beside`.

        off: as in `Footage`; tip (T, 2) pixels, sure (T,).
        """
        tip = tip / self.frames.shape[2:0:-1]
        return arms.beside(some(self.whole.arms), off, some(tip), some(sure))
