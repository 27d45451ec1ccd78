"""How the camera moved while a clip was filmed, from all that stands in the room.

In: frames (T, H, W, 3) uint8 of one shot. Out: for each frame the similarity that takes its pixels
to those of the first, and how far that leads: 0 for a camera on a stand. A pan, a zoom and a hand
that trembles move the whole picture by one similarity; an arm moves its own part. So each frame is
laid over the first by Gauss-Newton steps (Lucas and Kanade 1981), and pixels that do not fit weigh
little (Geman and McClure 1987). Corners alone would not do: stripes, tiles and bare walls have few
of them, or many that look alike, but each edge tells how it moved across itself. Where the room is
so bare that nothing tells, the camera is taken to stand.

A camera that pans along tiles slips by a tile in a frame that has little in common with the first.
So each frame is laid over a nearer one as well, whose way is known. That slips seldom, but it may
go along with an arm: it counts where the first frame bears it out.
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
NEAR = 0.04  # of the longer side: a frame farther off than that is no near one
# Of the cells that tell two ways apart, so many more have to be for one. Where it was right they
# were 0.36 or more, where it went along with an arm 0.08 at most.
BORNE = 0.3


def sway(frames: np.ndarray) -> np.ndarray:
    """Similarities (T, 2, 3) from the pixels of each frame (T, H, W, 3) uint8 to those of the
    first."""
    every = np.unique(np.linspace(0, len(frames) - 1, LOOK_AT).round().astype(int))
    shown = frames[every]
    there, votes = _followed(shown, np.inf)
    if extent(there[:, :2], *frames.shape[1:3]) > NEAR:
        by_near, its = _followed(shown, NEAR)
        if _bears_out(shown, there, by_near):
            there, votes = by_near, its
    if _stands(votes):
        return np.repeat(np.eye(3)[None, :2], len(frames), axis=0)
    along, at = np.arange(len(frames)), np.linalg.inv(there)[:, :2].reshape(-1, 6)
    return np.stack([np.interp(along, every, one) for one in at.T], 1).reshape(-1, 2, 3)


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


def _followed(frames, near):
    """Similarities (n, 3, 3) from the first frame's pixels to those of each, and the cells' votes
    (n, h, w): each frame is laid over the nearest of some, the first one among them, and the one
    before it joins them where that is farther than `near`, of the longer side."""
    there, before = np.eye(3), frames[0]
    known = [(there, _pictures(before))]
    at, votes = [], []
    for frame in frames:
        far = [_far(there @ np.linalg.inv(start), frame) for start, _ in known]
        if min(far) > near:
            known.append((there, _pictures(before)))
            far.append(0.0)
        start, (coarse, fine) = known[int(np.argmin(far))]
        small, plain = (_plain(frame, one.size) for one in (coarse, fine))
        over = fine.laid(plain, coarse.laid(small, there @ np.linalg.inv(start)))
        there, before = over @ start, frame
        at.append(there)
        votes.append(fine.votes(plain, over, np.eye(3)))
    return np.array(at), np.array(votes)


def _far(there, frame):
    """How far a similarity (3, 3) takes the corners of a frame, of its longer side."""
    return extent(np.stack([np.eye(3)[:2], there[:2]]), *frame.shape[:2])


def _bears_out(frames, one, other):
    """Whether the first frame speaks for the other of two ways (n, 3, 3) of the frames."""
    first = _Picture(frames[0], FINE)
    votes = [
        first.votes(_plain(frame, first.size), b, a, shared=True)
        for frame, a, b in zip(frames, one, other, strict=True)
    ]
    return np.sum(votes) > BORNE * np.abs(votes).sum()


def _pictures(frame):
    """A coarse and a fine picture of a frame (H, W, 3) uint8."""
    return _Picture(frame, COARSE), _Picture(frame, FINE)


class _Picture:
    """A frame, over which others are laid, `_plain` and as large. Its places count from the
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

    def votes(
        self, plain: np.ndarray, there: np.ndarray, other: np.ndarray, shared: bool = False
    ) -> np.ndarray:
        """For each cell (h, w) of this picture: 1 if it is more like the frame moved by `there`,
        -1 if it is more like the frame moved by `other`, 0 if it does not tell.

        shared: whether only those pixels count that are shown in both.
        """
        moves, stands = (
            self._off(plain, self.scale @ one @ np.linalg.inv(self.scale)) for one in (there, other)
        )
        if shared:
            both = moves[1] & stands[1]
            moves, stands = (moves[0], both), (stands[0], both)
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
