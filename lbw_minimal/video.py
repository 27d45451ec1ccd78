"""Video files, in and out.

In: any file that `clips` reads, of any size and frame rate. Out: frames (T, 84, 84, 3) uint8 RGB,
25 a second, checked before anything is learnt from them. The other way round, frames become a film
that a browser plays. Pauses are not cut here but on the keypoint trajectory, where stillness does
not depend on light and noise.

The figures in the comments were measured on the kit's videos and two clips of the authors while the
kit was built; no file in solutions/results holds them.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from itertools import chain
from pathlib import Path

import cv2
import numpy as np

from lbw_minimal.clips.motion import before_background
from lbw_minimal.clips.reader import read_clip, resample, steady
from lbw_minimal.training import InputError, write_atomic

SIZE = 84  # pixels, both sides of a frame
MAX_FRAMES = 2000  # 42 MB; the human videos of the paper have 398 to 1,056
# The share of frames in which the steadiest two fifths of the edges stay where they are. It is 0.93
# or more in 20 rendered and 2 real clips, even with 8 levels of noise; 0.66 or less if a real
# clip is panned by 15 pixels, 0.80 if a drawn room is panned by 10, 0.43 or less if shaken by 2.
STEADY = 0.87
EDGE = 3  # grey levels per pixel: weaker edges drown in noise


def read(path: Path | str, whole: bool = False) -> tuple[np.ndarray, list[str]]:
    """Frames (T, 84, 84, 3) uint8 RGB of a video's central square, and warnings, a sentence each.

    They are 25 a second, by the file's time stamps; a video of more than MAX_FRAMES is thinned
    evenly. Of a video with jump cuts the longest piece is taken, unless `whole`: random motion is
    filmed in takes. Raises InputError if the file is missing, not a video, cut short, shorter than
    two frames, smaller than 84x84, or if nothing moves in it.
    """
    clip = read_clip(path, cuts=not whole)
    warnings = list(clip.losses)
    if clip.cuts:
        pieces, seconds, start = len(clip.cuts) + 1, clip.times[-1], clip.times[clip.cuts]
        clip = steady(clip)
        warnings.append(
            f"it jumps at {', '.join(f'{t:.1f} s' for t in start[:5])}; the longest of {pieces} "
            f"pieces is used, {clip.times[-1]:.1f} of {seconds:.1f} s."
        )
    squares = np.stack([_square(frame, path) for frame in clip.frames])
    frames = squares[resample(clip.times)]
    if len(frames) > MAX_FRAMES:
        every = -(-len(frames) // MAX_FRAMES)
        count, frames = len(frames), frames[::every]
        warnings.append(f"{count} frames are many; one in {every} is used, {len(frames)} in all.")
    still, background, moving = before_background(frames)
    if not moving:
        raise InputError(
            f"{path}: nothing moves in the video; give one in which the arm does the task."
        )
    if steadiness(still, background) < STEADY:
        warnings.append("the camera seems to move; put it on a stand, or keypoints will follow it.")
    return frames, [f"{path}: {warning}" for warning in warnings]


def _square(rgb, path):
    h, w = rgb.shape[:2]
    side = min(h, w)
    if side < SIZE:
        raise InputError(
            f"{path}: {w}x{h} pixels are too few; give a video of {SIZE}x{SIZE} or more, at most "
            "three times as wide as high."
        )
    top, left = (h - side) // 2, (w - side) // 2
    square = rgb[top : top + side, left : left + side]
    return cv2.resize(square, (SIZE, SIZE), interpolation=cv2.INTER_AREA)


def steadiness(still: np.ndarray, background: np.ndarray) -> float:
    """Share of the frames in which the steadiest two fifths of the edges stay within a pixel.

    An edge of slope g that moves by d pixels changes the grey level there by g d. The arm hides
    some edges of the background, and where it rests for half of the clip it has edges in it; a
    moving camera displaces them all. What a horizontal edge cannot tell, a pan along it, goes
    unnoticed where the room has no other edges.
    """
    slope_x = cv2.Sobel(background, cv2.CV_32F, 1, 0, scale=1 / 8)
    slope_y = cv2.Sobel(background, cv2.CV_32F, 0, 1, scale=1 / 8)
    slope = np.hypot(slope_x, slope_y)
    edge = slope > EDGE
    if not edge.any():
        return 1.0
    stays = np.abs(still - background)[:, edge] < slope[edge]  # (frames, edge pixels)
    return float(np.percentile(stays.mean(axis=0), 60))


def write(path: Path | str, frames: Iterable[np.ndarray], fps: float, scale: int = 2) -> None:
    """Write RGB uint8 frames (H, W, 3) as an mp4 that browsers play.

    The old file stays if anything fails. The codec is VP9, because its decoding is exact on every
    machine. It halves the resolution of colour, so frames are enlarged `scale` times, pixel by
    pixel; `read` shrinks them back. Measured on 84x84 frames of
    the tasks: scale 1 takes 280 bytes a frame and moving pixels come back with a PSNR of 35 dB,
    scale 2 500 and 40 dB, scale 4 580, 41 dB and three times the time. MPEG-4 at scale 2 takes 300
    bytes, 37 dB, and no browser plays it. Raises InputError if there are no frames, OSError if the
    folder cannot be written.
    """
    frames = iter(frames)
    first = next(frames, None)
    if first is None:
        raise InputError(f"{path}: there are no frames to write.")
    size = (first.shape[1] * scale, first.shape[0] * scale)
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "film.mp4"
        film = cv2.VideoWriter(
            str(part), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"vp09"), fps, size
        )
        if not film.isOpened():
            raise RuntimeError(
                "this OpenCV cannot write VP9; install the version in requirements.txt."
            )
        for frame in chain([first], frames):
            bgr = cv2.cvtColor(np.asarray(frame), cv2.COLOR_RGB2BGR)
            film.write(cv2.resize(bgr, size, interpolation=cv2.INTER_NEAREST))
        film.release()
        write_atomic(path, part.read_bytes())
