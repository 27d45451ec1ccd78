"""How the camera moved while a clip was filmed, from the corners that stand in the room.

In: frames (T, H, W, 3) uint8 of one shot. Out: for each frame the similarity that takes its pixels
to those of the first, and how far that leads: 0 for a camera on a stand. A pan, a zoom and a hand
that trembles move the whole picture by one similarity; an arm moves its own part. So corners are
followed from frame to frame, and the motion counts that is shared all over the picture. Where the
room is so bare that nothing tells, the camera is taken to stand.
"""

from __future__ import annotations

import cv2
import numpy as np

from lbw_minimal.clips.corners import found_again

LOOK_AT = 60  # frames that are followed, spread over the shot; between them it is interpolated
CELLS = 12  # of the longer side: a cell has one vote, or a striped sleeve would outvote the room
WINDOW = (21, 21)  # pixels, what is compared about a corner
SMOOTH = 1.5  # pixels: corners of noise are no corners
BACK = 0.7  # pixels: a corner that comes back further off is lost
FITS = 1.0  # pixels off, and still the same motion; also that of a corner that stands
LEAST = 5  # cells that have to agree
WIDE = 0.2  # of the picture, about which these have to lie
FEW = 0.5  # times the cells that move: so many that stand are chance, dust or a caption
FRESH = 0.5  # of a frame's corners: when fewer are left, others are chosen


def sway(frames: np.ndarray) -> np.ndarray:
    """Similarities (T, 2, 3) from the pixels of each frame (T, H, W, 3) uint8 to those of the
    first."""
    every = np.unique(np.linspace(0, len(frames) - 1, LOOK_AT).round().astype(int))
    grey = [_plain(frames[t]) for t in every]
    at, base, step = [np.eye(3)], np.eye(3), np.eye(3)
    one, corners = grey[0], _corners(grey[0])
    for two in grey[1:]:
        here, there = _followed(one, two, corners, step)
        step = _shared(here, there, one.shape, step)
        at.append(base @ step)
        if len(here) < FRESH * len(corners):
            one, corners, base, step = two, _corners(two), at[-1], np.eye(3)
    flat = np.stack(at)[:, :2].reshape(-1, 6)
    along = np.arange(len(frames))
    return np.stack([np.interp(along, every, one) for one in flat.T], 1).reshape(-1, 2, 3)


def extent(sways: np.ndarray, height: int, width: int) -> float:
    """How far the picture's corners move, in its longer sides, along x or y."""
    corners = np.array([(0, 0, 1), (width, 0, 1), (0, height, 1), (width, height, 1)], float)
    paths = np.einsum("tij,kj->tki", sways, corners)  # (T, 4, 2)
    return float(np.ptp(paths, axis=0).max() / max(height, width))


def steadied(frames: np.ndarray, sways: np.ndarray) -> np.ndarray:
    """The frames as from a camera that stands where it stood first; what it does not see any more
    stays as it was."""
    h, w = frames.shape[1:3]
    out, before = np.empty_like(frames), frames[0]
    seen = np.full((h, w), 255, np.uint8)
    for t, (frame, sway) in enumerate(zip(frames, sways, strict=True)):
        moved = cv2.warpAffine(frame, sway, (w, h), flags=cv2.INTER_LINEAR)
        shown = cv2.warpAffine(seen, sway, (w, h), flags=cv2.INTER_LINEAR) == 255
        out[t] = before = np.where(shown[..., None], moved, before)
    return out


def _plain(frame):
    """A frame (H, W, 3) in grey (H, W) uint8, without its local mean: light and exposure change."""
    grey = cv2.GaussianBlur(cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY), (0, 0), SMOOTH).astype(float)
    return np.clip(128 + 3 * (grey - cv2.blur(grey, (31, 31))), 0, 255).astype(np.uint8)


def _corners(grey):
    """The corners (n, 1, 2) of a frame (H, W) uint8."""
    found = cv2.goodFeaturesToTrack(grey, 400, 0.01, max(grey.shape) / 50, blockSize=7)
    return np.zeros((0, 1, 2), np.float32) if found is None else found


def _followed(one, two, corners, step):
    """The corners (n, 2) of the first frame that are found in the second, and where there.

    step: the similarity (3, 3) from the second to the first, as it was a moment ago.
    """
    if not len(corners):
        return corners[:, 0], corners[:, 0]
    guess = cv2.transform(corners, np.linalg.inv(step)[:2]).astype(np.float32)
    there, kept = found_again(one, two, corners, guess, corners, WINDOW, BACK)
    return corners[kept, 0], there[kept, 0]


def _shared(here, there, shape, before):
    """The similarity (3, 3) that most of the picture shares from `there` to `here`, (n, 2); the
    one before where nothing tells."""
    if len(here) < LEAST:
        return before
    fit, _ = cv2.estimateAffinePartial2D(there, here, method=cv2.RANSAC, ransacReprojThreshold=FITS)
    if fit is None:
        return before
    cells = (here // (max(shape) / CELLS)).astype(int) @ (CELLS, 1)
    fits = np.linalg.norm(there @ fit[:, :2].T + fit[:, 2] - here, axis=1) < FITS
    stands = np.linalg.norm(there - here, axis=1) < FITS
    moved, still = (len(np.unique(cells[what])) for what in (fits, stands))
    if still >= max(LEAST, FEW * moved):
        return np.eye(3)
    hull = cv2.contourArea(cv2.convexHull(here[fits].astype(np.float32)))
    if moved < LEAST or hull < WIDE * shape[0] * shape[1]:
        return before
    return np.vstack([fit, (0, 0, 1)])
