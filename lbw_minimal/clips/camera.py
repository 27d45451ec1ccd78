"""How the camera moved while a clip was filmed, from all that stands in the room.

In: frames (T, H, W, 3) uint8 of one shot. Out: for each frame the similarity that takes its pixels
to those of the first, and how far that leads: 0 for a camera on a stand. A pan, a zoom and a hand
that trembles move the whole picture by one similarity; an arm moves its own part. So each frame is
laid over the first by Gauss-Newton steps (Lucas and Kanade 1981), and pixels that do not fit weigh
little (Geman and McClure 1987). Corners alone would not do: stripes, tiles and bare walls have few
of them, or many that look alike, but each edge tells how it moved across itself. Where the room is
so bare that nothing tells, the camera is taken to stand.
"""

from __future__ import annotations

import cv2
import numpy as np

LOOK_AT = 120  # frames that are looked at, spread over the shot; between them it is interpolated
COARSE, FINE = 60, 200  # pixels of the longer side: the first finds the way, the second the place
SMOOTH, LOCAL = 1.0, 15  # pixels: noise is taken off, and the local mean, with light and exposure
STEPS = 20  # at most; most frames take three to six
DONE = 0.03  # pixels: a step that is shorter is the last
NOISE = 2.0  # grey levels, the least that a pixel is taken to vary by
DAMPED = 0.5  # the weight, in pixels of noise, with which a step stays short where nothing tells
CELLS = 12  # along the longer side: a cell has one vote, or a striped sleeve would outvote the room
BETTER = 0.1  # of what a pixel can be off, in a cell's mean: by so much a cell votes
# Times the votes for a camera that stands: what is less is an arm's. In our own videos, whose room
# is bare, an arm has up to 0.95, and a pan along stripes has 1.5.
MOST = 1.2
WIDE = 0.2  # of the picture, about which the cells have to lie that vote for one that moves


def sway(frames: np.ndarray) -> np.ndarray:
    """Similarities (T, 2, 3) from the pixels of each frame (T, H, W, 3) uint8 to those of the
    first."""
    every = np.unique(np.linspace(0, len(frames) - 1, LOOK_AT).round().astype(int))
    coarse, fine = (_Picture(frames[0], side) for side in (COARSE, FINE))
    there, at, votes = np.eye(3), [], []
    for t in every:
        plain = _plain(frames[t], fine.size)
        there = fine.laid(plain, coarse.laid(_plain(frames[t], coarse.size), there))
        at.append(np.linalg.inv(there)[:2].ravel())
        votes.append(fine.votes(plain, there))
    if _stands(np.array(votes)):
        return np.repeat(np.eye(3)[None, :2], len(frames), axis=0)
    along = np.arange(len(frames))
    return np.stack([np.interp(along, every, one) for one in np.array(at).T], 1).reshape(-1, 2, 3)


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


class _Picture:
    """A first frame, over which others are laid, `_plain` and as large. Its places count from the
    picture's middle."""

    def __init__(self, frame: np.ndarray, side: int):
        h, w = frame.shape[:2]
        scale = min(1.0, side / max(h, w))
        self.size = round(w * scale), round(h * scale)
        self.plain = _plain(frame, self.size)
        x, y = np.meshgrid(*(np.arange(n, dtype=np.float32) - n / 2 for n in self.size))
        self.reach = max(self.size) / 2  # pixels: a turn or a zoom by 1 would move the edge so far
        gx, gy = (
            cv2.Sobel(self.plain, cv2.CV_32F, *along, ksize=3, scale=1 / 8)
            for along in ((1, 0), (0, 1))
        )
        # How a pixel changes if what is seen is zoomed, turned and shifted: (h w, 4)
        self.slopes = np.stack(
            [(gx * x + gy * y) / self.reach, (gy * x - gx * y) / self.reach, gx, gy], axis=-1
        ).reshape(-1, 4)
        middle = np.array([[1, 0, self.size[0] / 2], [0, 1, self.size[1] / 2], [0, 0, 1]])
        self.middle = middle, np.linalg.inv(middle)
        self.scale = np.diag([self.size[0] / w, self.size[1] / h, 1.0])

    def laid(self, plain: np.ndarray, there: np.ndarray) -> np.ndarray:
        """The similarity (3, 3) from this picture's pixels, at full size, to those of a frame.

        there: where to begin.
        """
        at = self.scale @ there @ np.linalg.inv(self.scale)
        for _ in range(STEPS):
            off, inside = self._off(plain, at)
            noise = _noise(off, inside)
            weights = (inside / (1 + (off / noise) ** 2) ** 2).reshape(-1)
            weighted = self.slopes * weights[:, None]
            normal = self.slopes.T @ weighted + DAMPED * noise**2 * np.eye(4)
            zoom, turn, dx, dy = step = np.linalg.solve(normal, weighted.T @ off.reshape(-1))
            zoom, turn = zoom / self.reach, turn / self.reach
            moved = np.array([[1 + zoom, -turn, dx], [turn, 1 + zoom, dy], [0, 0, 1]])
            at = at @ np.linalg.inv(self.middle[0] @ moved @ self.middle[1])
            if np.abs(step).max() < DONE:
                break
        return np.linalg.inv(self.scale) @ at @ self.scale

    def votes(self, plain: np.ndarray, there: np.ndarray) -> np.ndarray:
        """For each cell (h, w) of this picture: 1 if it is more like the frame moved by `there`,
        -1 if it is more like the frame as it stands, 0 if it does not tell."""
        at = self.scale @ there @ np.linalg.inv(self.scale)
        moves, stands = (self._off(plain, one) for one in (at, np.eye(3)))
        noise, cell = _noise(*moves), max(self.size) / CELLS
        cells = tuple(max(1, round(n / cell)) for n in self.size)
        moves, stands = (
            cv2.resize(_unlike(off, inside, noise), cells, interpolation=cv2.INTER_AREA)
            for off, inside in (moves, stands)
        )
        better = stands - moves
        return np.sign(better) * (np.abs(better) > BETTER)

    def _off(self, plain, at):
        """How far a frame (h, w) is off this picture at each pixel, and which it shows, (h, w)."""
        how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        shown = cv2.warpAffine(plain, at[:2], self.size, flags=how)
        inside = cv2.warpAffine(np.ones_like(plain), at[:2], self.size, flags=how) > 0.99
        return shown - self.plain, inside


def _stands(votes):
    """Whether the cells (T, h, w) of a shot say that the camera stands, or nothing."""
    moved = votes > 0
    if moved.sum() <= MOST * (votes < 0).sum():
        return True
    spread = np.argwhere(moved.any(0)).astype(np.float32)
    return bool(cv2.contourArea(cv2.convexHull(spread)) < WIDE * moved[0].size)


def _plain(frame, size):
    """A frame in grey, as large as `size` (w, h), without noise and without its local mean."""
    grey = cv2.cvtColor(cv2.resize(frame, size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY)
    grey = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), SMOOTH)
    return grey - cv2.blur(grey, (LOCAL, LOCAL))


def _noise(off, inside):
    """The deviation that most pixels have, in grey levels."""
    return max(NOISE, 1.4826 * float(np.median(np.abs(off[inside])))) if inside.any() else NOISE


def _unlike(off, inside, noise):
    """How unlike the pixels (h, w) are, 0 to 1; what is not shown is neither nor."""
    q = (off / noise) ** 2
    return np.where(inside, q / (1 + q), 0.5).astype(np.float32)
