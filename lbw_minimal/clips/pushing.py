"""Whether the paths of tip and object in a clip are those of a push, as the scenes' arm can do it.

In: paths in pixels, 25 times a second. A push is told by what holds for any camera: the object goes
away from the arm, it is reached before it goes, the hand stays behind it, and the table is level.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lbw_minimal.clips.paths import (
    FOUND,
    LEAST_WAY,
    RESTS,
    SIDE_ON,
    SURE,
    Tracks,
    Unusable,
    extent,
    interpolate,
    median3,
)

# How much the object looks like itself between two times, in s, 0 to 1, see `hiding.alike`; None
# where nobody can say.
Alike = Callable[[float, float], float] | None

FILM_ON = "film on until all is done and rests"
LIFTED = 0.2  # of its way: what leaves the straight line by more was picked up
AHEAD = 0.25  # of its way: a tip so far in front of the object does not push it
# Of its way, in the middle: where fingers are about a thing their tip was found up to 0.16 ahead of
# it, and where an arm hides it mostly 0.2 to 0.5.
HIDES = 0.18
# Correlation of a thing on its way with how it looked before, as `hiding.alike` has it: what looks
# so much like itself is in sight, wherever the tip was found. Of a real cube among fingers it was
# 0.92 or more, of hidden things mostly 0.5 or less, and 0.75 of one that was seen in part.
IN_SIGHT = 0.7
SIDEWAYS = 0.25  # of the width: an arm that comes in farther inside comes from above
# Of the width: an arm that comes in so far ahead of its hand, as the object goes, pulls with it. Of
# usable clips it was 0.06 at most, of two in which a hand hooks the object 0.18 and 0.38.
PULLS = 0.12
GLUED = 0.25  # of its way: a hand that comes to an object comes nearer by more
COMES_DOWN = 0.25  # of its way: a table and a camera are not so far out of level
# Of the picture's shorter side: what goes down steeply and is never farther from the tip is the
# hand. Of hands it was 0.06 at most, of things 0.17 or more.
AT_HAND = 0.1
# Of its way, between two frames in turn in which it is surely seen: a thing that is pushed goes by
# at most 0.48, and a dot that jumps from one hand to the other by 0.7 to 1.
LEAP = 0.6
# Of the picture's shorter side: of made hands that go steeply where nothing moves, 0.24 at most; of
# those that push in front of the camera, or behind it, 0.39 or more.
LONG = 0.3
# Height over width of such a way. Hands seen from the side had up to 1.1, but for one; made ones
# from the front or from straight above had 2.6 and more.
STEEP_HAND = 1.5
STRIDE = 4  # steps, over which a speed is taken
FASTEST = 0.95  # of the highest speed: the rest is noise


def check_way(
    tracks: Tracks,
    tip: np.ndarray,
    thing: np.ndarray,
    way: np.ndarray,
    steps: tuple[int, int],
    ends: tuple[np.ndarray, np.ndarray],
) -> list[str]:
    """Raise Unusable where the object is not pushed: the scenes' arm can only push. Returns a
    warning where it is pushed only by a tip that the user placed.

    tracks: of the shot, which say where the arm comes in; tip, thing (N, 2) pixels; way (N,): how
    much of its way the object has gone, 0 to 1; steps: when it is touched, and there; ends: where
    its way begins and ends.
    """
    (i, j), (start, end), yours = steps, ends, {what for what, *_ in tracks.yours}
    if i == len(way) - 1:
        raise Unusable("the clip ends as the object begins to move", FILM_ON)
    along = end - start
    length = np.linalg.norm(along)
    door = (tracks.enters * tracks.width - tip[i, 0]) * np.sign(along[0])  # nan: no arm was seen
    warnings = []
    if tracks.width and door > PULLS * tracks.width:
        pulls = "the object comes towards the arm, which so pulls it"
        # A hand may hook a thing, so its tip says little; one that the user placed pushes.
        if "tip" not in yours:
            raise Unusable(pulls, "push it away from the arm, with one hand, which is behind it")
        said = f"{pulls.capitalize()}: it is pushed all the same"
        warnings.append(f"{said}, because you placed the tip.")
    aside = (thing[i : j + 1] - start) @ (np.array([-along[1], along[0]]) / length**2)
    if np.abs(aside).max() > LIFTED:
        raise Unusable(
            f"the object leaves its straight way by {np.abs(aside).max():.0%} of its length",
            "push it in a straight line, without lifting it",
        )
    if tracks.enters < SIDEWAYS or tracks.enters > 1 - SIDEWAYS:
        return warnings
    ahead = (tip - start) @ along / length**2 - way  # (N,) of the way; the tip pushes from behind
    came = np.median(ahead[: max(1, i // 2)]) > AHEAD and ahead[i] > -RESTS
    if came or np.median(ahead[i : j + 1]) > AHEAD:
        raise Unusable(
            "the object comes towards the arm, or the hand is in front of it",
            "push it away from the arm, with one hand, which is behind it",
        )
    return warnings


def check_view(tracks: Tracks) -> None:
    """Raise Unusable where no object is seen to move, and the hand goes a long way up or down the
    picture: then it takes the object along in front of the camera or behind it, or lifts it. A tip
    that leaps is no hand that goes."""
    sure = tracks.object_sure >= SURE
    if sure.mean() >= FOUND and extent(tracks.object[sure]) >= LEAST_WAY * tracks.side:
        return
    tip = median3(tracks.tip[tracks.tip_sure >= SURE])
    far = tip[np.linalg.norm(tip - tip[0], axis=1).argmax()] - tip[0]
    leap = np.linalg.norm(np.diff(tip, axis=0), axis=1).max(initial=0)
    long = max(LONG * tracks.side, STEEP_HAND * abs(far[0]))
    if abs(far[1]) > long and leap < LEAP * np.linalg.norm(far):
        raise steep("the hand", far)


def steep(what: str, way: np.ndarray) -> Unusable:
    """The error for a way (2,) pixels of the hand or the object, `what`, that is not one across the
    picture."""
    return Unusable(
        f"{what} goes {abs(way[1]):.0f} pixels up or down and {abs(way[0]):.0f} across",
        "lift nothing, and film from the side, at the height of the table, so that it goes across "
        "the picture",
    )


def check_apart(apart: np.ndarray, along: np.ndarray, side: int) -> None:
    """Raise Unusable where the object goes with the hand from the start, and comes down with it.

    apart (n, 2) pixels: from the object to the tip, until the object is there; along (2,): its way;
    side: of the picture, the shorter one.
    """
    if is_hand(apart, along, side):
        raise Unusable(
            "the object never moves: what goes with the hand from the start, and comes down with "
            "it, is the hand",
            "film the task being done, with an object that is seen before the hand gets to it",
        )


def is_hand(apart: np.ndarray, along: np.ndarray, side: int) -> bool:
    """Whether what goes along (2,), apart (n, 2) pixels from the tip, is a piece of the hand: it
    stays so far from the tip, or near it, and comes down."""
    length = np.linalg.norm(along)
    glued = np.linalg.norm(np.ptp(apart, axis=0)) < GLUED * length
    at_hand = np.linalg.norm(apart, axis=1).max() < AT_HAND * side and along[1] > abs(along[0])
    return bool((glued or at_hand) and along[1] > COMES_DOWN * length)


def check_hand(
    tracks: Tracks,
    t: np.ndarray,
    thing: np.ndarray,
    along: np.ndarray,
    alike: Alike = None,
) -> None:
    """Raise Unusable where the arm hides the object: while it moves the tip is never surely seen,
    or is in front of it, and the object does not look like itself.

    t (N,) s, thing (N, 2): the object's pixels from the touch until it is there; along (2,): its
    way.
    """
    tip = interpolate(tracks.times, tracks.tip, t)
    sure = np.interp(t, tracks.times, tracks.tip_sure)
    if sure.max() < SURE:
        raise Unusable(
            "the tip of the hand is not surely seen while the object moves, and so is hidden or "
            "out of the picture",
            SIDE_ON,
        )
    ahead = (tip - thing) @ along / (along @ along)  # (N,) of the way; the tip pushes from behind
    order = np.argsort(ahead)
    counted = np.cumsum(sure[order])  # where a tip is hardly seen, its place counts little
    before = ahead[order][np.searchsorted(counted, counted[-1] / 2)] > HIDES
    if before and (alike is None or alike(t[0], t[-1]) < IN_SIGHT):
        raise Unusable(
            "the arm is between the object and the camera, and hides it",
            "push it from behind, with the hand between it and the edge of the picture",
        )


def check_steps(seen: np.ndarray, start: np.ndarray, end: np.ndarray) -> None:
    """Raise Unusable where the object leaps: what is seen before and after is not one thing.

    seen (n, 2): its pixels in the frames in which it is surely seen; start, end (2,): of its way.
    """
    along = end - start
    gone = (seen - start) @ along / (along @ along)  # (n,) of its way
    there = int(gone.argmax())
    leap = float(np.abs(np.diff(gone[: there + 1])).max(initial=0))
    if leap > LEAP:
        raise Unusable(
            f"the object leaps {min(1, leap):.0%} of its way between two pictures in which it is "
            "surely seen, and may be two things",
            "film one arm from the side, and the object in sight on all its way",
        )


def gets_faster(path: np.ndarray) -> bool:
    """Whether a path (N, 2) ends at its highest speed, as one does that is broken off."""
    steps = np.linalg.norm(path[STRIDE:] - path[:-STRIDE], axis=1)
    return bool(len(steps) and steps[-1] > FASTEST * steps.max())
