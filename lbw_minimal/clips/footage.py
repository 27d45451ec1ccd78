"""Whether a clip is footage of one arm, and of a camera that stands still or can be made to.

In: frames (T, H, W, 3) uint8 of any size. Nothing is found here, only what spoils a search: a clip
of a few frames, one in which nothing moves, or the camera does, or a second person. What trembles
is steadied. The measures are those of `motion.py` and `camera.py`.
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

# Of the longer side: the way of the picture's corners. Below the first a camera stands, above the
# second near and far things move apart, and no fit undoes it.
TREMBLES, MOVES = 0.005, 0.11
LARGE = 0.015  # of the picture: less that moves is no arm
COVERS = 0.04  # of the picture: a lamp that swings at its edge covers half of that, an arm twice
EDGE = 3  # pixels from the picture's edge, over which an arm comes in
FAINT = 10  # grey levels: at the shoulder an arm moves by little
SPECK = 0.0015  # of the picture, 10 pixels in one piece: noise moves a few, each by itself
SOMETIMES = 2  # frames in which something moves: noise does so in one
APART = 1.0  # of the width, from edge to edge: between them a lamp may hang beside an arm
# Of the width, that lies between two arms beside each other: between an arm and its shadow, its
# body or the drawer that it pushes, films of people have up to 0.2.
BETWEEN = 0.2
OFTEN = 0.05  # of the frames: an arm at its median place is not told from the room
ENDS = 16  # a clip's first and last frames are so many of it


class Footage(NamedTuple):
    """What is known of a clip before anything is searched for in it."""

    frames: np.ndarray  # (T, H, W, 3) uint8, steadied where the camera trembles
    warnings: list[str]
    enters: float  # where the arm comes in, 0 at the picture's left edge, 1 at its right; or nan
    unmoved: bool  # whether the last frames look as the first ones, but for what comes in
    # why it may be no footage of one arm, and what to film otherwise, for `Unusable`; a user who
    # sees one there knows better
    doubt: tuple[str, str] | None = None


def check(frames: np.ndarray, cuts: Sequence[int] = ()) -> Footage:
    """The frames as they can be searched, and what the arm does at the picture's edges.

    cuts: frames with which a new shot begins; the longest one is asked, and all are steadied.
    Raises Unusable if the shot has few frames, if nothing moves in it, or if the camera moves.
    Whether one arm does the moving is doubted only.
    """
    shots = list(pairwise([0, *cuts, len(frames)]))
    first, last = max(shots, key=lambda shot: shot[1] - shot[0])
    if last - first < LEAST_FRAMES:
        raise Unusable(
            f"{last - first} frames in one go are too few, at least {LEAST_FRAMES} are needed",
            "film the whole motion in one go, at 10 frames a second or more",
        )
    still, background, moving = before_background(frames[first:last])
    if not moving:
        if _speck(np.abs(still - background) > MOVED):
            raise Unusable("no arm is seen, only something small moves", SIDE_ON)
        raise Unusable("nothing moves in the clip", "film an arm that does the task")
    frames, warnings = _steadied(frames, shots, shots.index((first, last)))
    if warnings:
        still, background, _ = before_background(frames[first:last])
    off = np.abs(still - background)
    doors = _doors(off > MOVED)
    # At its median place an arm looks like the room.
    enters = float(np.nanmean(doors)) if np.isfinite(doors).any() else np.nan
    doubt = _doubt(_comes_in(off > FAINT), doors, _beside(off > MOVED))
    return Footage(frames, warnings, enters, _unmoved(still), doubt)


def _doubt(comes_in, doors, beside):
    """Why the clip may show no arm, or several people, and the remedy; None if it shows one."""
    if not comes_in:
        return "no arm is seen, nothing large that moves comes in from the edge", SIDE_ON
    if ((np.nan_to_num(np.ptp(doors, axis=1)) >= APART) | beside).mean() >= OFTEN:
        return (
            "arms come in at two places far apart, as of several people, or of one who fills the "
            "picture",
            "film one arm, without the body, and let nothing else move near the edges",
        )
    return None


def _steadied(frames, shots, longest):
    """The frames, steadied if the camera trembles in the longest shot, and a warning then."""
    sways = [camera.sway(frames[first:last]) for first, last in shots]
    way = camera.extent(sways[longest], *frames.shape[1:3])
    if way > MOVES:
        raise Unusable(
            "the camera moves", "put it on a stand or lean it against something, and film again"
        )
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
        area >= MOVED_SHARE * SMALL**2 and not _at_edge(*box) for *box, area in stats.tolist()
    )


def _comes_in(moves):
    """Whether something that moves (T, 84, 84), as large as an arm, reaches over an edge of the
    picture: what an arm moves may be larger, and need not be at the edge."""
    _, stats = things(moves.sum(0) >= SOMETIMES)
    return any(area >= COVERS * SMALL**2 and _at_edge(*box) for *box, area in stats.tolist())


def _at_edge(x, y, width, height):
    return min(x, y) <= EDGE or max(x + width, y + height) >= SMALL - EDGE


def _doors(moves):
    """The outermost places (T, 2) at which large things that move (T, 84, 84) come in over the
    left, right and upper edge, 0 to 1 from left to right; nan where none does."""
    out = np.full((len(moves), 2), np.nan)
    for t, moved in enumerate(moves):
        labels, stats = things(moved)
        large = 1 + np.flatnonzero(stats[:, 4] >= LARGE * SMALL**2)
        inside = np.isin(labels, large)
        x = np.flatnonzero(inside[:EDGE].any(0)).tolist()
        x += [0] * bool(inside[:, :EDGE].any()) + [SMALL - 1] * bool(inside[:, -EDGE:].any())
        if x:
            out[t] = min(x) / (SMALL - 1), max(x) / (SMALL - 1)
    return out


def _speck(moves):
    """Whether a small thing, and not noise, is among what moves (T, 84, 84)."""
    pieces = (cv2.connectedComponentsWithStats(moved.astype(np.uint8))[2] for moved in moves)
    large = [piece[1:, 4].max(initial=0) >= SPECK * SMALL**2 for piece in pieces]
    return sum(large) >= SOMETIMES


def _beside(moves):
    """In which frames (T,) bool of what moves (T, 84, 84) two arms come in beside each other, over
    the left, right or upper edge."""
    out = np.zeros(len(moves), bool)
    for t, moved in enumerate(moves):
        _, stats = things(moved)
        arms = stats[from_outside(stats) & (stats[:, 4] >= LARGE * SMALL**2)]
        spans = sorted((x, x + width) for x, _, width, *_ in arms.tolist())
        out[t] = any(b[0] - a[1] >= BETWEEN * SMALL for a, b in pairwise(spans))
    return out


def from_outside(stats: np.ndarray) -> np.ndarray:
    """Which (n,) bool of `things` reach over the left, the right or the upper edge."""
    x, y, width = stats.T[:3]
    return (np.minimum(x, y) <= EDGE) | (x + width >= SMALL - EDGE)


def things(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Labels (84, 84), from 1 on, of what hangs together in a mask but for gaps of less than 9
    pixels, and its x, y, width, height and area, (n, 5)."""
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(closed)
    return labels, stats[1:]
