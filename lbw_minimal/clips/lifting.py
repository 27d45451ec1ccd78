"""Whether a hand lifts what was not seen to move. Not from the paper.

A thing that is carried hangs at the hand, and the detector may take its lower end for the tip, and
something that rests for the object. But a hand that pushes, or stops short of a thing, stays as low
as it came, and goes back as it came. One that goes up by another way carries what it took.
"""

from __future__ import annotations

import numpy as np

from lbw_minimal.clips.paths import FOUND, LEAST_WAY, SURE, Tracks, Unusable, median3

# Of the picture's shorter side. Where the object was not seen to move, the hands of 20 made clips
# went up by 0.05 at most, those of real ones that lift nothing by 0.14, and those of four that lift
# by 0.20 to 0.53.
UP = 0.17
LEAP = 0.15  # of the same, between two frames: a dot went so far from one thing to another at once


def check_lifted(tracks: Tracks) -> None:
    """Raise Unusable where the object is not seen to move, and the hand goes up by another way
    than it came. A hand that is surely seen in less than half of the frames says nothing."""
    sure, seen = tracks.object_sure >= SURE, tracks.tip_sure >= SURE
    thing = median3(tracks.object[sure])
    away = np.linalg.norm(thing - thing[:1], axis=1).max(initial=0)
    moves = away >= LEAST_WAY * tracks.side and sure.mean() >= FOUND
    if moves or seen.mean() < FOUND:
        return
    up = gone_up(without_leaps(median3(tracks.tip[seen]), LEAP * tracks.side)) / tracks.side
    if up >= UP:
        raise Unusable(
            f"the hand goes up by {up:.0%} of the picture, as one that lifts, and what was taken "
            "for the object is not seen to move",
            "lift nothing, and push the object in a straight line along the table",
        )


def without_leaps(path: np.ndarray, most: float) -> np.ndarray:
    """A path (N, 2) from its first point on, with no step where it has one of more than `most`
    pixels."""
    steps = np.diff(path, axis=0)
    steps[np.linalg.norm(steps, axis=1) > most] = 0
    return path[0] + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def gone_up(path: np.ndarray) -> float:
    """How far, in pixels, a path (N, 2) leads up from where it was lowest before; or how far from
    the way by which it came there, if that is less."""
    height = np.maximum.accumulate(path[:, 1]) - path[:, 1]
    high = int(height.argmax())
    low = int(path[: high + 1, 1].argmax())
    off = np.linalg.norm(path[: low + 1] - path[high], axis=1).min()
    return float(min(height[high], off))
