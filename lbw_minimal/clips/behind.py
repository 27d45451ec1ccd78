"""Whether the tip that was found is the object, and then where the hand is. Not from the paper.

A hand that goes along with a thing looks like one with it, and the detector, which looks at single
frames, then takes the thing for the end of the arm. But a hand that pushes is behind what it
pushes. Whether a motion can be laid is told by what was found: a tip that is put elsewhere is no
witness. What is done again is the motion with the tips put behind.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lbw_minimal.clips.paths import Tracks, Unusable, low_pass, trusted
from lbw_minimal.clips.retarget import Motion, Scene, lay

# Shares of the picture's width. Of 29 made films of pushes and drawers the tip is 0.016 to 0.10
# behind the object's middle, and at most 0.025 above or below it.
LEAST = 0.02  # a tip less far behind is on the object, or ahead of it
BEHIND = 0.045  # how far a tip is put behind: other frames tell no better, and may be wrong too
NEAR = 0.05  # of an object at rest: a hand that is farther off may be anywhere
MOSTLY = 0.5  # of the frames on its way: more rarely it is a glitch


def behind(
    tracks: Tracks, motion: Motion, scene: Scene, mirror: bool | None = None
) -> tuple[Tracks, Motion]:
    """The tracks with no tip on the object before that is there, and the motion as these have it,
    with a warning if one was there most of the time.

    motion: as `lay` has made it of the tracks. Both stay as they are where nothing is touched,
    where the object is hit and goes on alone, and where the motion could not be laid any more.
    """
    if scene.contact is None or scene.hit:
        return tracks, motion
    touch, there = motion.times[[motion.contact, motion.arrival]]
    try:
        put, share = put_behind(tracks, touch, there)
        motion = lay(put, scene, mirror)
    except Unusable:
        return tracks, motion
    if share > MOSTLY:
        motion.warnings.append(
            "The tip was found on the object while that moves, and was put behind it: look at the "
            f"pictures from {touch:.1f} to {there:.1f} s."
        )
    return put, motion


def put_behind(tracks: Tracks, touch: float, there: float) -> tuple[Tracks, float]:
    """The tracks with each tip on the object, or ahead of it, put behind it, and in what share of
    the frames on its way one was; it moves from `touch` to `there`, s.

    A tip found on the object at rest is put between those that were found elsewhere.
    """
    t, cuts = tracks.times, np.array(tracks.cuts, int)
    first = max([0, *cuts[t[cuts] <= touch].tolist()])
    last = int(np.searchsorted(t, there, side="right"))
    thing = low_pass(*trusted(tracks.part(first, last), "object"), t[first:last])
    tip, moves = tracks.tip[first:last].copy(), t[first:last] >= touch
    way = thing[-1] - thing[moves.argmax()]
    way = way / max(np.linalg.norm(way), 1e-9)
    width = tracks.width or tracks.side
    off = (tip - thing) / width  # (n, 2)
    on = (off @ way > -LEAST) & (moves | (np.linalg.norm(off, axis=1) < NEAR))
    share = float(on[moves].mean())
    if share > MOSTLY:  # beside it the dot is on its corner or shadow, and not on the hand
        on |= moves
    tip[on & moves] = (thing - width * BEHIND * way)[on & moves]
    lost, kept = np.flatnonzero(on & ~moves), np.flatnonzero(moves | ~on)
    for axis in (0, 1):
        tip[lost, axis] = np.interp(lost, kept, tip[kept, axis])
    path = tracks.tip.copy()
    path[first:last] = tip
    return replace(tracks, tip=path), share
