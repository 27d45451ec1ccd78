"""Star 13, behind a curtain: how far off is a track once the object has been hidden?"""

import functools

import numpy as np

import tasks
from lbw_minimal import tracks, video
from tests.grade.star import Star, shaped

CURTAIN = 6  # frames in which nothing is seen
NOISE, LIGHT = 4.0, 0.05  # grey levels; share by which the light flickers


def error(locate) -> float:
    """Mean error in pixels of locate(frames, points), (T, 2), wherever something is seen."""
    off = []
    for task in tasks.TASKS[1:]:  # reach has no object
        frames, points, d_E, seen = hidden(task)
        d = shaped(locate(frames.copy(), points.copy()), d_E, "the track")
        off.append(np.linalg.norm(d - d_E, axis=1)[seen].mean())
    return float(np.mean(off))


@functools.cache
def hidden(task: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A human's film with a curtain before it when the object has gone a third of its way.

    Returns frames (T, 84, 84, 3) uint8, the object's points (n, 2) in the first one, its
    displacement (T, 2) as it was found without the curtain, and where something is seen, (T,).
    """
    frames, _ = video.read(tasks.VIDEOS / task / "expert_01.mp4")
    shown = tracks.watch(frames)
    way = np.linalg.norm(shown.path, axis=1)
    rng = np.random.default_rng(0)
    light = rng.uniform(1 - LIGHT, 1 + LIGHT, (len(frames), 1, 1, 1))
    frames = frames * light + rng.normal(0, NOISE, frames.shape)
    first = int(np.argmax(way > way[-1] / 3))
    frames[first : first + CURTAIN] = 90
    seen = np.ones(len(frames), bool)
    seen[first : first + CURTAIN] = False
    return frames.clip(0, 255).astype(np.uint8), shown.points, shown.path, seen


STAR = Star(error, "pixels", bar=1, naive=6.7, ours=0.16)
