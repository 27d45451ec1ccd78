"""Whether a clip is footage of one arm in front of a camera that stands still.

In: frames (T, H, W, 3) uint8 of any size. Nothing is found here, only what spoils a search: a clip
in which nothing moves, or the camera does, or a second person. The measures are those of
`motion.py` and `video.py`, taken on small pictures.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np

from lbw_minimal.clips.motion import MOVED, SMALL, before_background
from lbw_minimal.clips.paths import Unusable
from lbw_minimal.video import STEADY, steadiness

SHAKEN = 0.80  # steadiness of a drawn room that is panned by 10 of 84 pixels; STEADY is a warning
LARGE = 0.01  # of the picture: less that moves is no arm
EDGE = 3  # pixels from the picture's edge, over which an arm comes in
LAG = 3  # of the frames that are looked at, in which an arm moves by less than its width
APART = 0.15  # of the width: so far apart are the arms of two people
OFTEN = 0.2  # of the frames in which two arms move


def check(frames: np.ndarray, cuts: Sequence[int] = ()) -> list[str]:
    """Warnings about the frames; cuts: frames with which a new shot begins.

    Raises Unusable if nothing moves, if the camera moves, or if two arms do the moving.
    """
    edges = [0, *cuts, len(frames)]
    first, last = max(pairwise(edges), key=lambda shot: shot[1] - shot[0])
    still, background, moving = before_background(frames[first:last])
    if not moving:
        raise Unusable("nothing moves in the clip", "film an arm that does the task")
    steady = steadiness(still, background)
    if steady < SHAKEN:
        raise Unusable(
            "the camera moves", "put it on a stand or lean it against something, and film again"
        )
    steps = np.abs(still[LAG:] - still[:-LAG]) > MOVED  # (T - LAG, 84, 84)
    if len(steps) and np.mean([_two_arms(step) for step in steps]) > OFTEN:
        raise Unusable(
            "two arms come in from the edge of the picture, far apart, as of several people",
            "film one arm, and let nothing else move near the edges",
        )
    if steady < STEADY:
        return ["The camera seems to move a little; a stand would help."]
    return []


def _two_arms(moves):
    """Whether two things that move (84, 84) come in over the edge, one beside the other."""
    closed = cv2.morphologyEx(moves.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8))
    _, _, stats, _ = cv2.connectedComponentsWithStats(closed)
    spans = sorted(
        (x, x + width)
        for x, y, width, height, area in stats[1:].tolist()
        if area >= LARGE * moves.size
        and (min(x, y) <= EDGE or max(x + width, y + height) >= SMALL - EDGE)
    )
    return any(b[0] - a[1] >= APART * SMALL for a, b in pairwise(spans))
