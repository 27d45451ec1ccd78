"""A person's clip, as it should be looked at: upright, square pixels, ordinary colours, true time.

    file -> stream that moves -> piece that moves -> shrunk frames, time stamps -> cuts

`steady` takes the longest piece between cuts, `resample` plays it at 25 frames a second. The film
is decoded as a stream and shrunk at once, so that ten minutes of 4K fit into memory.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from av.video.reformatter import VideoReformatter

from lbw_minimal.clips import motion
from lbw_minimal.clips.decoding import AGAIN, Decoder, Stream, look
from lbw_minimal.clips.upright import WHOLE, Upright, borders
from lbw_minimal.training import InputError, progress

RATE = 25.0  # frames a second, at which the kit's tasks run
MOST = 200_000_000  # bytes of frames in memory: 46 s of a 16:9 film at RATE
UNKNOWN = 3.0  # seconds in which a whole motion can hide
AROUND = 1.0  # seconds kept before and after a motion
CAPTURED = "com.android.capture.fps"  # how many frames a second the camera took, by Android
FASTEST = 10_000  # of them; more is no camera's
ALMOST = 1e-3  # s: a page rounds the times that it writes


@dataclass(frozen=True)
class Clip:
    """What a clip shows, and what was done to show it."""

    frames: np.ndarray  # (T, H, W, 3) uint8 RGB, T >= 2, the longer side at most SIDE
    times: np.ndarray  # (T,) float64 seconds, strictly rising from 0
    cuts: list[int]  # indices of the frames that do not continue the one before
    notes: list[str]  # what was done, a sentence each
    losses: list[str] = field(default_factory=list)  # what was left out or guessed, likewise
    start: float = 0.0  # s of the file, at true speed, at which the piece that was read begins


def read_clip(
    path: Path | str,
    *,
    start: float | None = None,
    end: float | None = None,
    stream: int | None = None,
    turn: int | None = None,
    crop: bool = True,
    cuts: bool = True,
) -> Clip:
    """The clip in a file. What the arguments leave open is found out.

    start, end: the piece to read, in seconds; of slow motion at true speed, as the clip's times.
    stream: 1 for the file's first stream of pictures. turn: degrees clockwise, 0, 90, 180 or 270.
    crop: whether black borders are cut off. cuts: whether cuts are looked for, which takes most of
    the time. Raises InputError, a sentence with a remedy, if there is no film in the file or it is
    cut short.
    """
    path = Path(path)
    streams, said = look(path)
    if stream is not None and not 1 <= stream <= len(streams):
        raise InputError(f"{path}: stream {stream} is not among its {len(streams)} of pictures.")
    best, rank, failed = None, (False, 0), list[InputError]()
    for number in range(1, len(streams) + 1) if stream is None else [stream]:
        its = streams[number - 1]
        slow = _slow(its, said)
        first, last = (None if s is None else s * slow for s in (start, end))
        film = _Film(path, its, first, last, turn, crop)
        film.slow = slow
        try:
            film.read()
        except InputError as error:
            failed.append(error)
            continue
        # Another stream may be a title, a preview, a map of depths: motion first, then size.
        here = len(streams) == 1 or motion.moves(film.frames), film.stream.width
        if best is None or here > rank:
            best, rank = film, here
            where = number
    if best is None:
        raise failed[0]
    if len(streams) > 1:
        best.notes.append(
            f"Of the file's {len(streams)} streams of pictures, number {where} was taken."
        )
    times = _rising(best)
    keep = np.diff(times, prepend=times[0] - 1) > 0
    slow, stamped = best.slow, bool(best.start) and None not in best.stamps
    begins = float(times[0]) if stamped else best.start
    frames, times = best.frames[keep], (times[keep] - times[0]) / slow
    if slow > 1:
        captured = float(said[CAPTURED])
        best.notes.append(f"Slow motion of {captured:g} frames a second was played at true speed.")
    if len(frames) < 2:
        still = "the video has a single frame, a still picture; give one in which the arm does the"
        piece = "this piece of it has a single frame; give a longer one, in which the arm does the"
        raise InputError(f"{path}: {piece if best.asked else still} task.")
    jumps = motion.jumps(frames, times) if cuts else []
    return Clip(frames, times, jumps, best.notes, best.losses, begins / slow)


def _slow(stream: Stream, said: dict[str, str]) -> float:
    """How many times as long the film takes as what it shows: 1 if it is no slow motion."""
    try:
        captured = float(said.get(CAPTURED, 0))
    except ValueError:
        return 1.0
    slow = 100 <= captured <= FASTEST and captured > 2 * stream.rate
    return captured / stream.rate if slow else 1.0


def steady(clip: Clip) -> Clip:
    """The longest piece between cuts, its times from 0."""
    edges = [0, *clip.cuts, len(clip.frames)]
    pieces = [slice(*pair) for pair in pairwise(edges)]
    longest = max(pieces, key=lambda p: clip.times[p][-1] - clip.times[p][0])
    times = clip.times[longest]
    return dataclasses.replace(clip, frames=clip.frames[longest], times=times - times[0], cuts=[])


def resample(times: np.ndarray, rate: float = RATE) -> np.ndarray:
    """Indices (N,) of the frames that a screen shows at 0, 1 / rate, 2 / rate, ... seconds.

    times: (T,) seconds, rising from 0. Each moment takes the frame nearest in time, at most half a
    step early or late. Frames are not blended: two half-transparent hands would be two hands to a
    detector. What was found in the frames can be interpolated, by `numpy.interp`.
    """
    moments = np.arange(int(times[-1] * rate + 1e-3) + 1) / rate
    return np.searchsorted((times[1:] + times[:-1]) / 2, moments - 1e-6)


class _Film:
    """One stream of a file on its way into memory."""

    def __init__(self, path, stream: Stream, start, end, turn, crop):
        self.path, self.stream, self.turn, self.crop = path, stream, turn, crop
        self.slow = 1.0  # see `_slow`
        self.asked = start is not None or end is not None
        self.start, self.end = start or 0.0, end
        self.notes, self.losses = list[str](), list[str]()
        self.frames, self.stamps = np.empty((0, 0, 0, 3), np.uint8), list[float | None]()
        self.every = 1  # which frames are kept

    def read(self):
        """Fills frames (T, H, W, 3) uint8, stamps, notes and losses."""
        piece = "" if self.asked else self._by_key_frames()
        self._decode(WHOLE)
        if (
            not self.asked
            and not piece
            and self.stream.rate / self.every < min(RATE, self.stream.rate)
        ):
            # Key frames told nothing. These frames are far apart, yet they show where it moves.
            piece = self._choose(self.stamps, np.stack([motion.small(f) for f in self.frames]))
            if piece:
                self._decode(WHOLE)
        inside = borders(self.frames) if self.crop else None
        if inside:
            self._decode(inside)
            self.notes.append("Black borders were cut off.")
        if piece:
            self.losses.append(piece)

    def _by_key_frames(self):
        """Looks for the motion in a film too long for memory. The sentence of `_choose`, or ""."""
        if self.stream.seconds * RATE * Upright(self.stream).bytes <= MOST:
            return ""
        scaler = VideoReformatter()
        stamps, frames, last = [], [], 0.0
        with self._bar("look through") as bar:
            for time, frame in Decoder(self.path, self.stream, sparse=True):
                stamps.append(time)
                size = motion.SMALL, motion.SMALL
                # One scaler for all: a frame that makes its own keeps its tables of 2 MB.
                tiny = scaler.reformat(frame, *size, "rgb24", interpolation="AREA", threads=1)
                frames.append(tiny.to_ndarray())
                if time is not None:
                    bar.update(round((time - last) * self.stream.rate))
                    last = time
        if None in stamps or np.diff([*stamps, self.stream.seconds], prepend=0).max() > UNKNOWN:
            return ""
        return self._choose(stamps, np.stack(frames))

    def _choose(self, stamps, frames):
        """Sets start and end to the longest stretch that moves; says so, or "" if it cannot.

        frames: (T, 84, 84, 3) uint8 at the times `stamps`.
        """
        if None in stamps or len(stamps) < 3:
            return ""
        times = np.array(stamps)
        still = (motion.high_pass(frame[None])[0] for frame in frames)  # two in memory at a time
        moving = np.flatnonzero([motion.differs(*pair) for pair in pairwise(still)])
        if not len(moving):
            return ""
        apart = np.flatnonzero(times[moving[1:]] - times[moving[:-1] + 1] > UNKNOWN)
        first = times[moving[np.r_[0, apart + 1]]]
        last = times[moving[np.r_[apart, len(moving) - 1]] + 1]
        longest = int(np.argmax(last - first))
        length = MOST / (RATE * Upright(self.stream).bytes)
        self.start = max(0.0, first[longest] - AROUND)
        self.end = min(last[longest] + AROUND, self.start + length)
        return (
            f"Of {times[-1]:.0f} seconds, {self.start:.1f} to {self.end:.1f} were taken, from the "
            "longest stretch in which something moves."
        )

    def _bar(self, verb):
        seconds = (self.end or self.stream.seconds) - self.start
        name = f"{verb} {self.path.name}"
        return progress(max(1, round(seconds * self.stream.rate)), name, delay=3)

    def _decode(self, window):
        """All frames from start to end, evenly thinned if memory would not hold them."""
        self.frames = self.frames[:0]  # free what an earlier call has left
        decoder = Decoder(self.path, self.stream, self.start)
        upright = Upright(self.stream, self.turn, window)
        kept, stamps, every, count, passed, whole = [], [], 1, 0, 0, True
        with self._bar("read") as bar:
            for time, frame in decoder:
                now = passed / self.stream.rate if time is None else time
                passed += 1
                if now < self.start - ALMOST:
                    continue
                if self.end is not None and now > self.end + ALMOST:
                    whole = False
                    break
                bar.update()
                # Only what is kept is converted: the colours of a phone's HDR take their time.
                if count % every == 0:
                    kept.append(upright(frame))
                    stamps.append(time)
                    if len(kept) * kept[0].nbytes > MOST:
                        kept, stamps, every = kept[::2], stamps[::2], 2 * every
                count += 1
        self._check(decoder, count, whole)
        self.frames, self.stamps, self.every = np.stack(kept), stamps, every
        self.notes, self.losses = upright.notes, []
        if decoder.interlaced:
            self.notes.append("Interlaced frames were made whole.")
        if decoder.bad:
            self.losses.append("Damaged places were left out.")
        if every > 1:
            many = f"{count} frames are many; one in {every} is used, {len(kept)} in all."
            self.losses.append(many)

    def _check(self, decoder, count, whole):
        """Raises InputError if nothing came, or less than the file's header promises."""
        if count == 0 and self.asked:
            long = self.stream.seconds / self.slow
            said = f"; it is {long:.1f} s long" * (long > 0)
            raise InputError(f"{self.path}: the video has no frames in this piece{said}.")
        slack = max(0.05 * decoder.promised, 0.1 + 1 / self.stream.rate)
        if whole and decoder.covered < decoder.promised - slack:
            said = f"its header promises {decoder.promised:.1f} s and {decoder.covered:.1f} s can"
            raise InputError(f"{self.path}: the video is cut short, {said} be read; {AGAIN}.")
        if count == 0 and decoder.packets:
            raise InputError(
                f"{self.path}: none of its pictures can be decoded, it is damaged or protected "
                f"against copying; {AGAIN}, as H.264 (mp4)."
            )
        if count == 0:
            raise InputError(f"{self.path}: the video has no frames; record or export it again.")


def _rising(film):
    """Times (T,) of a film's frames. Where they do not rise, frames are to be left out."""
    step = film.every / film.stream.rate
    if None not in film.stamps:
        times = np.array(film.stamps, np.float64)
        for i in np.flatnonzero(np.diff(times) < -UNKNOWN):  # recordings put one after another
            times[i + 1 :] += times[i] + step - times[i + 1]
        least = 0.4 if (np.diff(times) >= 0).all() else 0.5  # some writers state each time twice
        times = np.sort(times)  # frames come in the order in which they are shown
        if len(times) < 3 or (np.diff(times) > 0).mean() > least:
            return times
    film.losses.append(
        f"Its frames have no time stamps; {film.stream.rate:.3g} a second were assumed."
    )
    return step * np.arange(len(film.frames))
