"""A clip that looks as if somebody's phone had filmed it, made of a film from the simulator.

A real person's clip cannot come with the kit. So the course and the gallery take a film of the
simulated human and change what another room and another camera would change: where things are, how
large, and on which side the arm comes in; colours, flicker and noise; the pace, and when the frames
come. That shows how the steps fit together. How well they do on a real clip it does not show.
In: frames (T, 84, 84, 3) uint8 at 25 a second, and the true pixels of tip and object, for plots and
tests alone. Out: a `LookAlike`, and a video file of it.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import av
import cv2
import numpy as np

from lbw_minimal.clips.retarget import FPS

WIDTH, HEIGHT = 320, 240  # pixels
# A pixel of the film in the clip: mirrored, 3.1 times as large, and the table not quite level.
PLACE = np.array([[-3.1, 0.12, 305.0], [0.10, 3.1, -15.0]])
TINT = np.array([1.06, 1.0, 0.9])  # of red, green and blue: a lamp at home
FLICKER, NOISE = 0.03, 4.0  # share of the light, grey levels
PACE = 0.7  # times the film's speed
RATE = 15  # frames a second
UNEVEN, LOST = 0.4, 0.1  # share of a step; share of frames that never came
BEFORE = 0.4  # s of rest in front


class LookAlike(NamedTuple):
    """N frames as by a phone; places in pixels from their left and upper edge."""

    frames: np.ndarray  # (N, 240, 320, 3) uint8
    times: np.ndarray  # (N,) s, rising from 0, unevenly
    tip: np.ndarray  # (N, 2)
    object: np.ndarray  # (N, 2)


def look_alike(frames: np.ndarray, pixels: np.ndarray, seed: int = 0) -> LookAlike:
    """The film's motion as a phone might have filmed it.

    frames (T, 84, 84, 3) uint8, pixels (T, 4): x and y of tip and object, as `tasks.world.film`
    returns them.
    """
    rng = np.random.default_rng(seed)
    lasts = BEFORE + len(frames) / (FPS * PACE)  # s
    steps = (1 + rng.uniform(-UNEVEN, UNEVEN, round(lasts * RATE))) / RATE
    times = np.concatenate([[0.0], np.cumsum(steps) * lasts / steps.sum()])
    kept = rng.random(len(times)) >= LOST
    kept[[0, -1]] = True
    times = times[kept]
    at = np.clip(np.round((times - BEFORE) * PACE * FPS), 0, len(frames) - 1).astype(int)
    seen = np.stack([_seen(frames[i], rng) for i in at])
    tip, object_ = (pixels[at, i : i + 2] @ PLACE[:, :2].T + PLACE[:, 2] for i in (0, 2))
    return LookAlike(seen, times, tip, object_)


def _seen(frame, rng):
    # Beyond the film's edge its last pixels go on, the arm and the table with them.
    edge = PLACE + np.outer(PLACE[:, :2].sum(1) - 1, [0, 0, 0.5])  # OpenCV counts from the centre
    large = cv2.warpAffine(
        frame, edge, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    ).astype(float)
    light = 1 + rng.normal(0, FLICKER)
    noisy = large * (light * TINT) + rng.normal(0, NOISE, large.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8)


def write(path: Path | str, clip: LookAlike) -> None:
    """Write the clip as H.264, each frame with its time, as phones do."""
    with av.open(str(path), "w") as out:
        stream = out.add_stream("libx264", rate=RATE)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 1000)  # s
        for array, time in zip(clip.frames, clip.times, strict=True):
            frame = av.VideoFrame.from_ndarray(array, format="rgb24")
            frame.pts, frame.time_base = round(1000 * time), Fraction(1, 1000)
            out.mux(stream.encode(frame))
        out.mux(stream.encode())
