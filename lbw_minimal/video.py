"""Video files, in and out.

In: any file that OpenCV's FFmpeg decodes, of any size and frame rate. Out: frames (T, 84, 84, 3)
uint8 RGB, checked before anything is learnt from them. The other way round, frames become a film
that a browser plays. Pauses are not cut here but on the keypoint trajectory, where stillness does
not depend on light and noise.

The figures in the comments were measured on the kit's videos and two clips of the authors while the
kit was built; no file in solutions/results holds them.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import tempfile
from collections.abc import Iterable
from itertools import chain
from pathlib import Path

import cv2
import numpy as np

from lbw_minimal.training import InputError, write_atomic

SIZE = 84  # pixels, both sides of a frame
MAX_FRAMES = 2000  # 42 MB; the human videos of the paper have 398 to 1,056
LOOK_AT = 60  # frames that the checks of motion and camera look at, spread over the video
# Grey levels, after the local mean is taken off. Sensor noise of 16 levels moves 0.04 % of a
# frame's pixels by more than this, the smallest motion among our clips (a reach) 1.8 %.
MOVED = 16
MOVED_SHARE = 0.005  # 35 pixels: less is noise, or an object too small for a keypoint
# The share of frames in which the steadiest two fifths of the edges stay where they are. It is 0.93
# or more in 20 rendered and 2 real clips, even with 8 levels of noise; 0.66 or less if a real
# clip is panned by 15 pixels, 0.80 if a drawn room is panned by 10, 0.43 or less if shaken by 2.
STEADY = 0.87
EDGE = 3  # grey levels per pixel: weaker edges drown in noise


def read(path: Path | str) -> tuple[np.ndarray, list[str]]:
    """Frames (T, 84, 84, 3) uint8 RGB of a video's central square, and warnings, a sentence each.

    A video longer than MAX_FRAMES is thinned evenly. Only one full-size frame is held at a time.
    Raises InputError if the file is missing, not a video, cut short, shorter than two frames,
    smaller than 84x84, or if nothing moves in it.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path}: this is a folder; give the video file itself.")
    if not path.exists():
        raise InputError(f"{path}: there is no such file; check the path.")
    with _silence():
        frames, every, count = _decode(path)
    if count == 1:
        raise InputError(
            f"{path}: the video has a single frame; give one in which the arm does the task."
        )
    still = _high_pass(frames)
    background = np.median(still, axis=0)  # (84, 84)
    if (np.abs(still - background) > MOVED).mean(axis=(1, 2)).max() < MOVED_SHARE:
        raise InputError(
            f"{path}: nothing moves in the video; give one in which the arm does the task."
        )
    warnings = []
    if every > 1:
        warnings.append(
            f"{path}: {count} frames are many; every {every}th is used, {len(frames)} in all."
        )
    if _steadiness(still, background) < STEADY:
        warnings.append(
            f"{path}: the camera seems to move; put it on a stand, or keypoints will follow it."
        )
    return frames, warnings


@contextlib.contextmanager
def _silence():
    """Keeps OpenCV and FFmpeg from printing to stderr beside our one sentence on a bad file."""
    name = "OPENCV_FFMPEG_LOGLEVEL"  # read whenever a file is opened
    level, asked = cv2.utils.logging.getLogLevel(), os.environ.get(name)
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    os.environ[name] = "-8"  # AV_LOG_QUIET
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)
        os.environ.pop(name)
        if asked is not None:
            os.environ[name] = asked


def _decode(path):
    """Frames kept (T, 84, 84, 3), the spacing between them, and how many the file holds."""
    film = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    if not film.isOpened():
        raise InputError(f"{path}: {_why_closed(path)}")
    kept, every, count = [], 1, 0
    while film.grab():
        # Only what is kept is converted: the colours of a phone's HDR cost 0.1 s a frame.
        if count % every == 0:
            kept.append(_shrink(film.retrieve()[1], path))
            if len(kept) > MAX_FRAMES:  # the header's frame count may lie, so thin as they come
                kept, every = kept[::2], 2 * every
        count += 1
    stated = film.get(cv2.CAP_PROP_FRAME_COUNT)  # some formats round it from the duration
    if count < 0.95 * stated - 1:
        said = f"its header promises {stated:.0f} frames and {count} can be read"
        raise InputError(f"{path}: the video is cut short, {said}; copy or export it again.")
    if count == 0:
        raise InputError(f"{path}: the video has no frames; record or export it again.")
    return np.stack(kept), every, count


def _why_closed(path):
    """What is wrong with a file that FFmpeg does not open."""
    try:
        if path.stat().st_size == 0:
            return "the file is empty; copy or export it again."
        with open(path, "rb") as f, mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_READ) as data:
            if data[4:8] != b"ftyp":
                return "this is not a video that OpenCV can read; give an mp4, mov or webm file."
            if data.find(b"moov") < 0:  # an mp4's index, written last
                return "the video is cut short, its index is missing; copy or export it again."
    except OSError as error:
        return f"the file cannot be read ({error.strerror}); change its permissions or copy it."
    return "the video has no frames that OpenCV can decode; record it again or export it as H.264."


def _shrink(bgr, path):
    h, w = bgr.shape[:2]
    side = min(h, w)
    if side < SIZE:
        raise InputError(
            f"{path}: {w}x{h} pixels are too few; give a video of {SIZE}x{SIZE} or more."
        )
    top, left = (h - side) // 2, (w - side) // 2
    square = bgr[top : top + side, left : left + side]
    return cv2.cvtColor(
        cv2.resize(square, (SIZE, SIZE), interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2RGB
    )


def _high_pass(frames):
    """Grey frames (<= LOOK_AT, 84, 84) without their local mean, so that exposure may change."""
    pick = np.linspace(0, len(frames) - 1, min(len(frames), LOOK_AT)).astype(int)
    grey = [cv2.cvtColor(frames[i], cv2.COLOR_RGB2GRAY).astype(np.float32) for i in pick]
    grey = [cv2.GaussianBlur(g, (3, 3), 0) for g in grey]
    return np.stack([g - cv2.blur(g, (15, 15)) for g in grey])


def _steadiness(still, background):
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
    return np.percentile(stays.mean(axis=0), 60)


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
