"""What has left its place by the end of a shot, and where it is seen from then on.

Not from the paper. A thing that is pushed is gone from where it stood. Its picture in the first
frames is looked for in the later ones, and only where these differ from the first: a tile or a knob
that was there before is another thing. So the thing's way is known without the detector; and if it
is seen nowhere, something is before it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from lbw_minimal.clips.detector import Found
from lbw_minimal.clips.patches import ALIKE, ALONE, CHANGED, Path, looked_at, shrunk, tip_at
from lbw_minimal.clips.paths import LEAST_WAY, SURE, Unusable, extent

ENDS = 16  # a shot's first and last frames are so many of it
THING = 25, 40  # pixels of the small frames: least area, and most width or height
STOOD = 1.5  # times: what stood has sharper edges than the ground that it leaves behind
COVERED = 0.5  # of the thing's pixels that have changed: then it has left
MOVED = 0.4  # of the pixels where it is looked for that have changed
# How unlike the most alike half of a thing is, times how unlike that is the ground it left, in a
# quarter of the frames: of 24 usable things it was 0.34 at most, of 16 hidden ones in ten it was
# 0.40 or more. A hand that pushes covers a half.
UNLIKE, OFTEN = 0.37, 0.25
FOLLOWED = 0.8  # correlation, in half of the frames: then its way is known
PASSES = 6  # frames in which an arm is at its place: of hidden things it was there in 11 or more
BESIDE = 16  # pixels of the small frames, a tenth of the picture: what is nearer may be the hand
AGREES = 4.0, 0.8  # pixels of the small frames, share of them: the detector is believed


class Vanished(NamedTuple):
    """A thing that is gone in the end, in n frames of a shot."""

    frames: np.ndarray  # (n,) which frames
    places: np.ndarray  # (n, 2) pixels of the small frames
    alike: np.ndarray  # (n,) correlation with the thing as it stood; 1 while it stands
    left: int  # the first of the n in which it has left
    covered: int  # in how many of the n something else is at its place: an arm that comes and goes
    before: int  # in how many of these before what looks most like the thing goes from there
    scale: float  # pixels of the small frames in a pixel
    unlike: Callable[[], np.ndarray]  # how unlike it its most alike half is after that, (n - left,)


def vanished(frames: np.ndarray) -> Vanished | None:
    """The largest thing that has left its place in the frames (T, H, W, 3) uint8 of one shot, or
    None."""
    k, scale = looked_at(frames)
    small = np.stack(shrunk(frames[k], scale))
    few = max(1, len(small) // ENDS)
    first, last = (np.median(part, axis=0) for part in (small[:few], small[-few:]))
    thing = _largest(first, last)
    if thing is None:
        return None
    changed = np.abs(small - first).max(axis=3) > CHANGED  # (n, h, w)
    other = np.abs(small - last).max(axis=3)[:, thing] > CHANGED  # (n, pixels) than the ground
    off = changed[:, thing].mean(axis=1)  # (n,)
    stands, covered = np.flatnonzero(off < COVERED), np.minimum(off, other.mean(axis=1)) >= COVERED
    left = int(stands[-1]) + 1 if len(stands) else 0
    if left == len(k):  # a loop, which ends as it begins
        return None
    y, x = np.nonzero(thing)
    box = slice(max(0, y.min() - 1), y.max() + 2), slice(max(0, x.min() - 1), x.max() + 2)
    patch, mask = first[box].astype(np.uint8), thing[box].astype(np.uint8)
    half = np.array(patch.shape[1::-1]) / 2
    places, alike = np.tile(half + (box[1].start, box[0].start), (len(k), 1)), np.ones(len(k))
    for t in range(left, len(k)):
        match = cv2.matchTemplate(small[t], patch, cv2.TM_CCOEFF_NORMED)
        _, alike[t], _, at = cv2.minMaxLoc(_among(changed[t], match, patch, -1))
        places[t] = half + at
    ground = np.sqrt(((first - last)[thing] ** 2).mean())
    goes = left + int(np.argmax(np.linalg.norm((places - places[0])[left:], axis=1) >= AGREES[0]))

    def unlike():
        halves = [_unlike(small[left:], changed[left:], *half) for half in _halves(patch, mask)]
        return np.min(halves, axis=0) / ground

    hides = int(covered.sum()), int(covered[left:goes].sum())
    return Vanished(k, places, alike, left, *hides, scale, unlike)


def _largest(first, last):
    """The mask (h, w) of the largest thing in the first picture that is not in the last, or None:
    nothing that reaches over an edge."""
    differs = (np.abs(first - last).max(axis=2) > CHANGED).astype(np.uint8)
    differs = cv2.morphologyEx(differs, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(differs)
    before, after = _edges(first), _edges(last)
    best, most = None, THING[0] - 1
    for i, (x, y, w, h, area) in enumerate(stats[1:].tolist(), 1):
        inside = min(x, y) > 1 and x + w < differs.shape[1] - 1
        if area <= most or max(w, h) > THING[1] or not inside:
            continue
        piece = (labels == i).astype(np.uint8)
        rim = cv2.dilate(piece, np.ones((3, 3))) > cv2.erode(piece, np.ones((3, 3)))
        if before[rim].mean() > STOOD * after[rim].mean():
            best, most = piece > 0, area
    return best


def _edges(picture):
    """How steep a picture (h, w, 3) is at each pixel, (h, w)."""
    slopes = (cv2.Sobel(picture.astype(np.float32), cv2.CV_32F, *to) for to in ((1, 0), (0, 1)))
    return np.hypot(*slopes).max(axis=2)


def _halves(*pictures):
    """The left, right, upper and lower halves of pictures (h, w, ...), with the line between."""
    h, w = pictures[0].shape[:2]
    parts = np.s_[:, : (w + 1) // 2], np.s_[:, w // 2 :], np.s_[: (h + 1) // 2], np.s_[h // 2 :]
    return [[np.ascontiguousarray(one[part]) for one in pictures] for part in parts]


def _unlike(small, changed, patch, mask):
    """How far frames (n, h, w, 3) are off a patch where they are most like it, among what changed,
    (n,) grey levels."""
    n, shown = 3 * max(1, mask.sum()), np.repeat(mask[..., None], 3, axis=2)
    off = (cv2.matchTemplate(frame, patch, cv2.TM_SQDIFF, mask=shown) / n for frame in small)
    least = [_among(c, one, patch, 255**2).min() for c, one in zip(changed, off, strict=True)]
    return np.sqrt(np.maximum(0, least))


def _among(changed, match, patch, other):
    """A match (h, w) of a patch where enough of what it covers has changed, `other` elsewhere."""
    h, w = match.shape
    share = cv2.blur(changed.astype(np.float32), patch.shape[1::-1], anchor=(0, 0))[:h, :w]
    return np.where(share >= MOVED, match, np.float32(other))


def check_seen(thing: Vanished | None, tip: np.ndarray, sure: np.ndarray) -> None:
    """Raise Unusable where the thing that has left its place in the T frames of one shot is seen
    nowhere from then on, or is covered for a while before it goes. It is not the hand as it was
    first, nor what an arm covers in the end: an arm came to its place, and left the ground.

    tip (T, 2) pixels, sure (T,): the hand; where it is never sure nothing is asked.
    """
    hand = tip[sure >= SURE]
    if thing is None or not len(hand):
        return
    apart = np.linalg.norm(hand[0] * thing.scale - thing.places[0])
    if apart < BESIDE or thing.covered < PASSES:
        return
    remedy = "push it from behind, with the hand between it and the edge of the picture"
    if (thing.unlike() <= UNLIKE).mean() < OFTEN:
        raise Unusable(
            "the arm hides the object, which is gone from its place and seen nowhere else", remedy
        )
    if thing.before >= PASSES:
        raise Unusable("the arm hides most of the object before that goes", remedy)


def followed(thing: Vanished | None, frames: np.ndarray, found: Found) -> Found:
    """Found in the frames (T, H, W, 3) uint8 of one shot, with the way of the thing that has left
    its place as the object's where that is another one, and that of a thing that is pushed; or
    where the object stays there: then it was seen as it stood, and not as it left; or where the
    object stays elsewhere, and the hand was at the thing as it left: who takes one thing moves no
    other. A piece of the hand is no thing."""
    alike = np.median(thing.alike[thing.left :]) if thing else 0
    if thing is None or alike < ALIKE:
        return found
    k, scale, n = thing.frames, thing.scale, len(frames)
    side = round(min(frames.shape[1:3]) * scale)
    path = Path(thing.places, thing.alike, tip_at(found, k, scale), side)
    sure = found.object_sure[k] >= SURE
    near = np.linalg.norm(found.object[k] * scale - thing.places, axis=1) < AGREES[0]
    goes = alike >= FOLLOWED and path.pushed and (near & sure).mean() < AGREES[1]
    taken = path.alone >= ALONE and _at(path.tip, thing)  # a piece of the hand does not wait
    still = extent(found.object[k][sure]) < LEAST_WAY * min(frames.shape[1:3])
    stays = still and (near[0] or taken)
    if path.of_hand or not (goes or stays):
        return found
    along = np.arange(n)
    places = [np.interp(along, k, thing.places[:, axis] / scale) for axis in (0, 1)]
    return replace(
        found,
        object=np.stack(places, 1),
        object_sure=np.interp(along, k, np.clip(1 + (thing.alike - 1) / 0.8, 0, 1)),
    )


def _at(tip, thing):
    """Whether the tip (n, 2) is known, and is at a thing in the last frame in which that stands."""
    if tip is None:
        return False
    return np.linalg.norm(tip[max(0, thing.left - 1)] - thing.places[0]) < BESIDE
