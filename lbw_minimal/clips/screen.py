"""Whether a clip that shows no arm at work is a recording of a screen.

In: frames (T, H, W, 3) uint8. A page, an editor and a desktop have one colour in most of the
picture, and a window or an icon that is dragged in much of what moves; before a camera light and
noise give a wall and a sleeve many. A drawing may have one, too, so nobody's clip is refused for
that: it only says better why a clip that is refused shows no arm.
"""

from __future__ import annotations

import numpy as np

from lbw_minimal.clips.motion import MOVED, MOVED_SHARE, SMALL, some
from lbw_minimal.clips.paths import Unusable

# Of the picture. In 28 usable films of people one colour filled up to 0.41, in the kit's own films
# 0.37, in recordings of pages and editors 0.54 to 0.71.
FILLS = 0.5
# Of what moves. In 46 films of a camera, an outsider's, the kit's strangers' and people's, it was
# 0.14 at most, in the kit's own 0.31, and of a made cube that moves alone 0.36. Of windows with
# text and an icon, dragged over a wallpaper, it was 0.38 to 0.61, and of a window that shows a
# photograph 0.1, so that is not told.
MOVES = 0.37
NEAR = 1  # grey levels by which coding changes a colour
BLACK = 16  # of 255: a dark room is as black before a camera


def recorded(frames: np.ndarray) -> Unusable | None:
    """Why the clip is no film of a camera, and the remedy; None if it may be one."""
    if min(frames.shape[1:3]) < SMALL:
        return None  # that alone is wrong with it
    few = some(frames)[:, ::2, ::2]  # for speed; shrinking would mix colours
    share, what = float(np.median([_commonest(frame.reshape(-1, 3)) for frame in few])), ""
    if share < FILLS:
        share, what = _of_what_moves(few), "what moves in "
        if share < MOVES:
            return None
    return Unusable(
        f"it looks like a recording of a screen, since one colour fills {share:.0%} of {what}the "
        "picture",
        "film an arm with a camera",
    )


def _of_what_moves(few):
    """The share of what moves in frames (n, H, W, 3) that its commonest colour fills; 0 if little
    moves."""
    background = np.median(few, axis=0)
    moves = (np.abs(few - background) > MOVED).any(-1)  # (n, H, W)
    large = moves.mean((1, 2)) >= MOVED_SHARE
    shares = [_commonest(f[m]) for f, m in zip(few[large], moves[large], strict=True)]
    return float(np.median(shares)) if shares else 0.0


def _commonest(pixels):
    """The share of pixels (n, 3) that their commonest colour fills; 0 if that is black."""
    numbers = pixels @ np.array([1 << 16, 1 << 8, 1])  # (n,), one for each colour
    _, where, counts = np.unique(numbers, return_index=True, return_counts=True)
    colour = pixels[where[counts.argmax()]].astype(int)
    if colour.max() < BLACK:
        return 0.0
    return (np.abs(pixels - colour).max(axis=-1) <= NEAR).mean()
