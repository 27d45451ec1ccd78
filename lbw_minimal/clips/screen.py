"""Whether a clip that shows no arm at work is a recording of a screen.

In: frames (T, H, W, 3) uint8. A page, an editor and a desktop have one colour in most of the
picture; before a camera light and noise give a wall many. A drawing may have one, too, so nobody's
clip is refused for that: it only says better why a clip that is refused shows no arm.
"""

from __future__ import annotations

import numpy as np

from lbw_minimal.clips.motion import some
from lbw_minimal.clips.paths import Unusable

# Of the picture. In 28 usable films of people one colour filled up to 0.41, in the kit's own films
# 0.37, in recordings of pages and editors 0.54 to 0.71.
FILLS = 0.5
NEAR = 1  # grey levels by which coding changes a colour
BLACK = 16  # of 255: a dark room is as black before a camera


def recorded(frames: np.ndarray) -> Unusable | None:
    """Why the clip is no film of a camera, and the remedy; None if it may be one."""
    share = float(np.median([_commonest(frame) for frame in some(frames)]))
    if share < FILLS:
        return None
    return Unusable(
        f"it looks like a recording of a screen, since one colour fills {share:.0%} of the picture",
        "film an arm with a camera",
    )


def _commonest(frame):
    """The share of a frame (H, W, 3) that its commonest colour fills; 0 if that is black."""
    numbers = frame @ np.array([1 << 16, 1 << 8, 1])  # (H, W), one for each colour
    _, where, counts = np.unique(numbers, return_index=True, return_counts=True)
    colour = frame.reshape(-1, 3)[where[counts.argmax()]].astype(int)
    if colour.max() < BLACK:
        return 0.0
    return (np.abs(frame - colour).max(axis=-1) <= NEAR).mean()
