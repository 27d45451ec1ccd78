"""From a person's file to pictures, one after the other, as PyAV's FFmpeg decodes them.

In: a file as phones, cameras, browsers and editors write it. Out: frames with their time stamps,
already without interlacing. What cannot be read gets one sentence and a remedy. Nothing here knows
what the pictures show, except that some of them are none: covers, photos, text.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import av.filter

from lbw_minimal.training import InputError

AGAIN = "copy or export it again"
HEAD = 65536  # bytes; no film begins with so many zeros
# What people take for a video, by its first bytes; "." stands for any.
NO_FILM = {
    b"PK\x03\x04": "this is a zip archive; unpack it and give the video inside.",
    b"%PDF": "this is a PDF document; give the video file itself.",
    b"RIFF....WEBPVP8X": "this is a WebP picture; give a video, or export a moving one as mp4.",
    b"....ftyphei": "this is a still picture; give a video in which the arm does the task.",
}
STILL = "this is a still picture; give a video in which the arm does the task."
SOONER = 0, 10  # s before the place that was asked for, at which a file is entered
ROUNDED = 0.01  # an editor that shrinks 16:9 to 1066x600 states pixels 1600:1599
# With more threads a 4K film of 10 bits takes hundreds of megabytes for frames under way.
THREADS = min(4, os.cpu_count() or 1)
# A title may be no UTF-8. PyAV 19, for Python 3.12 and later, takes it as it is; 18 has to be told.
PYAV = int(av.__version__.partition(".")[0])
ODD_TEXT: dict[str, Any] = {} if PYAV >= 19 else {"metadata_errors": "surrogateescape"}


@dataclass(frozen=True)
class Stream:
    """One stream of moving pictures in a file, as the header describes it."""

    index: int  # among all streams of the file
    width: int  # of the stored pictures, in pixels
    height: int
    pixel: float  # width of a pixel over its height
    rate: float  # frames a second, on average
    seconds: float  # 0 if the header does not say


def look(path: Path) -> tuple[list[Stream], dict[str, str]]:
    """The streams of moving pictures in a file, and what the file says about itself.

    Raises InputError, with the reason and a remedy, if there are none.
    """
    _refuse_no_film(path)
    try:
        with open(path, "rb") as file, _open(file) as container:
            if container.format.name in ("image2", "tty") or container.format.name.endswith(
                "_pipe"
            ):
                raise InputError(f"{path}: {STILL}")
            found = list(container.streams.video)
            films = [s for s in found if not s.disposition & av.stream.Disposition.attached_pic]
            if not films:
                raise InputError(f"{path}: {_no_picture(container, bool(found))}")
            known = [s for s in films if s.codec_context is not None]
            if not known:
                raise InputError(
                    f"{path}: its pictures are coded in a way that cannot be decoded here; export "
                    "it as H.264 (mp4)."
                )
            seconds = (container.duration or 0) / av.time_base
            streams = [s for s in (_describe(s, seconds) for s in known) if s.width and s.height]
            if not streams:
                raise InputError(f"{path}: the video is cut short or damaged; {AGAIN}.")
            return streams, dict(container.metadata)
    except av.FFmpegError:
        raise InputError(f"{path}: {_why_closed(path)}") from None
    except OSError as error:
        raise InputError(
            f"{path}: the file cannot be read ({error.strerror}); change its permissions or copy "
            "it."
        ) from None


def _open(file):
    """The container in an open file. A file's name never reaches FFmpeg's protocols and patterns,
    for which a colon and a percent sign have meanings; and no playlist has it open anything else,
    on this machine or another."""
    return av.open(file, buffer_size=1 << 20, options={"protocol_whitelist": "none"}, **ODD_TEXT)


def _describe(stream, seconds):
    shape = stream.sample_aspect_ratio
    pixel = float(shape) if shape else 1.0
    if not 0.2 < pixel < 5 or abs(pixel - 1) < ROUNDED:  # a writer's mistake
        pixel = 1.0
    rate = float(stream.average_rate or stream.guessed_rate or 25)
    if stream.duration:
        seconds = float(stream.duration * stream.time_base)
    return Stream(
        stream.index,
        stream.codec_context.width,
        stream.codec_context.height,
        pixel,
        rate,
        seconds,
    )


class Decoder:
    """Iterates over (time, frame) of a stream: seconds, or None without a time stamp.

    start: seconds from the stream's start; the first frames may be earlier, and without time
    stamps they are those of the stream's start. sparse: only key frames, at least a second apart.
    What could not be decoded is skipped and counted.
    """

    def __init__(self, path: Path, stream: Stream, start: float = 0.0, sparse: bool = False):
        self.path, self.stream, self.start, self.sparse = path, stream, start, sparse
        self.packets = self.bad = 0
        self.promised = self.covered = 0.0  # seconds that the header states, and that came
        self.interlaced = False
        self._filter: tuple | None = None  # deinterlacing, and the shape that it is made for

    def __iter__(self) -> Iterator[tuple[float | None, av.VideoFrame]]:
        """Raises InputError if the file can no longer be opened."""
        if self.start > 0:
            for sooner in SOONER:  # some files are entered behind the place that was asked for
                frames = self._entered(max(0.0, self.start - sooner))
                first = next(frames, None)
                if first and first[0] is not None and first[0] <= self.start:
                    yield first
                    yield from frames
                    return
        yield from self._entered(None)

    def _entered(self, at):
        """All from a second on, or from the start; some of before that, and none if it fails."""
        self.packets = self.bad = 0
        self._filter = None
        with open(self.path, "rb") as file, _open(file) as container:
            stream = container.streams[self.stream.index]
            stream.codec_context.thread_type = "SLICE" if self.sparse else "AUTO"
            stream.codec_context.thread_count = THREADS
            if self.sparse:
                stream.codec_context.skip_frame = "NONKEY"
            origin = (container.start_time or 0) / av.time_base
            if at is not None:
                try:
                    container.seek(int((origin + at) * av.time_base))
                except av.FFmpegError:  # it can only be read from its start
                    return
            self.promised = (container.duration or 0) / av.time_base
            if container.format.name.startswith("matroska"):  # it counts from 0, not from there
                self.promised -= origin
            if container.format.name == "avi":  # there FFmpeg believes the file's size instead
                self.promised = max(self.promised, stream.frames / self.stream.rate)
            first = float((stream.start_time or 0) * stream.time_base)
            for frame in self._whole(self._decoded(container, stream), stream):
                yield None if frame.time is None else frame.time - first, frame

    def _decoded(self, container, stream):
        """The frames of a stream. Packets of the others are only asked how far the file goes."""
        origin, last = (container.start_time or 0) / av.time_base, -1e9
        packets = container.demux()
        while True:
            try:
                packet = next(packets, None)
            except av.FFmpegError:  # the file ends within a packet
                self.bad += 1
                packet = None
            if packet is None:
                break
            if packet.pts is not None:
                now = float(packet.pts * packet.time_base)
                length = float((packet.duration or 0) * packet.time_base)
                self.covered = max(self.covered, now + length - origin)
            if packet.stream.index != stream.index:
                continue
            if self.sparse and packet.size:
                if not packet.is_keyframe or (packet.pts is not None and now < last + 1):
                    continue
                last = now if packet.pts is not None else last
            self.packets += packet.size > 0
            try:
                frames = packet.decode()
            except av.FFmpegError:
                self.bad += 1
                continue
            self.bad += sum(frame.is_corrupt for frame in frames)
            yield from (frame for frame in frames if not frame.is_corrupt)

    def _whole(self, frames, stream):
        """Frames that show one moment each: from the first interlaced one on, bwdif makes them."""
        for frame in frames:
            shape = frame.width, frame.height, frame.format.name
            if self._filter is None and not frame.interlaced_frame:
                yield frame
                continue
            self.interlaced = True
            if self._filter is None or self._filter[1] != shape:
                yield from self._filtered(None)
                self._filter = _deinterlacer(frame, stream), shape
            yield from self._filtered(frame)
        yield from self._filtered(None)

    def _filtered(self, frame):
        """What the filter gives when it takes a frame, or None at the end."""
        if self._filter is None:
            return
        graph, _ = self._filter
        graph.push(frame)
        while True:
            try:
                yield graph.pull()
            except (av.BlockingIOError, av.EOFError):
                return


def _deinterlacer(frame, stream):
    graph = av.filter.Graph()
    source = graph.add_buffer(
        width=frame.width, height=frame.height, format=frame.format, time_base=stream.time_base
    )
    bwdif = graph.add("bwdif", "mode=send_frame:parity=auto:deint=interlaced")
    sink = graph.add("buffersink")
    source.link_to(bwdif)
    bwdif.link_to(sink)
    graph.configure()
    return graph


def check_file(path: Path) -> None:
    """Raises InputError if there is no file of that name, but a folder, a device or nothing."""
    if os.path.isfile(path):  # a name may be too long to ask for, or its folder shut
        return
    if os.path.isdir(path):
        raise InputError(f"{path}: this is a folder; give the video file itself.")
    if os.path.exists(path):
        raise InputError(f"{path}: this is a device, not a file; give the video file itself.")
    raise InputError(f"{path}: there is no such file; check the path.")


def _refuse_no_film(path):
    """What a look at the first bytes can tell, before FFmpeg takes text for a terminal's film."""
    check_file(path)
    try:
        with open(path, "rb") as f:
            head = f.read(HEAD)
    except OSError as error:
        raise InputError(
            f"{path}: the file cannot be read ({error.strerror}); change its permissions or copy "
            "it."
        ) from None
    if not head:
        raise InputError(f"{path}: the file is empty; {AGAIN}.")
    if not any(head):
        raise InputError(
            f"{path}: the file begins with nothing but zeros, as a download that was broken off; "
            f"{AGAIN}."
        )
    for mark, sentence in NO_FILM.items():
        if all(m in (b, ord(".")) for m, b in zip(mark, head, strict=False)):
            raise InputError(f"{path}: {sentence}")
    if _is_text(head):
        raise InputError(f"{path}: this is text, not a video; give an mp4, mov or webm file.")


def _is_text(head):
    text = head.decode("utf-16" if head[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8", "replace")
    odd = sum(c == "\ufffd" or (c < " " and c not in "\t\n\r\f\x1b") for c in text)
    return odd <= 1  # the head may end within a letter


def _no_picture(container, has_cover):
    if has_cover:
        return "this is sound with a cover picture, not a video; give the video itself."
    if container.streams.audio:
        return "it has sound but no picture; give a video, recorded with the camera on."
    return "it has no picture at all; give a video in which the arm does the task."


def _why_closed(path):
    """What is wrong with a file that FFmpeg does not open."""
    boxes = _boxes(path)
    if b"ftyp" in boxes and b"moov" not in boxes:  # an mp4's index, written last
        return f"the video is cut short, its index is missing; {AGAIN}."
    if boxes & {b"ftyp", b"moov"}:
        return f"the video is damaged; {AGAIN}."
    return (
        "this is no video that FFmpeg can read, or it is damaged from the start; give an mp4, mov "
        f"or webm file, or {AGAIN}."
    )


def _boxes(path):
    """The names of an mp4's outermost boxes."""
    names, size = set[bytes](), path.stat().st_size
    with open(path, "rb") as f:
        at = 0
        while at + 8 <= size and len(names) < 64:
            f.seek(at)
            head = f.read(16)
            length = int.from_bytes(head[:4], "big")
            if length == 1:  # the size stands behind the name
                length = int.from_bytes(head[8:16], "big")
            if not head[4:8].isalnum() or length < 8:
                break
            names.add(head[4:8])
            at += length
    return names
