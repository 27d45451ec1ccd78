"""What moves in a film, and where the film jumps.

In: frames (T, H, W, 3) uint8 and their times (T,) in seconds. Frames are compared in grey and
without their local mean, so that the room's light and the camera's exposure may change.

The figures in the comments were measured on the kit's videos and two clips of the authors while the
kit was built; no file in solutions/results holds them.
"""

from __future__ import annotations

import cv2
import numpy as np

from lbw_minimal.images import spread

SMALL = 84  # pixels, both sides of a frame when it is asked whether something moves
LOOK_AT = 60  # frames that are looked at for this, spread over the film
# Grey levels, after the local mean is taken off. Sensor noise of 16 levels moves 0.04 % of a
# frame's pixels by more than this, the smallest motion among our clips (a reach) 1.8 %.
MOVED = 16
MOVED_SHARE = 0.005  # 35 pixels: less is noise, or an object too small for a keypoint
WIDTH = 112  # pixels, of the frames in which jumps are looked for
TALLEST = 4 * WIDTH  # pixels, of their height: of a strip they are squeezed
NEAR = 0.25  # seconds: the motion before and after that says what is usual
# How many times the usual residual makes a jump, up to 13 frames a second. Of 15 expert videos,
# thinned to 25, 12.5 and 10 frames a second, with noise of 8 levels or none, only a puck that is
# hit was above, at 10 frames a second: there it takes 4. Of the same as loops that start in the
# middle all were found from 12.5 on, three in four of the hits at 10, of pieces taken out two in
# three.
JUMP = 3.0
SLOW = 0.075  # seconds between frames, above which motion itself becomes jumpy
FAINT = 4  # grey levels that noise changes, and coding wherever a new key frame begins
LITTLE = 0.1  # grey levels, in the mean over a frame: no arm has moved
# Of the picture, and times what moves just before and after: in 10 true cuts the share was 0.034 or
# more, and hardly anything moved beside it; in hits at 10 frames a second it was up to 1.9 times as
# much as beside it, and at key frames 0.013 at most.
AT_ONCE, MORE = 0.02, 2.0
GAP = 0.5  # seconds: a longer pause between two frames hides a motion


def some(frames: np.ndarray) -> np.ndarray:
    """At most LOOK_AT of the frames (T, ...), spread evenly."""
    return spread(frames, LOOK_AT)


def high_pass(frames: np.ndarray) -> np.ndarray:
    """Grey frames (T, 84, 84) float32 without their local mean, of (T, 84, 84, 3) uint8."""
    grey = [cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY).astype(np.float32) for frame in frames]
    grey = [cv2.GaussianBlur(g, (3, 3), 0) for g in grey]
    return np.stack([g - cv2.blur(g, (15, 15)) for g in grey])


def small(frame: np.ndarray) -> np.ndarray:
    """A frame (H, W, 3) uint8 as `high_pass` wants it, (84, 84, 3), its sides squeezed alike."""
    return cv2.resize(frame, (SMALL, SMALL), interpolation=cv2.INTER_AREA)


def differs(still: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Whether a thing moved between high-passed frames (..., 84, 84) and others, (...,) bool."""
    return (np.abs(still - other) > MOVED).mean(axis=(-2, -1)) >= MOVED_SHARE


def before_background(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """Some of the frames (T, H, W, 3) uint8, high-passed, (n, 84, 84), their background, (84, 84),
    and whether anything moves in front of it."""
    still = high_pass(np.stack([small(frame) for frame in some(frames)]))
    background = np.median(still, axis=0)
    return still, background, bool(differs(still, background).any())


def moves(frames: np.ndarray) -> bool:
    """Whether anything moves in frames (T, H, W, 3) uint8."""
    return before_background(frames)[2]


def told(frames: np.ndarray) -> np.ndarray:
    """Indices (n,) of the frames (T, H, W, 3) uint8 in which something has moved since the last of
    them; the first frame is one."""
    passed = high_pass(np.stack([small(frame) for frame in frames]))
    kept = [0]
    for t, one in enumerate(passed):
        if differs(one, passed[kept[-1]]):
            kept.append(t)
    return np.array(kept)


def jumps(frames: np.ndarray, times: np.ndarray) -> list[int]:
    """Indices of the frames that do not continue the one before, rising.

    A frame that optical flow cannot make from the one before, while it can make its neighbours,
    follows a cut: a loop that starts in the middle, a piece taken out, another scene. One that
    comes more than GAP seconds late and shows a change follows a motion that nobody filmed.
    """
    if len(frames) < 3:
        return []
    size = WIDTH, min(max(8, round(frames.shape[1] * WIDTH / frames.shape[2])), TALLEST)
    change, residual = _unexplained(frames, size)
    step, middle = np.diff(times), (times[1:] + times[:-1]) / 2
    change, residual = (x - np.percentile(x, 10) for x in (change, residual))  # what noise does
    late = (step > max(GAP, 3 * np.median(step))) & (change > LITTLE)
    found = [int(t) + 1 for t in np.flatnonzero(late)]
    for t in np.flatnonzero(~late & (residual > LITTLE)):
        near = np.abs(middle - middle[t]) <= max(NEAR, 2.5 * step[t])
        near[t] = False
        usual = (residual[near] / step[near]).max(initial=0) * step[t]
        odd = residual[t] > JUMP * max(1, step[t] / SLOW) * (usual + LITTLE)
        if odd and _at_once(frames, int(t) + 1):
            found.append(int(t) + 1)
    return sorted(found)


def _at_once(frames, t):
    """Whether frame t differs by far more from the one before than its neighbours do: a key frame
    changes all of the picture by a little, and a hit is not over in one step."""
    passed = high_pass(np.stack([small(frame) for frame in frames[max(0, t - 2) : t + 2]]))
    moved = (np.abs(np.diff(passed, axis=0)) > MOVED).mean((1, 2))
    here = min(t, 2) - 1
    usual = np.delete(moved, here).max(initial=0)
    return bool(moved[here] >= max(AT_ONCE, MORE * usual))


def _unexplained(frames, size):
    """Mean change (T-1,) between neighbours, in grey levels, and what of it flow cannot explain.

    The first FAINT levels of a pixel's change do not count.
    """
    x, y = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in size))
    window = (2 * (size[0] // 12) - 1,) * 2  # a sixth of the picture is "local"
    change, residual, before = [], [], None
    for frame in frames:
        grey = cv2.cvtColor(
            cv2.resize(frame, size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY
        )
        grey = cv2.GaussianBlur(grey, (3, 3), 0)
        passed = grey - cv2.blur(grey.astype(np.float32), window)
        if before is not None:
            change.append(_strong(passed - before[1]))
            residual.append(change[-1])
            if change[-1] > LITTLE:
                # OpenCV's faster flow, DIS, crashes on a bright disc before black.
                back = cv2.calcOpticalFlowFarneback(
                    grey, before[0], np.zeros((*grey.shape, 2), np.float32), pyr_scale=0.5,
                    levels=4, winsize=13, iterations=3, poly_n=5, poly_sigma=1.1, flags=0,
                )  # fmt: skip
                guess = cv2.remap(
                    before[1], x + back[..., 0], y + back[..., 1], cv2.INTER_LINEAR,
                    borderMode=cv2.BORDER_REPLICATE,
                )  # fmt: skip
                residual[-1] = _strong(passed - guess)
        before = grey, passed
    return np.array(change), np.array(residual)


def _strong(difference):
    return np.maximum(np.abs(difference) - FAINT, 0).mean()
