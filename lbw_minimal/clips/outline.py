"""Where the tip of a reaching hand is, told by its outline alone. Not from the paper.

The detector knows arms as they were drawn; of some real hands it is never sure, and then it may
take a thing at the mark for the tip. But where a hand touches nothing, what differs from the
picture before it came is the arm, and who it belongs to. It comes in over an edge, and its tip is
what is farthest from that edge.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lbw_minimal.clips.detector import Found
from lbw_minimal.clips.footage import EDGE, ENDS, LARGE, at_edge, things
from lbw_minimal.clips.motion import MOVED, SMALL, high_pass, small, some
from lbw_minimal.clips.paths import SURE, TIP_FOUND, extent
from lbw_minimal.clips.retarget import LITTLE

FAR = 0.98  # quantile: what is farther is the tip, and not a pixel of noise beyond it
RARELY = 0.5  # of the frames in which an arm is inside: a tip that is sure in fewer is not believed
BESIDE = 4  # pixels of 84: a tip is at a hand that is so near


def reaching(frames: np.ndarray, found: Found) -> Found:
    """Found in the frames (T, H, W, 3) uint8 of a hand that touches nothing, with the tip of its
    outline where the one that was found is rarely sure, or ends near where it began. One that is
    found late has the way by which it came from its outline, and none is sure before a hand is
    there."""
    passed, size = _passed(frames), frames.shape[1:3]
    tip, inside = _far_end(passed, size)
    if inside.mean() < TIP_FOUND:
        return found
    came = int(inside.argmax())
    lies = _as_ever(passed, found.tip / size[::-1]) & (np.arange(len(passed)) < came)
    found = replace(found, tip_sure=np.where(lies, 0, found.tip_sure))
    sure, least = found.tip_sure >= SURE, LITTLE * min(size)
    rarely = (sure & inside).sum() < RARELY * inside.sum()
    rests = _gone(found.tip[sure]) < least < extent(tip[inside])
    if not (rarely or rests):
        return _from_where_it_came(found, tip, inside)
    return replace(found, tip=tip, tip_sure=inside.astype(np.float32))


def _as_ever(passed, places):
    """In which of the pictures (T, 84, 84) nothing about a place (T, 2), in shares of the picture,
    differs from what is there at first, nor from what is there mostly."""
    before, mostly = _at_first(passed), np.median(some(passed), axis=0)
    out = np.zeros(len(passed), bool)
    for t, (x, y) in enumerate(np.clip(SMALL * places, 0, SMALL - 1).astype(int)):
        at = np.s_[max(0, y - BESIDE) : y + BESIDE + 1, max(0, x - BESIDE) : x + BESIDE + 1]
        out[t] = np.abs(passed[t][at] - [before[at], mostly[at]]).max() <= MOVED
    return out


def _from_where_it_came(found, tip, inside):
    """Found, led on from the outline's tip (T, 2) where that has come inside (T,) and is not yet
    sure. Nothing is sure before that: what was found there is no hand."""
    came = int(inside.argmax())
    late = int((inside & (found.tip_sure >= SURE)).argmax())
    if late == came:
        return found
    path, sure = found.tip.copy(), found.tip_sure.copy()
    nearer = np.linspace(0, 1, late - came, endpoint=False)[:, None]
    path[came:late] = tip[came:late] + nearer * (found.tip[late] - tip[late])
    sure[:came], sure[came:late] = 0, inside[came:late]
    return replace(found, tip=path, tip_sure=sure)


def _gone(path):
    """How far, in pixels, a path (n, 2) leads from its first to its last quarter; 0 if n < 4."""
    few = len(path) // 4
    return np.linalg.norm(np.median(path[:few], 0) - np.median(path[-few:], 0)) if few else 0.0


def far_end(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The tip (T, 2), in pixels, of what has come into the frames (T, H, W, 3) uint8 of a camera
    that stands, and where (T,) bool that is seen: not where nothing has come in yet, or where it
    reaches across all the picture."""
    return _far_end(_passed(frames), frames.shape[1:3])


def _far_end(passed, size):
    before = _at_first(passed)
    inside = [_arm(np.abs(one - before) > MOVED) for one in passed]
    side = _side(inside)
    tip, seen = np.zeros((len(passed), 2)), np.zeros(len(passed), bool)
    scale = np.array(size[::-1]) / SMALL
    for t, arm in enumerate(inside):
        if arm.any():
            y, x = np.nonzero(arm)
            depth = (x, SMALL - 1 - x, y, SMALL - 1 - y)[side]
            far = depth >= np.quantile(depth, FAR)
            tip[t] = scale * (np.median([x[far], y[far]], axis=1) + 0.5)
            seen[t] = depth.max() < SMALL - EDGE
    return tip, seen


def _passed(frames):
    return high_pass(np.stack([small(frame) for frame in frames]))


def _at_first(passed):
    """What the first of the pictures (T, 84, 84) show, (84, 84)."""
    return np.median(passed[: max(1, len(passed) // ENDS)], axis=0)


def _arm(moved):
    """The pixels that moved (84, 84) of the largest thing that comes in over an edge, or none."""
    labels, stats = things(moved)
    area = np.array([area * at_edge(*box) for *box, area in stats.tolist()])
    if area.max(initial=0) < LARGE * SMALL**2:
        return np.zeros_like(moved)
    return moved & (labels == 1 + area.argmax())


def _side(inside):
    """Over which edge an arm, its pixels (84, 84) in each frame, comes in with most of them: 0 the
    left, 1 the right, 2 the upper, 3 the lower one."""
    edges = np.s_[:, :EDGE], np.s_[:, -EDGE:], np.s_[:EDGE], np.s_[-EDGE:]
    return int(np.sum([[arm[edge].sum() for edge in edges] for arm in inside], axis=0).argmax())
