"""Little files as phones, cameras and editors write them, made with PyAV's encoders."""

from fractions import Fraction

import av
import numpy as np

H, W = 96, 160


def room(height=H, width=W, seed=0):
    """A still picture (height, width, 3) with edges in all directions."""
    picture = np.full((height, width, 3), 120, np.uint8)
    rng = np.random.default_rng(seed)
    for _ in range(25):
        y, x = rng.integers(0, (height, width))
        h, w = rng.integers((height // 10, width // 10), (height // 4, width // 4))
        picture[y : y + h, x : x + w] = rng.integers(40, 200, 3)
    return picture


def arm(shares, picture=None):
    """A room into which an arm reaches from the left, by a share of its width in each frame."""
    picture = room() if picture is None else picture
    h, w = picture.shape[:2]
    frames = np.repeat(picture[None], len(shares), axis=0)
    for frame, share in zip(frames, shares, strict=True):
        frame[h // 2 : 2 * h // 3, : round(w * share)] = (220, 170, 140)
    return frames


def reach(n=30):
    return arm(np.linspace(0.1, 0.6, n))


def encode(
    path, frames, codec="libx264", rate=25, *, times=None, fmt=None, options=None, container=None,
    metadata=None, prepare=lambda stream: None, mark=lambda frame: None,
):  # fmt: skip
    """Writes frames (T, H, W, 3) uint8 RGB, or uint16 with `fmt` of 10 bits. times: seconds of
    each. prepare, mark: change the stream, each frame, before they are coded."""
    with av.open(str(path), "w", options=container or {}) as out:
        out.metadata.update(metadata or {})
        out.mux(add(out, frames, codec, rate, times, fmt, options, prepare, mark))
    return path


def add(out, frames, codec, rate=25, times=None, fmt=None, options=None, prepare=None, mark=None):
    """A new stream of frames in an open container; its packets, which are to be written."""
    stream = out.add_stream(codec, rate=rate, options=options or {})
    stream.height, stream.width = frames[0].shape[:2]
    stream.pix_fmt = fmt or "yuv420p"
    if prepare:
        prepare(stream)
    if times is not None:
        stream.codec_context.time_base = Fraction(1, 1000)
    packets = []
    for i, array in enumerate(frames):
        name = "rgb24" if array.dtype == np.uint8 else "rgb48le"
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(array), format=name)
        frame = frame.reformat(format=stream.pix_fmt, dst_colorspace=_matrix(stream))
        frame.pts = i if times is None else round(1000 * times[i])
        frame.time_base = Fraction(1, rate) if times is None else Fraction(1, 1000)
        if mark:
            mark(frame)
        packets += stream.encode(frame)
    return packets + stream.encode()


def _matrix(stream):
    return "BT2020" if stream.codec_context.colorspace == 9 else None


def add_sound(out, seconds=1.0):
    """The same of a tone."""
    stream, packets = out.add_stream("aac", rate=44100), []
    for i in range(int(seconds * 44100 / 1024)):
        wave = np.sin(np.arange(i * 1024, (i + 1) * 1024) * 0.05).astype(np.float32)[None]
        frame = av.AudioFrame.from_ndarray(wave, format="fltp", layout="mono")
        frame.rate, frame.pts = 44100, i * 1024
        packets += stream.encode(frame)
    return packets + stream.encode()


def shows(frames, expected):
    """Mean difference, in grey levels, between frames read and those drawn."""
    return np.abs(np.asarray(frames, float) - expected).mean()
