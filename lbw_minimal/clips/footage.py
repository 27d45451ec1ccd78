"""Whether a clip is footage in which something moves, before a camera that stands still or can be
made to.

In: frames (T, H, W, 3) uint8 of any size. Nothing is found here, only what spoils a search: a clip
of a few frames, or one in which the camera moves. What trembles is steadied. The measures are those
of `motion.py` and `camera.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np

from lbw_minimal.clips import camera
from lbw_minimal.clips.motion import MOVED, MOVED_SHARE, SMALL, before_background
from lbw_minimal.clips.paths import LEAST_FRAMES, SIDE_ON, Unusable
from lbw_minimal.training import quantity

# Of the width, across which a task goes: the way of the picture's corners. Below the first a camera
# stands, above the second near and far things move apart, and no fit undoes it.
TREMBLES, MOVES = 0.005, 0.11
LARGE = 0.015  # of the picture: less that moves is no arm
EDGE = 3  # pixels from the picture's edge, over which an arm comes in
SPECK = 0.0015  # of the picture, 10 pixels in one piece: noise moves a few, each by itself
SOMETIMES = 2  # frames in which something moves: noise does so in one
ENDS = 16  # a clip's first and last frames are so many of it
CAMERA = "the camera moves", "put it on a stand or lean it against something, and film again"
ONLY_SMALL = "no arm is seen, only something small moves", SIDE_ON


class Footage(NamedTuple):
    """What is known of a clip before anything is searched for in it."""

    frames: np.ndarray  # (T, H, W, 3) uint8, steadied where the camera trembles
    warnings: list[str]
    shot: slice  # of the frames: the longest shot
    off: np.ndarray  # (n, 84, 84) grey levels by which some of that shot's frames are off the room
    unmoved: bool  # whether the last frames look as the first ones, but for what comes in
    # why nothing seems to move in the shot, and what to film otherwise, for `Unusable`; an arm that
    # is seen there does move
    still: tuple[str, str] | None = None


def check(frames: np.ndarray, cuts: Sequence[int] = ()) -> Footage:
    """The frames as they can be searched.

    cuts: frames with which a new shot begins; the longest one is asked, and all are steadied.
    Raises Unusable if the shot has few frames, or if the camera moves.
    """
    shots = list(pairwise([0, *cuts, len(frames)]))
    first, last = max(shots, key=lambda shot: shot[1] - shot[0])
    if last - first < LEAST_FRAMES:
        raise Unusable(
            f"{quantity(last - first, 'frame')} in one go {'is' if last - first == 1 else 'are'} "
            f"too few, at least {LEAST_FRAMES} are needed",
            "film the whole motion in one go, at 10 frames a second or more",
        )
    shot = slice(first, last)
    still, background, moving = before_background(frames[shot])
    off = np.abs(still - background)
    if not moving:
        return Footage(frames, [], shot, off, _unmoved(still), _still(off > MOVED))
    frames, warnings = _steadied(frames, shots, shots.index((first, last)))
    if warnings:
        still, background, _ = before_background(frames[shot])
        off = np.abs(still - background)
    return Footage(frames, warnings, shot, off, _unmoved(still))


def _still(moves):
    """Why nothing large is among what moves (T, 84, 84), and the remedy."""
    if _speck(moves):
        return ONLY_SMALL
    said = "nothing moves in the clip, as far as is seen"
    return said, "record from before the hand comes in until all is done"


def _steadied(frames, shots, longest):
    """The frames, steadied if the camera trembles in the longest shot, and a warning then."""
    sways, (height, width) = [camera.sway(frames[a:b]) for a, b in shots], frames.shape[1:3]
    way = camera.extent(sways[longest], height, width) * max(height, width) / width
    if way > MOVES:
        raise Unusable(*CAMERA)
    if way <= TREMBLES:
        return frames, []
    steady = [camera.steadied(frames[a:b], s) for (a, b), s in zip(shots, sways, strict=True)]
    warning = "The camera trembles, and the picture was steadied; a stand would help."
    return np.concatenate(steady), [warning]


def _unmoved(still):
    """Whether nothing but what comes in over an edge differs between the first and the last of the
    frames (T, 84, 84)."""
    few = max(1, len(still) // ENDS)
    first, last = np.median(still[:few], axis=0), np.median(still[-few:], axis=0)
    _, stats = things(np.abs(first - last) > MOVED)
    return not any(
        area >= MOVED_SHARE * SMALL**2 and not at_edge(*box) for *box, area in stats.tolist()
    )


def at_edge(x: int, y: int, width: int, height: int) -> bool:
    """Whether one of `things` reaches over an edge of the picture."""
    return min(x, y) <= EDGE or max(x + width, y + height) >= SMALL - EDGE


def _speck(moves):
    """Whether a small thing, and not noise, is among what moves (T, 84, 84)."""
    pieces = (cv2.connectedComponentsWithStats(moved.astype(np.uint8))[2] for moved in moves)
    large = [piece[1:, 4].max(initial=0) >= SPECK * SMALL**2 for piece in pieces]
    return sum(large) >= SOMETIMES


def things(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Labels (84, 84), from 1 on, of what hangs together in a mask but for gaps of less than 9
    pixels, and its x, y, width, height and area, (n, 5)."""
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(closed)
    return labels, stats[1:]
