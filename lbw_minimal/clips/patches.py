"""Whether what was found is one thing that looks the same all along, and where else it may be.

Not from the paper. A detector that looks at single frames takes a hand for the object now and then,
or a thing that nobody touches. An object is one patch of the picture: it rests while the hand comes
near, and it goes along with it, or by itself, later on. So patches are cut out where the detector
saw an object, in several frames, and where something stands that is gone in the end, or has come;
each is looked for in all frames; and the path counts on which a patch stays like itself, rests
first, and moves later.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np

from lbw_minimal.clips.detector import SURE, Found
from lbw_minimal.clips.paths import FOUND, extent, median3
from lbw_minimal.clips.pushing import is_hand

SMALL = 160  # pixels, the longer side of the frames in which patches are looked for
LOOK_AT = 48  # frames of a shot that are looked at, spread over it
ANCHORS = 7  # of these, from which patches are cut
# Pixels, half a patch: a large one is told from others better, a small one has less of the hand.
HALVES = 6, 9
CHANGED = 24  # grey levels between the first and the last frame
THING = 5, 32  # pixels: what is smaller is no object, what is larger the arm
LEFT = 4  # things that are looked at because they are gone in the end, or have come
PLAIN = 2  # grey levels, the deviation of a patch in which nothing is seen
PEAKS = 10  # places in a frame where a patch may be
APART = 4  # pixels between these; paths that differ by less go the same way
# Of the frames, in which two patches have to go the same way: in half of them all may rest.
MOST = 0.67
AGREE = 2  # paths: one that goes a way of its own is chance
KEPT = 0.9  # of the frames, in which the detector's path is the patch's: it is known better
LEAP, STRAY = 12.0, 1.5  # pixels from frame to frame, and what they cost, in correlation
ALIKE = 0.6  # a correlation, from which on a patch is the same thing
SEEN = 0.4  # share of the frames in which it has to be
MOVED = 0.06  # of the shorter side: a patch that goes less far stays where it is
BEGUN = 0.1  # of its way: by then it moves
ALONE = 0.15  # of the tip's way that an object waits for at least; a piece of the hand never does
TO_AND_FRO = 3.5  # times the way: what goes so much farther swings, or was taken for another
LEAPS = 0.4  # times the way: what goes farther at once was taken for another
KNOWN = 0.4  # of the frames: if the tip is found in fewer, it is not asked
NEAR = 0.4  # of the shorter side: so near is the hand when the object starts to move


@dataclass(frozen=True)
class Path:
    """A patch's way through the n frames that are looked at."""

    places: np.ndarray  # (n, 2) pixels of the small frames
    alike: np.ndarray  # (n,) correlation with the patch
    tip: np.ndarray | None  # (n, 2) pixels, where the hand is, if that is known
    side: int  # pixels, the shorter side of the small frames

    @property
    def seen(self) -> bool:
        """Whether the patch is there in enough of the frames."""
        return bool((self.alike > ALIKE).mean() >= SEEN)

    @property
    def way(self) -> float:
        """How far it goes, in shorter sides of the frame."""
        return extent(self.places) / self.side

    @property
    def start(self) -> int:
        """The frame by which it has left where it was."""
        gone = np.linalg.norm(median3(self.places) - self.places[0], axis=1)
        return int((gone > BEGUN * self.way * self.side).argmax())

    @property
    def alone(self) -> float:
        """The share of the tip's way that is gone before: an object waits until the hand comes.

        Where the tip is not known, the share of the frames.
        """
        if self.tip is None:
            return self.start / len(self.places)
        steps = np.linalg.norm(np.diff(median3(self.tip), axis=0), axis=1)
        return float(steps[: self.start].sum() / max(steps.sum(), 1e-6))

    @property
    def of_hand(self) -> bool:
        """Whether it is told to be the hand when it is laid into the scene, see `is_hand`."""
        if self.tip is None:
            return False
        far = int(np.linalg.norm(self.places - self.places[0], axis=1).argmax())
        along = self.places[far] - self.places[0]
        return is_hand(median3(self.tip - self.places)[: far + 1], along, self.side)

    @property
    def pushed(self) -> bool:
        """Whether it moves as an object does: not with the hand from the start, not to and fro, not
        in leaps, and by a hand that is near."""
        if self.way < MOVED or self.alone < ALONE:
            return False
        way, t = self.way * self.side, max(0, self.start - 1)
        steps = np.linalg.norm(np.diff(median3(self.places), axis=0), axis=1)
        if self.tip is not None and np.linalg.norm(self.places[t] - self.tip[t]) > NEAR * self.side:
            return False
        return bool(steps.sum() < TO_AND_FRO * way and steps.max() < LEAPS * way)

    def beside(self, other: Path) -> np.ndarray:
        """In which frames (n,) bool another patch is where it is in most of them: beside it."""
        off = self.places - other.places
        return np.abs(off - np.median(off, axis=0)).max(1) < APART

    def agrees(self, other: Path, share: float) -> bool:
        """Whether another patch goes the same way, beside it, in that share of the frames."""
        return bool(self.beside(other).mean() >= share)

    @property
    def worth(self) -> float:
        """How much speaks for its being the object."""
        return float((self.alike > ALIKE).mean() + 0.5 * self.alike.mean() + min(self.alone, 0.3))


def mended(frames: np.ndarray, found: Found) -> tuple[Found, bool]:
    """Found in a shot, with the path of the best patch where the object's does not move as one, and
    whether it moves as one now.

    Where no patch moves as an object does either, the detector is believed, unless most of what it
    saw rests: then nothing moves. Where both go the same way the detector is believed as well, for
    a patch is known to a pixel only; but not in the frames in which it is off that way.
    """
    k, scale = looked_at(frames)
    tip = tip_at(found, k, scale)
    side = round(min(frames.shape[1:3]) * scale)
    own = Path(found.object[k] * scale, found.object_sure[k], tip, side)
    if own.seen and own.pushed:
        return found, True
    small = shrunk(frames[k], scale)
    changed = _changed(small)
    best = chosen(paths(small, _seen(found, k, scale) + [(0, at) for at in changed], tip))
    if best is None:  # a small thing may be hidden where it was, and in sight where it got to
        best = chosen(paths(small, [(len(k) - 1, at) for at in changed], tip))
    if best is None:
        return found, False
    along = np.arange(len(frames))
    if best.agrees(own, KEPT):
        nearest = np.abs(along[:, None] - k).argmin(axis=1)
        sure = np.where(best.beside(own)[nearest], found.object_sure, 0)
        return replace(found, object_sure=sure), best.pushed
    places = [np.interp(along, k, best.places[:, axis] / scale) for axis in (0, 1)]
    # A patch that is just alike is just sure.
    sure = np.interp(along, k, np.clip(1 + (best.alike - 1) / 0.8, 0, 1))
    return replace(found, object=np.stack(places, 1), object_sure=sure), best.pushed


def of_hand(found: Found, side: int) -> bool:
    """Whether the object that was found is a piece of the hand, see `Path.of_hand`. side: the
    frames' shorter one, in pixels."""
    tip = tip_at(found, np.arange(len(found.object)), 1.0)
    return Path(found.object, found.object_sure, tip, side).of_hand


def gone(found: Found) -> float:
    """How far the object goes, in pixels; 0 where it is sure in less than half of the frames."""
    sure = found.object_sure >= SURE
    return extent(found.object[sure]) if sure.mean() >= FOUND else 0.0


def chosen(some: list[Path]) -> Path | None:
    """The path of the object among those of patches; None if none is better than the detector.

    It is the one with which most agree: one that is followed wrongly may be as like its patch.
    """
    seen = [path for path in some if path.seen]
    pushed = [path for path in seen if path.pushed]
    agree = [sum(path.agrees(other, MOST) for other in pushed) for path in pushed]
    if max(agree, default=0) >= AGREE:
        best = [path for path, n in zip(pushed, agree, strict=True) if n == max(agree)]
        return max(best, key=lambda path: path.worth)
    still = [path for path in seen if path.way < MOVED]
    return max(still, key=lambda path: path.worth) if len(still) > len(some) / 2 else None


def looked_at(frames: np.ndarray) -> tuple[np.ndarray, float]:
    """Which (n,) of the frames (T, H, W, 3) are searched for patches, and how much smaller."""
    k = np.unique(np.linspace(0, len(frames) - 1, LOOK_AT).round().astype(int))
    return k, min(1.0, SMALL / max(frames.shape[1:3]))


def shrunk(frames: np.ndarray, scale: float) -> list[np.ndarray]:
    """The frames (n, H, W, 3) uint8, so much smaller, and without their finest noise."""
    size = round(frames.shape[2] * scale), round(frames.shape[1] * scale)
    return [
        cv2.GaussianBlur(cv2.resize(frame, size, interpolation=cv2.INTER_AREA), (3, 3), 0)
        for frame in frames
    ]


def paths(
    small: list[np.ndarray], places: list[tuple[int, np.ndarray]], tip: np.ndarray | None
) -> list[Path]:
    """The paths of patches in frames (h, w, 3) uint8: of those about places, (frame, (2,))."""
    size, out = small[0].shape[1::-1], []
    for i, middle in places:
        for half in HALVES if min(size) > 3 * max(HALVES) else ():
            x, y = np.clip(np.round(middle).astype(int), half, np.array(size) - half - 1)
            patch = small[i][y - half : y + half + 1, x - half : x + half + 1]
            if patch.std() > PLAIN:
                out.append(_path(small, patch, tip))
    return out


def _seen(found, k, scale):
    """Some of the frames k and where the detector surely sees an object in them."""
    sure = np.flatnonzero(found.object_sure[k] > SURE)
    some = np.linspace(0, len(sure) - 1, min(ANCHORS, len(sure))).round().astype(int)
    return [(i, found.object[k[i]] * scale) for i in sure[np.unique(some)]]


def _changed(small):
    """Where the first frame differs from the last, by things of an object's size: (2,) each."""
    few = max(1, len(small) // 16)
    first, last = (np.median(part, axis=0) for part in (small[:few], small[-few:]))
    differs = (np.abs(first - last).max(axis=2) > CHANGED).astype(np.uint8)
    differs = cv2.morphologyEx(differs, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, _, stats, middles = cv2.connectedComponentsWithStats(differs)
    things = [
        (area, middle)
        for (_, _, w, h, area), middle in zip(stats[1:].tolist(), middles[1:], strict=True)
        if area >= THING[0] ** 2 and max(w, h) <= THING[1]
    ]
    things.sort(key=lambda thing: -thing[0])
    return [middle for _, middle in things[:LEFT]]


def tip_at(found: Found, k: np.ndarray, scale: float) -> np.ndarray | None:
    """Where the tip (n, 2) is in frames k, between those in which it is surely seen; None if
    these are few."""
    sure = np.flatnonzero(found.tip_sure > SURE)
    if len(sure) < KNOWN * len(found.tip_sure):
        return None
    return scale * np.stack([np.interp(k, sure, found.tip[sure, axis]) for axis in (0, 1)], 1)


def _path(small, patch, tip):
    peaks = [_peaks(cv2.matchTemplate(one, patch, cv2.TM_CCOEFF_NORMED)) for one in small]
    cost, back = [1 - peaks[0][1]], []
    for (before, _), (here, alike) in pairwise(peaks):
        far = np.linalg.norm(here[:, None] - before[None], axis=2)  # (here, before)
        total = cost[-1][None] + STRAY * (far / LEAP) ** 2
        back.append(total.argmin(1))
        cost.append(total.min(1) + 1 - alike)
    at = [int(cost[-1].argmin())]
    for choice in reversed(back):
        at.append(int(choice[at[-1]]))
    taken = [(places[i], alike[i]) for (places, alike), i in zip(peaks, at[::-1], strict=True)]
    places = np.array([place for place, _ in taken]) + len(patch) / 2
    return Path(places, np.array([alike for _, alike in taken]), tip, min(small[0].shape[:2]))


def _peaks(alike):
    """The highest places (PEAKS, 2) of a map, and their heights."""
    alike, places, heights = alike.copy(), [], []
    for _ in range(PEAKS):
        _, height, _, (x, y) = cv2.minMaxLoc(alike)
        places.append((x, y))
        heights.append(height)
        cv2.rectangle(alike, (x - APART, y - APART), (x + APART, y + APART), -1.0, -1)
    return np.array(places, float), np.array(heights)
