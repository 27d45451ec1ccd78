"""Whether a clip is dark, or its arm too like what is behind it, for the arm to be found.

In: frames (T, H, W, 3) uint8. Dark ones are made brighter before anything is searched in them: the
detector was taught by day, and what moves is told by grey levels. No clip is refused for its light:
it says better why one that is refused shows no arm, or why the dots are wrong. An arm is taken to
be what comes in over an edge and is as large as one, if it differs from the room by more than noise
does.
"""

from __future__ import annotations

import cv2
import numpy as np

from lbw_minimal.clips.arms import COVERS
from lbw_minimal.clips.footage import at_edge, things
from lbw_minimal.clips.motion import SMALL, small, some
from lbw_minimal.clips.paths import FOUND, SURE

# Grey levels that one in a hundred of a clip's values has, in one of its colours: below the first a
# clip is dark, and is made so bright that it has the second. With three tenths of their light tips
# in 19 made clips are surely right in 72 % of the frames and surely wrong in 13, so brightened in
# 78 and 7, as with all of it. Clips with 104 to 160 are read no better so.
DIM, BRIGHT = 100, 235
MOST_GAIN = 8.0  # times: noise gets as much brighter
# Grey levels, the median over a clip. In 175 clips, of strangers and an outsider, the kit's and the
# authors', it was 44 or more. With a quarter of the light two had 23, and the thing was lost in
# one; with an eighth, 10, nothing was seen to move in either.
DARK = 32
# Grey levels by which an arm differs. In the same clips it was 40 or more; of two whose arm was
# faded into the room the thing was lost at 22 and at 37, and nothing was seen to move at 11 and 19.
ALIKE = 30
FAINT = 5  # grey levels that coding changes
NOISE = 4.0  # deviations
# Quantile of an arm's pixels, of which others may be its shadow, and of the frames: where an arm
# rests for most of a clip, what flickers in the others is no arm.
MOST = 0.9


def gain(frames: np.ndarray) -> float:
    """How many times brighter frames (T, H, W, 3) uint8 have to be; 1 if they are not dark."""
    bright = float(np.percentile(some(frames), 99))
    return min(MOST_GAIN, BRIGHT / max(1.0, bright)) if bright < DIM else 1.0


def brightened(frames: np.ndarray, times: float) -> np.ndarray:
    """Frames (T, H, W, 3) uint8 so many times as bright, and white where that is too bright."""
    if times == 1:
        return frames
    levels = np.minimum(255, times * np.arange(256)).round().astype(np.uint8)
    flat = frames.reshape(len(frames), -1)  # indices of NumPy's take eight times the memory
    return cv2.LUT(flat, levels).reshape(frames.shape)


def poor(frames: np.ndarray, sure: np.ndarray | None = None, times: float = 1.0) -> str:
    """A sentence on what is poor in the light or the colours of frames (T, H, W, 3) uint8 of a
    camera that stands, and what helps, with a space before it; "" if nothing is.

    sure (T,): how surely the tip was found in them, if it was searched. Where it mostly was found,
    an arm was told from the room. times: how many times brighter they were made.
    """
    bright, differs = measured(frames)
    bright /= times
    if bright < DARK:
        return f" The picture is dark, {bright:.0f} of 255 grey levels: more light would help."
    found = sure is not None and (sure >= SURE).mean() >= FOUND
    if differs < ALIKE and not found:  # nan is not less
        return (
            " Something large comes in over the edge that differs from what is behind it by no "
            f"more than {differs:.0f} of 255 grey levels: a sleeve or a background of another "
            "colour, or more light, would help."
        )
    return ""


def measured(frames: np.ndarray) -> tuple[float, float]:
    """How bright the frames are, and by how much an arm differs from the room, in grey levels of
    the colour that differs most; the latter is nan if nothing as large as an arm comes in."""
    few = np.stack([cv2.GaussianBlur(small(frame), (3, 3), 0) for frame in some(frames)])
    off = few - np.median(few, axis=0)  # (n, 84, 84, 3)
    off -= np.median(off, axis=(1, 2), keepdims=True)  # light and exposure may change
    off = np.abs(off).max(axis=-1)  # (n, 84, 84)
    noise = 1.4826 * np.median(off, axis=(1, 2))
    arms = [_arm(one, max(FAINT, NOISE * n)) for one, n in zip(off, noise, strict=True)]
    differs = [np.quantile(arm, MOST) for arm in arms if len(arm)]
    return float(np.median(few)), float(np.quantile(differs, MOST)) if differs else np.nan


def _arm(off, least):
    """By how much the pixels (n,) of the largest thing that comes in over an edge are off the room,
    off (84, 84); none if that is smaller than an arm."""
    labels, stats = things(off > least)
    area = [area if at_edge(*box) else 0 for *box, area in stats.tolist()]
    if max(area, default=0) < COVERS * SMALL**2:
        return off[:0, 0]
    return off[(labels == 1 + np.argmax(area)) & (off > least)]
