"""One decoded frame as it should be looked at: upright, square pixels, ordinary colours, small."""

from __future__ import annotations

import math
from typing import Any

import av
import numpy as np
from av.video.reformatter import VideoReformatter

from lbw_minimal.clips import hdr
from lbw_minimal.clips.decoding import Stream
from lbw_minimal.clips.motion import some

SIDE = 320  # pixels, the longer side of a frame: four times what the kit's networks see
HD = 720  # rows from which a film that names no colour matrix has BT.709's, as players assume
BLACK = 24  # grey levels: a black border is no brighter, even after lossy coding
UNNAMED = 2  # the colour matrix of a file that does not say, by ITU-T H.273
WHOLE = (0.0, 1.0, 0.0, 1.0)


class Upright:
    """Turns frames of a stream into pictures (H, W, 3) uint8 RGB, the longer side at most SIDE.

    turn: degrees clockwise, 0, 90, 180 or 270; None does what the file asks for. window: top,
    bottom, left and right of what is kept, as shares of the upright picture. `notes` says what was
    done.
    """

    def __init__(self, stream: Stream, turn: int | None = None, window: tuple = WHOLE):
        self.stream, self.turn, self.window = stream, turn, window
        self.notes = list[str]()
        self._scaler = VideoReformatter()  # keeps its tables from frame to frame
        self._matrix: tuple | None = None  # how the stream's pictures are turned
        self._white: float | None = None  # of HDR, the same for all frames

    @property
    def bytes(self) -> int:
        """How many a picture takes."""
        w, h = self._size(lies=False)
        return 3 * w * h

    def __call__(self, frame: av.VideoFrame) -> np.ndarray:
        # Once: a frame that was asked for its side data stays in memory, by a cycle.
        self._matrix = a, b, c, d = self._matrix or self._turning(frame)
        lies = abs(b) > abs(a)
        size = self._size(lies)
        how: dict[str, Any] = dict(threads=1)  # more cost time to start for so small a picture
        if size != (frame.width, frame.height):
            smaller = size[0] <= frame.width and size[1] <= frame.height
            how |= dict(width=size[0], height=size[1])
            how |= dict(interpolation="AREA" if smaller else "BICUBIC")
        if frame.colorspace == UNNAMED and frame.height >= HD:
            how |= dict(src_colorspace="ITU709")
        if frame.color_trc in (hdr.HLG, hdr.PQ):
            rgb = self._tone_mapped(frame, how)
        else:
            rgb = self._scaler.reformat(frame, format="rgb24", **how).to_ndarray()
        # The file's matrix takes a stored point (x, y) to (a x + c y, b x + d y), y down.
        if lies:
            rgb, a, d = rgb.transpose(1, 0, 2), c, b
        rgb = rgb[:: -1 if d < 0 else 1, :: -1 if a < 0 else 1]
        return self._inside(rgb).copy()

    def _tone_mapped(self, frame, how):
        signal = self._scaler.reformat(frame, format="rgb48le", **how).to_ndarray()
        light = hdr.screen_light(signal, frame.color_trc)
        white = self._white or hdr.white_of(light)
        if light.max() > 0.1:  # a film may fade in from black
            self._white = white
        name = "HLG" if frame.color_trc == hdr.HLG else "PQ"
        self._note(f"HDR ({name}) was tone-mapped to the colours of an ordinary screen.")
        return hdr.tone_map(light, white)

    def _turning(self, frame):
        """The four numbers that turn and mirror a stored picture into an upright one."""
        if self.turn is not None:
            angle = math.radians(self.turn)
            a, b = math.cos(angle), math.sin(angle)
            c, d = -b, a
        elif data := _matrix(frame):
            a, b, c, d = np.frombuffer(data, np.int32)[[0, 1, 3, 4]].tolist()
        else:
            a, b, c, d = 1, 0, 0, 1
        why = "as the file asks" if self.turn is None else "as was asked"
        # A mirrored picture is mirrored first, left and right.
        mirrored = a * d < b * c
        angle = math.atan2(-b, -a) if mirrored else math.atan2(b, a)
        quarters = round(angle / (math.pi / 2)) % 4
        if mirrored:
            self._note(f"It was mirrored, {why}.")
        if quarters:
            self._note(f"It was turned by {90 * quarters} degrees clockwise, {why}.")
        return a, b, c, d

    def _size(self, lies):
        """Width and height to which a stored picture is shrunk."""
        w = self.stream.width * max(self.stream.pixel, 1)
        h = self.stream.height / min(self.stream.pixel, 1)
        if self.stream.pixel != 1:
            self._note(f"Its pixels, {self.stream.pixel:.3g} times as wide as high, were squared.")
        top, bottom, left, right = self.window
        inside = max((h if lies else w) * (right - left), (w if lies else h) * (bottom - top))
        scale = min(1, SIDE / inside)
        return max(1, round(w * scale)), max(1, round(h * scale))

    def _inside(self, rgb):
        h, w = rgb.shape[:2]
        top, bottom, left, right = self.window
        rows = slice(math.ceil(top * h - 1e-6), max(1, math.floor(bottom * h + 1e-6)))
        return rgb[rows, math.ceil(left * w - 1e-6) : max(1, math.floor(right * w + 1e-6))]

    def _note(self, sentence):
        if sentence not in self.notes:
            self.notes.append(sentence)


def _matrix(frame):
    try:
        return frame.side_data.get("DISPLAYMATRIX")
    except ValueError:  # side data that PyAV has no name for, such as a camera's Exif
        return None


def borders(frames: np.ndarray) -> tuple[float, float, float, float] | None:
    """Top, bottom, left and right of what is inside black borders, as shares, or None without any.

    frames: (T, H, W, 3) uint8. A border stays black throughout and ends in a straight edge, along
    which at least half of the picture is brighter, mostly: a dark room has no such edge.
    """
    bright = some(frames).max(axis=3) > BLACK  # (T, H, W)
    rows = _inner(bright.mean(axis=2))
    columns = _inner(bright[:, slice(*rows)].mean(axis=1))
    h, w = bright.shape[1:]
    if rows == (0, h) and columns == (0, w):
        return None
    return rows[0] / h, rows[1] / h, columns[0] / w, columns[1] / w


def _inner(share):
    """First line inside the borders, and the one after the last.

    share: (T, n) bright part of each line.
    """
    n, inner = share.shape[1], []
    ever, mostly = share.max(axis=0), np.median(share, axis=0)
    for step in (1, -1):
        black = int(np.argmax(ever[::step] > 0.02))  # a stray bright pixel is noise
        bright = mostly[::step][black : black + 4] > 0.5  # coding softens the edge
        is_border = 2 <= black < n * 0.45 and bright.any()
        inner.append(black + int(np.argmax(bright)) if is_border else 0)
    return inner[0], n - inner[1]
