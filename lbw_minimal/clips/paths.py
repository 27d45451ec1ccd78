"""The paths of tip and object that were found in a clip, cleaned: the best shot, without noise.

In: pixels with time stamps, as they were found, at any frame rate. Out: paths in the best shot of
the clip, at any times one asks for. Nothing of this is in the paper.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from lbw_minimal.training import InputError, quantity

SMOOTH = 0.05  # s, sigma of the low-pass; a webcam's frames are 0.1 s apart, a phone's 0.03
REST = 0.3  # s that are kept of a rest before the hand starts and after the object has arrived
SURE = 0.5  # a point found with less is as good as not found
FOUND = 0.5  # share of the frames in which the object has to be found
TIP_FOUND = 0.3  # the same of the tip where nothing is touched: all the motion is its own
FADE = 0.5  # s, for which a correction of what was surely found lasts beyond it
UNSURE = 0.5  # s, longer than a glitch of the detector
# s before the touch, until which a hand that is not found may not have come yet. Of 19 usable films
# of an outsider 14 would warn of their beginnings, in ten of which it had not, and so one does.
COMING = 0.3
ELSEWHERE = 0.05  # of the frames: in more of them a thing at rest is not surely seen elsewhere
LEAST_FRAMES = 8  # of a piece: 0.3 s of a phone's, 0.8 s of a slow webcam's
# Of the picture's shorter side: where a detector is unsure, it errs by less than the first. A hand
# that comes to rest over a thing makes it seem to go 0.05.
STANDS, LEAST_WAY = 0.04, 0.06
JUMP = 0.04  # of the same, from one frame to the next, where the picture changes at once as well
SIDE_ON = "film from the side, one arm that comes in from the left or right edge, uncovered"
NEARER = "film the task being done, so near that it goes across a quarter of the picture"
RESTS = 0.05  # of the fastest speed; what is slower rests


class Unusable(InputError):
    """A clip that cannot be laid into the scene: why, and what to film otherwise."""

    def __init__(self, reason: str, remedy: str):
        super().__init__(f"{reason}; {remedy}.")


@dataclass(frozen=True)
class Tracks:
    """What was found in a clip of T frames: pixels (x right, y down), and how sure (0 to 1)."""

    times: np.ndarray  # (T,) s
    tip: np.ndarray  # (T, 2)
    object: np.ndarray  # (T, 2)
    tip_sure: np.ndarray  # (T,)
    object_sure: np.ndarray  # (T,)
    side: int  # pixels, the shorter side of the frames
    cuts: tuple[int, ...] = ()  # frames at which the picture changes all at once
    enters: float = np.nan  # where the arm comes in, 0 at the left edge, 1 at the right
    unmoved: bool = False  # whether nothing has left its place by the end, as far as is seen
    # what the user placed: "tip" or "object", and from when to when, in s
    yours: tuple[tuple[str, float, float], ...] = ()
    width: int = 0  # pixels, of the frames; 0 if unknown

    def part(self, first: int, last: int) -> Tracks:
        """Frames `first` to `last` - 1."""
        names = ("times", "tip", "object", "tip_sure", "object_sure")
        inside = tuple(c - first for c in self.cuts if first < c < last)
        return replace(self, cuts=inside, **{n: getattr(self, n)[first:last] for n in names})

    def is_yours(self, name: str, i: int) -> bool:
        """Whether the user's marks say where the tip or the object, `name`, is in frame i."""
        t = self.times[i]
        return any(name == what and first <= t <= last for what, first, last in self.yours)

    def marked(self, name: str, marks: list[tuple[float, float, float]]) -> Tracks:
        """The path `name`, "tip" or "object", moved so that it passes through marks (x, y, s).

        Between the first and the last mark the correction is interpolated, and what is there counts
        as sure. Beyond them it fades out, and frames that it does not move stay as they were found,
        with their own sureness. It does not go beyond a cut. Where nothing is sure, or something
        else was found, the marks alone make the path. Of two marks at one time the later in the
        list counts.
        """
        if not marks:
            return self
        path, sure = getattr(self, name).copy(), getattr(self, f"{name}_sure").copy()
        latest = {s: (x, y, s) for x, y, s in marks}
        frame = {s: int(np.abs(self.times - s).argmin()) for s in latest}
        yours = list(self.yours)
        for first, last in pairwise([0, *_cuts(self), len(path)]):
            part = slice(first, last)
            inside = np.array([latest[s] for s in sorted(latest) if first <= frame[s] < last])
            if len(inside):
                path[part], sure[part] = _corrected(
                    self.times[part], path[part], sure[part], inside, STANDS * self.side
                )
                start, end = (float(self.times[frame[s]]) for s in inside[[0, -1], 2])
                yours.append((name, start, end))
        return replace(self, yours=tuple(yours), **{name: path, f"{name}_sure": sure})


def _corrected(t, found, own, marks, least):
    """A path found (T, 2) and its sureness (T,), as `Tracks.marked` corrects them in one piece.

    least: pixels. Where two marks in turn are off by more than that from each other, the path found
    between them is not that of one thing, and so its shape says nothing.
    """
    s, sure = marks[:, 2], own >= SURE
    path = interpolate(t[sure], found[sure], t) if sure.any() else np.zeros_like(found)
    off = marks[:, :2] - interpolate(t, path, s)
    before, after = _fades_out(t, sure, s[0], -1), _fades_out(t, sure, s[-1], 1)
    within = np.isfinite([before, *s, after])
    at = np.array([before, *s, after])[within]
    moved = (t > before) & (t < after)
    path = path + interpolate(at, np.pad(off, ((1, 1), (0, 0)))[within], t)
    for i in np.flatnonzero(np.linalg.norm(np.diff(off, axis=0), axis=1) > least):
        between = (t >= s[i]) & (t <= s[i + 1])
        path[between] = interpolate(s[i : i + 2], marks[i : i + 2, :2], t[between])
    away = np.maximum(0, np.maximum(s[0] - t, t - s[-1]))  # (T,) s
    near = np.maximum(own, 1 - away / FADE)
    return np.where(moved[:, None], path, found), np.where(moved, near, own)


def _fades_out(t, sure, mark, way):
    """The time (s) by which a mark's correction has faded out, before it (way -1) or after it (1).

    A mark where nothing was surely found fills a gap, which ends at the next sure frame; infinity
    if there is none. One where something was surely found, and wrong, speaks for `FADE` seconds.
    """
    if sure[np.abs(t - mark).argmin()]:
        return mark + way * FADE
    ahead = way * (t[sure] - mark)
    return mark + way * ahead[ahead > 0].min(initial=np.inf)


def of_a_hand(tracks: Tracks, notes: list[str]) -> Tracks:
    """The tracks of a clip in which nothing is touched: what moves there is the hand.

    So what was taken for an object stands in for a tip that was not found, or hardly moves. It does
    not if it rests itself: a thing that lies at the mark is no hand.
    """
    tip, thing = ((sure >= SURE).mean() for sure in (tracks.tip_sure, tracks.object_sure))
    gone = _extent(tracks, "object")
    moves = gone > 2 * _extent(tracks, "tip")
    if thing < FOUND or gone < STANDS * tracks.side or (tip >= TIP_FOUND and not moves):
        return tracks
    notes.append("The tip was not found; what moves instead was taken for the hand.")
    return replace(tracks, tip=tracks.object, tip_sure=tracks.object_sure)


def busiest_piece(tracks: Tracks, touched: bool, warnings: list[str]) -> Tracks:
    """The piece between cuts in which most happens, from where hand or object is first seen to
    where one of them is last seen. Where nothing is touched, the hand alone counts.

    A cut is a frame at which the picture changes all at once, and tip or object jump. Most happens
    where the object goes farthest, or the tip where nothing is touched.
    """
    cuts, spans = _cuts(tracks), [0]
    pieces = []
    for first, last in zip([0, *cuts], [*cuts, len(tracks.times)], strict=True):
        sure = tracks.tip_sure[first:last] >= SURE
        if touched:  # a hit thing goes on without the hand
            sure |= tracks.object_sure[first:last] >= SURE
        seen = first + np.flatnonzero(sure)
        spans.append(int(np.ptp(seen)) + 1 if len(seen) else 0)
        if spans[-1] >= LEAST_FRAMES:
            pieces.append(tracks.part(seen[0], seen[-1] + 1))
    if not pieces:
        check_tip(tracks)
        said, hand = f"{len(tracks.times)} frames are", "hand or object" if touched else "the hand"
        if len(tracks.times) >= LEAST_FRAMES:
            said = f"{hand} is in sight for {quantity(max(spans), 'frame')} in one go,"
        raise Unusable(
            f"{said} too few: {LEAST_FRAMES} are needed",
            "film the whole motion in one go, at 10 frames a second or more",
        )
    best = max(pieces, key=lambda piece: _extent(piece, "object" if touched else "tip"))
    if cuts:
        span = f"{best.times[0]:.1f} to {best.times[-1]:.1f} s"
        warnings.append(f"{jumps(tracks)}: {span} is used; --from and --to choose another piece.")
    return best


def jumps(tracks: Tracks) -> str:
    """How often a clip jumps and when, without a full stop; "" if it does not."""
    if not (cuts := _cuts(tracks)):
        return ""
    *most, last = (f"{tracks.times[c]:.1f}" for c in cuts)
    at = f"{', '.join(most)} and {last}" if most else last
    often = {1: "once", 2: "twice"}.get(len(cuts), f"{len(cuts)} times")
    return f"The clip jumps {often}, at {at} s"


def unsure(tracks: Tracks, name: str, first: float, touch: float, last: float) -> list[str]:
    """A sentence for each stretch longer than `UNSURE` seconds in which the tip or the object,
    `name`, was not surely found, in the piece that is seen at `first` and goes on to `last` (s).

    touch: when the object is touched (s). A tip that is found from well before that on may not have
    been in the picture before.
    """
    t, sure = tracks.times, getattr(tracks, f"{name}_sure") >= SURE
    start = max([0, *(c for c in _cuts(tracks) if t[c] <= first)])
    stop = int(np.searchsorted(t, last))  # its frame, or the first one after it
    edges = np.flatnonzero(np.diff(sure[start:stop], prepend=True, append=True)) + start
    said = []
    for a, b in zip(edges[::2], np.minimum(edges[1::2], len(t) - 1), strict=True):
        coming = name == "tip" and a == start and t[b] <= touch - COMING
        if t[b] - t[a] > UNSURE and not coming:
            said.append(
                f"The {name} was not surely found from {t[a]:.1f} to {t[b]:.1f} s: look at these "
                "pictures."
            )
    return said


def _cuts(tracks):
    return [c for c in tracks.cuts if _jumps(tracks, c)]


def _jumps(tracks, c):
    """Whether tip or object jump at frame c, farther than they move just before and after."""
    for name in ("tip", "object"):
        path, sure = getattr(tracks, name), getattr(tracks, f"{name}_sure")
        around = path[max(0, c - 2) : c + 2]
        steps = np.linalg.norm(np.diff(around, axis=0), axis=1)
        if name == "tip" and (sure[c - 1 : c + 1] < SURE).any():
            return True
        here = np.linalg.norm(path[c] - path[c - 1])
        if here > JUMP * tracks.side and here > 2 * np.median(steps):
            return True
    return False


def _extent(tracks, name):
    return extent(getattr(tracks, name)[getattr(tracks, f"{name}_sure") >= SURE])


def check_tip(tracks: Tracks, least: float = TIP_FOUND) -> None:
    """Raise Unusable for a tip that is surely found in less than that share of the frames."""
    share = (tracks.tip_sure >= SURE).mean()
    if share < least:
        raise Unusable(
            f"the tip of the hand is seen in {share:.0%} of the clip, and hidden or out of it else",
            SIDE_ON,
        )


def trusted(tracks: Tracks, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Times and points (n, 2) of the frames in which the tip or the object is surely found."""
    sure = getattr(tracks, f"{name}_sure") >= SURE
    if name == "tip":
        check_tip(tracks, least=1 / len(sure))  # one frame
    if name == "object" and sure.mean() < FOUND:
        check_tip(tracks)  # what hides the one hides the other
        away = np.linalg.norm(tracks.object - np.median(tracks.object, axis=0), axis=1)
        rests = away < STANDS * tracks.side  # (N,) unsure, and still the same place
        if rests.mean() > FOUND and (sure & ~rests).mean() < ELSEWHERE:
            raise Unusable("the object never moves, what may be it stands at one place", NEARER)
        if tracks.unmoved:
            raise Unusable(
                "the object never moves, as far as is seen: nothing has left its place", NEARER
            )
        raise Unusable(
            f"the object is seen in {sure.mean():.0%} of the frames, and hidden or too small else",
            "push it from behind, with the hand between it and the edge of the picture, and film "
            "an object as large as a fist",
        )
    return tracks.times[sure], median3(getattr(tracks, name)[sure])


def median3(points: np.ndarray) -> np.ndarray:
    """Points (n, 2) without single glitches: each the median of itself and its neighbours."""
    if len(points) < 3:
        return points
    middle = np.median([points[:-2], points[1:-1], points[2:]], axis=0)
    return np.concatenate([points[:1], middle, points[-1:]])


def extent(points: np.ndarray) -> float:
    """The diagonal, in pixels, of what points (n, 2) cover without single glitches; 0 for none."""
    return float(np.linalg.norm(np.ptp(median3(points), axis=0))) if len(points) else 0.0


def interpolate(s: np.ndarray, points: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Points (n, 2) at the times s, taken at the times t; before and after they stay."""
    return np.stack([np.interp(t, s, points[:, axis]) for axis in (0, 1)], axis=1)


def low_pass(s: np.ndarray, points: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Points (n, 2) at any times s, smoothed and taken at the times t: (len(t), 2).

    Around each t a straight line is fitted, weighted by a Gaussian of `SMOOTH` seconds. Unlike a
    mean it does not shorten the ends of a path. What lies between two frames is interpolated first,
    so a frame counts for as long as it is shown.
    """
    fine = float(min(0.2 * SMOOTH, np.median(np.diff(s))))  # s
    k = np.arange(-round(3 * SMOOTH / fine), round(3 * SMOOTH / fine) + 1)
    at = t[:, None] + fine * k  # (N, k) s
    inside = (at >= s[0]) & (at <= s[-1])
    inside |= ~inside.any(1, keepdims=True)  # t itself is outside: the end stays
    w, d = inside * np.exp(-0.5 * (fine * k / SMOOTH) ** 2), fine * k
    w /= w.sum(1, keepdims=True)
    mean = (w * d).sum(1, keepdims=True)
    spread = (w * (d - mean) ** 2).sum(1, keepdims=True)
    w *= 1 - (d - mean) * mean / np.maximum(spread, 1e-12)  # the line's value at d = 0
    there = interpolate(s, points, at.reshape(-1)).reshape(*at.shape, 2)
    return (w[..., None] * there).sum(1)


def ends(path: np.ndarray, least: float, what: str) -> tuple[np.ndarray, np.ndarray]:
    """Where a path (N, 2) of pixels begins, and the point of it that is farthest from there.

    Raises Unusable if that is less than `least` pixels away.
    """
    away = np.linalg.norm(path - path[0], axis=1)
    far = int(np.argmax(away))
    if away[far] < least:
        raise never_moves(what, away[far])
    moving = int(np.argmax(away > 2 * RESTS * away[far]))
    there = np.linalg.norm(path - path[far], axis=1) < RESTS * away[far]
    return np.median(path[:moving], axis=0), np.median(path[there], axis=0)


def never_moves(what: str, gone: float) -> Unusable:
    """The error for what was found as the hand or object, `what`, and has gone too few pixels."""
    said = f"what was taken for the {what} never moves, or by {quantity(round(gone), 'pixel')} only"
    return Unusable(said, NEARER)


def progress(path: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """How much of its way from start to end a path (N, 2) has gone, 0 to 1, and never back."""
    way = end - start
    return np.maximum.accumulate(np.clip((path - start) @ way / (way @ way), 0, 1))
