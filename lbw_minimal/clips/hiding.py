"""Whether what is pushed in a clip is in sight while it moves. Not from the paper.

A thing looks the same at its first place and on its way. Where the picture of its way shows
something else, an arm or a hand is before it, and what was found there is that.
"""

from __future__ import annotations

import cv2
import numpy as np

from lbw_minimal.clips.patches import SMALL, shrunk
from lbw_minimal.clips.paths import STANDS, SURE, Tracks, low_pass, trusted

HALF = 6  # pixels of the small frames, half a patch: most of a thing, and little of the hand
STRAY = 5  # of the same: so far may the place be off that was found
LOOK_AT = 12  # frames on its way
# Correlation with the first patch, the median on its way. Of hidden things it was 0.28 to 0.50, of
# usable ones mostly more than 0.55, but of two in a hundred as little: so it is worth a warning.
ALIKE = 0.45


def unlike(frames: np.ndarray, tracks: Tracks, touch: float, there: float) -> list[str]:
    """A sentence where the object of frames (T, H, W, 3) uint8 does not look like itself on its
    way, which begins at `touch` and ends at `there` (s)."""
    if alike(frames, tracks, touch, there) >= ALIKE:
        return []
    return ["What is seen on the object's way does not look like it: does the hand hide it?"]


def alike(frames: np.ndarray, tracks: Tracks, touch: float, there: float) -> float:
    """How much the object looks on its way as it did before, as a correlation; 1 if it was not
    surely seen before, or the picture is too narrow for a patch.

    Before, that is where it rests in the shot, in the frame with the hand farthest away.
    """
    t, cuts = tracks.times, [c for c in tracks.cuts if tracks.times[c] <= touch]
    before = (t <= touch) & (np.arange(len(t)) >= max(cuts, default=0))
    before &= tracks.object_sure >= SURE
    place = np.median(tracks.object[before], axis=0) if before.any() else np.zeros(2)
    away = np.linalg.norm(tracks.object - place, axis=1)
    rests = np.flatnonzero(before & (away < STANDS * tracks.side))
    if not len(rests):
        return 1.0
    first = rests[np.linalg.norm(tracks.tip[rests] - place, axis=1).argmax()]
    on_way = np.unique(np.abs(t - np.linspace(touch, there, LOOK_AT)[:, None]).argmin(1))
    places = low_pass(*trusted(tracks, "object"), t[on_way])
    scale = min(1.0, SMALL / max(frames.shape[1:3]))
    small = shrunk(frames[[first, *on_way]], scale)
    if min(small[0].shape[:2]) <= 2 * (HALF + STRAY):
        return 1.0
    patch = _cut(small[0], place * scale, HALF)
    regions = [
        _cut(one, at * scale, HALF + STRAY) for one, at in zip(small[1:], places, strict=True)
    ]
    same = [cv2.matchTemplate(one, patch, cv2.TM_CCOEFF_NORMED).max() for one in regions]
    return float(np.median(same))


def _cut(frame, middle, half):
    """The square (2 half + 1, 2 half + 1, 3) about a place (2,), moved into the frame."""
    x, y = np.clip(np.round(middle).astype(int), half, np.array(frame.shape[1::-1]) - half - 1)
    return frame[y - half : y + half + 1, x - half : x + half + 1]
