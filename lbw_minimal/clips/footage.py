"""Whether a clip is footage of one arm, and of a camera that stands still or can be made to.

In: frames (T, H, W, 3) uint8 of any size. Nothing is found here, only what spoils a search: a clip
of a few frames, one in which nothing moves, or the camera does, or a second person. What trembles
is steadied. The measures are those of `motion.py` and `camera.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np

from lbw_minimal.clips import camera
from lbw_minimal.clips.motion import MOVED, SMALL, before_background
from lbw_minimal.clips.paths import LEAST_FRAMES, SIDE_ON, Unusable

# Of the longer side: the way of the picture's corners. Below the first a camera stands, above the
# second near and far things move apart, and no fit undoes it.
TREMBLES, MOVES = 0.005, 0.09
LARGE = 0.01  # of the picture: less that moves is no arm
EDGE = 3  # pixels from the picture's edge, over which an arm comes in
FAINT = 10  # grey levels: at the shoulder an arm moves by little
SOMETIMES = 2  # frames in which something moves: noise does so in one
LAG = 3  # of the frames that are looked at, in which an arm moves by less than its width
APART = 0.15  # of the width: so far apart are the arms of two people
OFTEN = 0.2  # of the frames in which two arms move


def check(frames: np.ndarray, cuts: Sequence[int] = ()) -> tuple[np.ndarray, list[str]]:
    """The frames, steadied where the camera trembles, and warnings about them.

    cuts: frames with which a new shot begins; the longest one is asked, and all are steadied.
    Raises Unusable if the shot has few frames, if nothing moves in it, if the camera moves, or if
    two arms do the moving.
    """
    shots = list(pairwise([0, *cuts, len(frames)]))
    first, last = max(shots, key=lambda shot: shot[1] - shot[0])
    if last - first < LEAST_FRAMES:
        raise Unusable(
            f"{last - first} frames in one go are too few, at least {LEAST_FRAMES} are needed",
            "film the whole motion in one go, at 10 frames a second or more",
        )
    if not before_background(frames[first:last])[2]:
        raise Unusable("nothing moves in the clip", "film an arm that does the task")
    sways = [camera.sway(frames[a:b]) for a, b in shots]
    way = camera.extent(sways[shots.index((first, last))], *frames.shape[1:3])
    if way > MOVES:
        raise Unusable(
            "the camera moves", "put it on a stand or lean it against something, and film again"
        )
    warnings = []
    if way > TREMBLES:
        steady = [camera.steadied(frames[a:b], s) for (a, b), s in zip(shots, sways, strict=True)]
        frames = np.concatenate(steady)
        warnings.append("The camera trembles, and the picture was steadied; a stand would help.")
    still, background, _ = before_background(frames[first:last])
    if not _comes_in(np.abs(still - background) > FAINT):
        raise Unusable("no arm is seen, nothing that moves comes in from the edge", SIDE_ON)
    steps = np.abs(still[LAG:] - still[:-LAG]) > MOVED  # (T - LAG, 84, 84)
    if len(steps) and np.mean([_two_arms(step) for step in steps]) > OFTEN:
        raise Unusable(
            "two arms come in from the edge of the picture, far apart, as of several people",
            "film one arm, and let nothing else move near the edges",
        )
    return frames, warnings


def _comes_in(moves):
    """Whether what moves (T, 84, 84) at some time reaches over the picture's edge, as an arm."""
    moved = (moves.sum(0) >= SOMETIMES).astype(np.uint8)
    closed = cv2.morphologyEx(moved, cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8))
    _, _, stats, _ = cv2.connectedComponentsWithStats(closed)
    return any(
        area >= 2 * LARGE * moved.size
        and (min(x, y) <= EDGE or max(x + width, y + height) >= SMALL - EDGE)
        for x, y, width, height, area in stats[1:].tolist()
    )


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
