"""How many arms come into a clip, and where. Not from the paper.

There are two witnesses. The detector was taught where arms are in made clips, and sees one that
hardly moves; of some it is never sure. What moves in over an edge is an arm mostly, and sometimes a
lamp. One of them is enough to believe in an arm, or in two; where each sees a second one faintly,
both are.
In: masks (n, h, w) of some of a shot's frames, as `Detector.look` gives them: how sure each cell
shows an arm, 0 to 1. A cell is two pixels wide in a picture whose longer side has 84. And how much
each pixel of some frames is off the room, (T, 84, 84).
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np

from lbw_minimal.clips.footage import CAMERA, EDGE, LARGE, SOMETIMES, at_edge, things
from lbw_minimal.clips.motion import MOVED, SMALL
from lbw_minimal.clips.paths import SIDE_ON
from lbw_minimal.clips.paths import SURE as TIP_SURE

SURE = 0.5  # a cell with more shows an arm
LEAST = 10  # cells in one piece: fewer are no arm
MOST = 20  # of the largest piece in a shot; of an arm it had 32 or more, of a lamp 14
PLAIN = 0.8  # so sure is at least one cell of an arm; of a person's body mostly none
NEAR = 4  # cells from the edges over which an arm comes in
# How far an arm reaches in, over how wide it is at the edge. A body that stands at the edge has
# 0.4, a hand that is cut off by it 0.5.
REACHES = 0.5
APART = 4  # cells between two arms
SEEN = 0.1  # of the frames: in those of clips without an arm there was none, else in 0.23 or more
SEVERAL = 0.22  # of the frames: with two people it was 0.25 or more, with one 0.17 at most
FAINT = 10  # grey levels: at the shoulder an arm moves by little
COVERS = 0.04  # of the picture: a lamp that swings at its edge covers half of that, an arm twice
ACROSS = 1.0  # of the width, from edge to edge: between them a lamp may hang beside an arm
FINGER = 3  # pixels: what is narrower at a side edge touches it, as the hand of an arm from above
OFTEN = 0.05  # of the frames: an arm at its median place is not told from the room
MOVES = 0.25  # of a piece's cells: of a second hand 0.46 mostly, of a lamp that hangs inside 0.18
AT_TIP = 2.5  # cells: a piece that is so near the tip is that hand's arm
FIRST = 0.5  # of a piece's cells, where the arm stood first: that may be the room, seen again
# Of the frames. Of 403 usable clips, 67 of them no kit's, it was 0.03 at most but in one, where the
# masks do not show the arm at first; of two second persons whom the masks hardly show 0.18 and 0.2.
BESIDE = 0.1
BLOCK, ABOUT = 7, 9  # pixels: of a side of the room's pieces; those that near an arm are not asked
TOUCHED = 0.05  # of a piece
# Of the width. Of 61 usable made clips that were steadied it was 0.28 at most, of two pans and a
# zoom that had been steadied by too little 0.48 or more.
ROOM = 0.4


class Arms(NamedTuple):
    """What arms come in over the left, the right and the upper edge of a shot, and over no other
    than the lower one."""

    seen: float  # share of the frames in which the masks show one or more
    several: float  # share of the frames in which they show two beside each other
    enters: float  # where the largest comes in, 0 at the picture's left edge, 1 at its right; nan
    moves: bool  # whether something as large as an arm moves over an edge
    across: float  # share of the frames in which large things are at both side edges
    below: float = 0.0  # share of the frames in which one comes in over the lower edge alone
    beside: float = 0.0  # share of the frames in which another moves, see `beside`
    room: float = 0.0  # of what was steadied: by how much the room still moves, see `room`
    inside: float = 0.0  # share of the frames in which they show one that reaches to no edge

    @property
    def doubt(self) -> tuple[str, str] | None:
        """Why the shot may show no arm, one from the camera's side, a moving room, or several
        people, and what to film otherwise."""
        if self.seen < SEEN <= self.below:  # what one wears or holds and films with sees it so
            return (
                "the arm comes in over the lower edge, as from the camera, and hides what it is at",
                SIDE_ON,
            )
        # Masks may not show a sleeve; where there was no arm, they showed none inside either.
        if max(self.seen, self.inside) < SEEN and not self.moves:
            return "no arm is seen, nothing large that moves comes in from the edge", SIDE_ON
        if self.several < SEVERAL and self.room >= ROOM:
            return CAMERA
        if self.several >= SEVERAL or self.across >= OFTEN or self.beside >= BESIDE:
            return (
                "arms, or other large things, come in at two places, as of several people, or of "
                "one who fills the picture",
                "film one arm, without the body, and let nothing else move near the edges",
            )
        return None


def count(masks: np.ndarray, off: np.ndarray) -> Arms:
    """The arms in masks (n, h, w), and in what is `off` the room, (T, 84, 84) grey levels."""
    pieces = [list(_pieces(mask)) for mask in masks]
    found = _large([_coming_in(some) for some in pieces])
    lower = _large([_coming_in(_pieces(mask, lower=True)) for mask in masks])
    several = [any(b[0] - a[1] >= APART for a, b in pairwise(sorted(one))) for one in found]
    places = [max(one, key=lambda arm: arm[2])[3] for one in found if one]
    doors = _doors(off > MOVED)
    if not places:  # at its median place an arm looks like the room
        places = doors[np.isfinite(doors)].tolist()
    return Arms(
        seen=sum(map(bool, found)) / len(masks),
        several=sum(several) / len(masks),
        enters=float(np.median(places)) if places else np.nan,
        moves=_comes_in(off > FAINT),
        across=float((np.nan_to_num(np.ptp(doors, axis=1)) >= ACROSS).mean()),
        below=sum(map(bool, lower)) / len(masks),
        inside=sum(map(_inside, pieces)) / len(masks),
    )


def beside(masks: np.ndarray, off: np.ndarray, tip: np.ndarray, sure: np.ndarray) -> float:
    """The share of n frames in which one arm is whole, from over an edge to its tip, and a piece of
    another one moves apart from it. So a second person is seen by two faint witnesses.

    masks (n, h, w); off (n, 84, 84) grey levels; tip (n, 2): of the width and of the height; sure
    (n,): of the tip.
    """
    _, h, w = masks.shape
    first, seen = np.zeros((h, w), bool), 0
    for mask, differs, at, known in zip(masks, off > MOVED, tip, sure, strict=True):
        pieces, near = list(_pieces(mask)), _near(at, h, w) & (known >= TIP_SURE)
        arms = [one for one in pieces if one.whole and near[one.cells].any()]
        if not first.any():  # what is off the room there later on may be the room
            first = sum((one.cells for one in arms), first)
        moved = cv2.resize(differs.astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
        others = [one for one in pieces if first[one.cells].mean() < FIRST]
        seen += any(_moves_beside(arm, one, moved) for arm in arms for one in others)
    return seen / len(masks)


def room(masks: np.ndarray, off: np.ndarray) -> float:
    """Over which share of the width something is off the room that is no arm, the mean of n frames.
    Where a camera was steadied and it is much of it, the room itself still moves.

    masks (n, h, w); off (n, 84, 84) grey levels. A table or a body moves over the lower edge, so
    the lowest pixels are not asked.
    """
    shares = []
    for mask, differs in zip(masks, off, strict=True):
        arm = (cv2.resize(mask, (SMALL, SMALL)) > SURE).astype(np.uint8)
        arm = cv2.dilate(arm, np.ones((ABOUT, ABOUT)))
        moved, arms = (
            one.reshape(SMALL // BLOCK, BLOCK, -1, BLOCK).mean((1, 3))
            for one in (differs > MOVED, arm)
        )
        touched = (moved > TOUCHED) & (arms == 0)
        shares.append(touched[:-1].any(axis=0).mean())
    return float(np.mean(shares))


def _near(tip, h, w):
    """The cells (h, w) bool about a tip (2,)."""
    y, x = np.mgrid[:h, :w] + 0.5
    return np.hypot(x - w * tip[0], y - h * tip[1]) < AT_TIP


def _moves_beside(arm, other, moved):
    """Whether another piece, apart from an arm, moves, by how much each cell (h, w) has moved."""
    if max(other.left - arm.right, arm.left - other.right) < APART:
        return False
    mine, its = (moved[one.cells].mean() for one in (arm, other))
    hand = other.plain and not other.high  # its sleeve looks like the room, or is outside
    faint = other.comes and other.cells.sum() >= MOST  # a picture at the edge is less than one
    return its > MOVES and (hand or (faint and mine > MOVES))


def _inside(pieces):
    """Whether one of the pieces is a large arm that reaches to no edge from which it may come."""
    return any(one.large and not one.door.any() for one in pieces)


def _large(found):
    """The arms of each frame; none where not one of them all is large."""
    return found if max((arm[2] for one in found for arm in one), default=0) >= MOST else []


def _coming_in(pieces):
    """First and last column, cells, and place at the edge, 0 to 1, of each arm among the pieces of
    a mask that comes in."""
    return [
        (one.left, one.right, int(one.cells.sum()), _column(one.door))
        for one in pieces
        if one.plain and one.comes
    ]


def _column(cells):
    """The mean column of cells (h, w) bool, 0 at the left edge, 1 at the right."""
    width = cells.shape[1]
    return float(((np.nonzero(cells)[1] + 0.5) / width).mean())


class _Piece(NamedTuple):
    """What hangs together of a mask."""

    cells: np.ndarray  # (h, w) bool
    left: int  # its first column
    right: int  # the one behind its last
    door: np.ndarray  # (h, w) bool: its cells near the edges over which it may come in
    comes: bool  # whether it comes in over one and reaches in
    plain: bool  # whether it is surely an arm

    @property
    def high(self) -> bool:
        """Whether it is near the upper edge, as what hangs there."""
        return bool(self.cells[:NEAR].any())

    @property
    def whole(self) -> bool:
        """Whether it is all of an arm, if it has the tip."""
        return bool(self.comes and self.large)

    @property
    def large(self) -> bool:
        """Whether it is surely an arm, and as large as one."""
        return bool(self.plain and self.cells.sum() >= MOST)


def _pieces(mask, lower=False):
    """The pieces of a mask (h, w), but for the smallest. They may come in over the left, right or
    upper edge; lower: over the lower one alone."""
    h, w = mask.shape
    x, y = np.meshgrid(np.arange(w) + 0.5, np.arange(h) + 0.5)
    others = np.minimum(np.minimum(x, w - x), y)  # cells from the nearest edge
    inside = h - y if lower else others
    n, labels, stats, _ = cv2.connectedComponentsWithStats((mask > SURE).astype(np.uint8))
    for i in range(1, n):
        left, _, width, _, cells = stats[i].tolist()
        if cells < LEAST:
            continue
        piece = labels == i
        door = piece & (inside < NEAR)
        comes = bool(door.any() and inside[piece].max() >= REACHES * door.sum() / NEAR)
        comes &= not (lower and others[piece].min() < NEAR)
        yield _Piece(piece, left, left + width, door, comes, bool(mask[piece].max() >= PLAIN))


def _comes_in(moves):
    """Whether something that moves (T, 84, 84), as large as an arm, reaches over an edge of the
    picture: what an arm moves may be larger, and need not be at the edge."""
    _, stats = things(moves.sum(0) >= SOMETIMES)
    return any(area >= COVERS * SMALL**2 and at_edge(*box) for *box, area in stats.tolist())


def _doors(moves):
    """The outermost places (T, 2) at which large things that move (T, 84, 84) come in over the
    left, right and upper edge, 0 to 1 from left to right; nan where none does."""
    out = np.full((len(moves), 2), np.nan)
    for t, moved in enumerate(moves):
        labels, stats = things(moved)
        large = 1 + np.flatnonzero(stats[:, 4] >= LARGE * SMALL**2)
        inside = np.isin(labels, large)
        x = np.flatnonzero(inside[:EDGE].any(0)).tolist()
        rows = (inside[:, at].any(1).sum() for at in (slice(EDGE), slice(-EDGE, None)))
        x += [end for end, wide in zip((0, SMALL - 1), rows, strict=True) if wide >= FINGER]
        if x:
            out[t] = min(x) / (SMALL - 1), max(x) / (SMALL - 1)
    return out
