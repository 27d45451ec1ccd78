"""The object's path from its own texture: corners followed by Lucas and Kanade's tracker.

Not from the paper. A detector looks at single frames, so its places jitter; corners are followed to
a fraction of a pixel, but nothing says whose they are. Those that move as the object was found to
move are the object's.
In: frames, and the object's path as it was found. Out: its path as its corners moved.
"""

from __future__ import annotations

import warnings
from itertools import pairwise
from typing import Any

import cv2
import numpy as np

FOLLOWED = 480  # pixels, the longer side of the frames in which corners are followed
WINDOW = (11, 11)  # pixels, what is compared about a corner
BACK = 0.5  # pixels: a corner that comes back further off is lost
# In 84ths of the longer side: how far from the object's middle its corners are, and how much
# unlike its path theirs may be.
NEAR, LIKE = 12.0, 1.5
# A fingertip's corners go with a thing from the touch on, so the median is not enough: in four
# fifths of the frames they may be so much unlike it.
MOSTLY, STRAYS = 0.8, 4.0
FARTHER = 2.0  # times the object's way, while it is found: what goes farther is another's
RESTS = 2.0  # 84ths of the longer side: so near to its first place it has not left it
CORNERS = 3  # fewer give no median


def _found_again(one, two, corners):
    """Where the corners (n, 1, 2), n >= 1, of a grey frame are in another, and which (n,) bool come
    back when they are followed backwards."""
    how: dict[str, Any] = {"nextPts": None, "winSize": WINDOW}
    there, ok, _ = cv2.calcOpticalFlowPyrLK(one, two, corners, **how)
    back, ok_back, _ = cv2.calcOpticalFlowPyrLK(two, one, there, **how)
    kept = (np.hstack([ok, ok_back]) > 0).all(1)
    return there, kept & (np.linalg.norm(back - corners, axis=2)[:, 0] < BACK)


def follow(grey: np.ndarray) -> np.ndarray:
    """Paths (T, n, 2) of the corners in the first of the frames (T, h, w) uint8.

    In pixels from the left and the upper edge; nan from where a corner is lost: it is, if it does
    not come back to where it was when it is followed backwards.
    """
    found = cv2.goodFeaturesToTrack(grey[0], 500, 0.005, 2)
    here = np.zeros((0, 1, 2), np.float32) if found is None else found
    paths, alive = [here[:, 0]], np.arange(len(here))
    for one, two in pairwise(grey):
        path = np.full_like(paths[0], np.nan)
        if len(alive):
            there, kept = _found_again(one, two, here)
            alive, here = alive[kept], there[kept]
            path[alive] = here[:, 0]
        paths.append(path)
    return np.stack(paths) + 0.5  # OpenCV counts from the middle of the first pixel


def objects_own(paths: np.ndarray, path: np.ndarray, unit: float) -> tuple[np.ndarray, np.ndarray]:
    """Which corners (n,) bool are the object's, and where its middle is from each, (n, 2).

    paths (T, n, 2) of corners, path (T, 2) of the object, nan where it was not found; unit: pixels
    in an 84th of the frame's longer side.
    """
    with warnings.catch_warnings():  # a corner that is lost at once has no median
        warnings.simplefilter("ignore", RuntimeWarning)
        offset = path[:, None] - paths  # (T, n, 2)
        middle = np.nanmedian(offset, axis=0)
        off = np.abs(offset - middle).sum(2)  # (T, n)
        unlike, most = np.nanquantile(off, [0.5, MOSTLY], axis=0)
        moved = _extent(paths)
        # The tip of a hand that has come to rest beside a thing is as like it most of the time.
        farther = _extent(paths + 0 * path[:, None]) > FARTHER * (_extent(path) + unit)
        # Nor does a corner of the object move while it rests, as that of a hand that comes does.
        away = np.abs(path - path[np.isfinite(path[:, 0]).argmax()]).max(1, keepdims=True)
        rests = np.where(away < RESTS * unit, path, np.nan)
        farther |= _extent(paths + 0 * rests[:, None]) > FARTHER * (_extent(rests) + unit)
    way = _extent(path)
    seen = np.isfinite(offset[..., 0]).sum(0) >= 3
    near = np.abs(middle).max(1) < NEAR * unit
    # Half of an object's way, and a corner of the background would be as like it.
    moves = moved > max(2 * unit, way / 4)
    alike = (unlike < LIKE * unit) & (most < STRAYS * unit)
    return seen & near & moves & ~farther & alike, middle


def _extent(paths):
    """How far paths (T, ..., 2) go along x or y, (...,); nan does not count."""
    return (np.nanmax(paths, axis=0) - np.nanmin(paths, axis=0)).max(-1)


def followed(frames: np.ndarray, path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The object's path (T, 2) in frames (T, H, W, 3) uint8 as its corners moved, and where (T,)
    that is known.

    path (T, 2): where it was found, in pixels from the left and the upper edge, nan where not. It
    stays as it is where there are no corners. Where all are lost, by a cut or behind a hand, others
    are chosen.
    """
    scale = min(1.0, FOLLOWED / max(frames.shape[1:3]))
    size = round(frames.shape[2] * scale), round(frames.shape[1] * scale)
    small = (cv2.resize(frame, size, interpolation=cv2.INTER_AREA) for frame in frames)
    grey = np.stack([cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY) for frame in small])
    unit, out, known = max(size) / 84, path.copy(), np.zeros(len(path), bool)
    start = 0
    while start < len(grey) - 2:
        paths, end = follow(grey[start:]), start + 1 + len(grey) // 20
        if paths.shape[1] and np.isfinite(path[start:]).any():
            own, middle = objects_own(paths, path[start:] * scale, unit)
            enough = np.isfinite(paths[:, own, 0]).sum(1) >= CORNERS
            if enough[1:].any():  # corners are lost for good, so these are the first ones
                now = slice(start, start + enough.sum())
                out[now] = np.nanmedian(paths[enough][:, own] + middle[own], axis=1) / scale
                known[now], end = True, max(end, now.stop)
        start = end
    return out, known
