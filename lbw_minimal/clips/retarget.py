"""A person's clip laid into a task's scene: the way of the hand, as the scene's arm can go it.

In: the pixels of tip and object in a clip of any size and frame rate, with time stamps, and the
task's scene in its plane (x along the table, z up). Out: the way of the tip in metres, 25 times a
second, from the arm's own start. Nothing of this is in the paper, whose human and robot share one
table. It asks where things are, never what they look like.

    piece between cuts -> low-pass -> mirror -> affine fit -> contact -> approach -> pace
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from lbw_minimal.clips import pushing
from lbw_minimal.clips.lifting import check_lifted
from lbw_minimal.clips.paths import (
    FOUND,
    LEAST_WAY,
    REST,
    RESTS,
    STANDS,
    Tracks,
    Unusable,
    busiest_piece,
    check_tip,
    ends,
    interpolate,
    low_pass,
    never_moves,
    of_a_hand,
    progress,
    trusted,
    unsure,
)
from lbw_minimal.clips.pushing import Alike
from lbw_minimal.clips.used import left_out, sliver

FPS = 25  # steps a second of the motion, as in the tasks
CONTACT = 0.12  # of the object's way: by then it is pushed, whatever the tip's pixels say
ARRIVED = 0.99  # of its way
APPROACH = 0.6  # s, from the arm's start to where the clip's hand comes into reach
RUN_UP = 2.0  # s before a hit that are kept
# Of the picture's shorter side: what goes less far and is broken off was not done, and a hand
# that goes less far stirs beside its mark.
LITTLE = 0.1
LONGEST = 12.0  # s, the longest horizon of the tasks; only a hit cannot be hurried
STEEP = 1.0  # height over width of the way; steeper, and it is not seen from the side
CARRIED = 0.85  # of its way: a hand that goes along so far has not hit
STEEPEST = 0.5  # height over way, by which a hit comes down to its object
OUTSIDE = 0.02  # m out of the tip's box; until then the approach stands in for the clip
TOO_FAST = 1.5  # times what it may ask for: slowed down by more is worth a warning
HURRY = 0.8  # of the arm's top speed that a motion may ask for: the rest is for corrections


@dataclass(frozen=True)
class Scene:
    """A task's scene in its plane. Points are (x, z) in m; the object has to go along +x."""

    start: tuple[float, float]  # of the object, or of the tip where nothing is touched
    goal: tuple[float, float]  # where that has to get
    tip: tuple[float, float]  # of the arm, at its start
    low: tuple[float, float]  # lower corner of the box that the tip may be in
    high: tuple[float, float]  # upper corner
    step: float  # m, the farthest the tip's goal moves in 1/25 s along an axis
    contact: float | None = None  # m from the object's centre back to the tip that pushes it
    height: float = 0.0  # m, where the tip pushes

    @property
    def hit(self) -> bool:
        """Whether the tip cannot reach the goal: the object is hit, and goes on by itself."""
        return self.contact is not None and self.goal[0] - self.contact > self.high[0]


@dataclass(frozen=True)
class Motion:
    """A clip's motion in the scene, N steps of 1/25 s."""

    tip: np.ndarray  # (N, 2) m: x, z
    object: np.ndarray | None  # (N, 2) m: where the clip has the object; None: nothing is touched
    times: np.ndarray  # (N,) s: the moment of the clip that a step shows
    contact: int  # the step by which the object is pushed
    arrival: int  # the step at which it is there
    affine: np.ndarray  # (2, 3): (x, z) = affine @ (x, y, 1) of the clip's pixels
    mirrored: bool
    notes: list[str] = field(default_factory=list)  # what was done, a sentence each
    warnings: list[str] = field(default_factory=list)  # what may spoil the result


def lay(tracks: Tracks, scene: Scene, mirror: bool | None = None, alike: Alike = None) -> Motion:
    """The clip's motion in the scene; mirror: None leaves it to the clip.

    Raises Unusable if the clip does not show the task, or not so that it can be laid there.
    """
    notes, warnings, yours = list[str](), list[str](), {what for what, *_ in tracks.yours}
    touched = scene.contact is not None
    if not touched:
        tracks = of_a_hand(tracks, notes)
    whole, tracks = tracks, busiest_piece(tracks, touched, warnings)
    t = np.arange(tracks.times[0], tracks.times[-1] + 1e-9, 1 / FPS)
    tip = thing = low_pass(*trusted(tracks, "tip"), t)  # (N, 2) pixels
    if touched:
        if "object" not in yours:  # what was taken for it may be something else
            check_lifted(tracks)
            pushing.check_view(tracks)
        s, seen = trusted(tracks, "object")
        thing = low_pass(s, seen, t)
    else:
        check_tip(tracks)
    what, least = ("object", STANDS) if touched else ("hand", LITTLE)
    start, end = ends(thing, least * tracks.side, what)
    gone = float(np.linalg.norm(end - start))
    if pushing.gets_faster(thing):
        if gone < LITTLE * tracks.side:
            raise Unusable(
                f"the clip ends {gone:.0f} pixels on its way, while the {what} still gets faster",
                pushing.FILM_ON,
            )
        warnings.append(f"The clip ends while the {what} still gets faster: was it not done yet?")
    if gone < LEAST_WAY * tracks.side:
        raise never_moves(what, gone)
    if mirror is None:
        mirror = bool(end[0] < start[0])
        if mirror:
            notes.append("It goes to the left in the clip, and was mirrored.")
    way = progress(thing, start, end)  # (N,) from 0 to 1
    i, j = (int(np.argmax(way >= share)) for share in (CONTACT if touched else ARRIVED, ARRIVED))
    if touched and "object" not in yours:
        pushing.check_apart((tip - thing)[: j + 1], end - start, tracks.side)
    A = fit(start, end, scene, mirror)
    x = apply(A, tip)  # (N, 2) m
    if touched:
        warnings += pushing.check_way(tracks, tip, thing, way, (i, j), (start, end))
        pushing.check_hand(tracks, t[i : j + 1], thing[i : j + 1], end - start, alike)
        if not scene.hit:  # a hit thing may go far while it is a blur
            pushing.check_steps(seen, start, end)
        x, object_ = _push(x, way, scene, warnings)
    else:
        object_ = None
        x[j:] = x[j]
        _check_reach(x, scene)
    warnings += unsure(whole, "tip", t[0], t[i], t[i if scene.hit else j])
    first, last = _first_step(x, i, scene), j + 1 + round(REST * FPS)
    warnings += unsure(whole, "object", t[0], t[i], t[j]) if touched else sliver(t, tip, first, j)
    notes += [*left_out(t, first, last), *_rests(x[first : j + 1])]
    part = np.minimum(np.arange(first, last), len(t) - 1)  # a clip that ends sooner stands still
    x, object_ = np.clip(x, scene.low, scene.high)[part], None if object_ is None else object_[part]
    motion = Motion(x, object_, t[part], max(0, i - first), j - first, A, mirror, notes, warnings)
    return pace(approach(motion, scene), scene)


def fit(start: np.ndarray, end: np.ndarray, scene: Scene, mirror: bool) -> np.ndarray:
    """The affine map (2, 3) from pixels to metres that takes start and end to the scene's.

    Widths and heights are scaled alike. A way that rises or falls in the picture, because the
    camera turns aside or is not level, is laid down by a shear, which leaves upright what is. The
    way of a hand that touches nothing is turned, however it goes: nothing in it has to stay
    upright.
    Raises Unusable where an object's way is not one across the picture, or a way goes backwards.
    """
    (dx, dy), sign, touched = end - start, -1 if mirror else 1, scene.contact is not None
    if touched and abs(dy) > STEEP * abs(dx):
        raise pushing.steep("it", end - start)
    if sign * dx < 0:
        raise Unusable(
            "it goes to the left in the picture, once mirrored or not as was asked",
            "leave out --mirror or --no-mirror",
        )
    x, z = np.subtract(scene.goal, scene.start)
    if touched:
        scale = x / abs(dx)  # m per pixel
        A = np.array([[sign * scale, 0], [(z + scale * dy) / dx, -scale]])
    else:
        turn = complex(x, z) / complex(abs(dx), -dy)  # m per pixel
        A = np.array([[sign * turn.real, turn.imag], [sign * turn.imag, -turn.real]])
    return np.column_stack([A, scene.start - A @ start])


def apply(A: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (N, 2) under the affine map A (2, 3)."""
    return points @ A[:, :2].T + A[:, 2]


def _push(x, way, scene, warnings):
    """The tip (N, 2) m made to push the object, and the object's path (N, 2) m.

    The tip's pixels are those of a finger, a knuckle or a tool, and the object's size is its own:
    so the whole path is moved until tip and object touch where they have to. Before that, and
    after, the tip stays behind the object.
    """
    start, goal = np.array(scene.start), np.array(scene.goal)
    object_ = start + way[:, None] * (goal - start)
    behind = object_[:, 0] - scene.contact
    i, j = int(np.argmax(way >= CONTACT)), int(np.argmax(way >= ARRIVED))
    x = x + (behind[i], scene.height) - x[i]
    if scene.hit:
        # A run-up comes down behind the object: a tip from above would slide over it.
        gap = np.maximum(0, behind[:i] - x[:i, 0])
        x[:i, 1] = np.minimum(x[:i, 1], scene.height + STEEPEST * gap)
        # Until the object is fastest the hand drives it, whatever is seen of a hand so fast.
        k = i + int(np.argmax(np.diff(behind[i:])))
        x[i:k, 0] = behind[i:k]
        x[k:, 0] = np.maximum.accumulate(x[k:, 0] + behind[k] - x[k, 0])
        _limit_hit(x, i, scene, warnings)
        gone = i + int(np.argmax(behind[i:] - x[i:, 0] > OUTSIDE))
        x[i : (gone if gone > i else len(x)), 1] = scene.height
    else:
        x[i : j + 1, 0] = behind[i : j + 1]
        x[i:, 1] = scene.height
        x[j:, 0] = x[j, 0]
    x[:, 0] = np.minimum(x[:, 0], behind)
    return x, object_


def _limit_hit(x, i, scene, warnings):
    """Shorten the way of a hit from step i on, so that it ends within the arm's reach."""
    way = x[i:, 0].max() - x[i, 0]
    if way > CARRIED * (scene.goal[0] - scene.start[0]):
        raise Unusable(
            "the hand goes along with the object to the end, which so is pushed and not hit",
            "give it a hit, and let it slide on alone",
        )
    room = scene.high[0] - x[i, 0]
    x[i:, 0] = x[i, 0] + (x[i:, 0] - x[i, 0]) * min(1, room / max(way, 1e-9))
    if way > 1.1 * room:
        warnings.append(
            f"The hand goes along with the object for {100 * way:.0f} cm, and the scene's arm can "
            f"do so for {100 * room:.0f}: the hit was shortened."
        )


def _check_reach(x, scene):
    """Raise Unusable where most of a hand's way (N, 2) m is out of the box of the scene's tip."""
    outside = (np.abs(x - np.clip(x, scene.low, scene.high)) > OUTSIDE).any(1)
    if outside.mean() > 1 - FOUND:
        raise Unusable(
            f"{outside.mean():.0%} of the hand's way would be out of the scene's reach",
            "move to the mark by a straight way, from the side and a little above it",
        )


def _first_step(x, i, scene):
    """The step from which on the clip is followed: the hand is in reach, and soon moves.

    i: the step of contact, which is followed in any case.
    """
    if i == 0:
        return 0
    outside = (np.abs(x - np.clip(x, scene.low, scene.high)) > OUTSIDE).any(1)[:i]
    first = int(np.flatnonzero(outside)[-1]) + 1 if outside.any() else 0
    speed = np.linalg.norm(np.diff(x[first : i + 1], axis=0), axis=1)
    if len(speed) and speed.max() > 0:
        first += max(0, int(np.argmax(speed > RESTS * speed.max())) - round(REST * FPS))
    return max(first, i - round(RUN_UP * FPS)) if scene.hit else first


def _rests(x):
    """A sentence for the pauses on the way, which are kept, if there are any."""
    speed = np.linalg.norm(np.diff(x, axis=0), axis=1)
    rests = int((speed < RESTS * speed.max()).sum()) / FPS if len(speed) else 0
    return [f"The hand rests for {rests:.1f} s in all on its way; this is kept."] * (rests > REST)


def approach(motion: Motion, scene: Scene) -> Motion:
    """The motion with a way before it, from the arm's start, along a minimum-jerk profile
    (Flash and Hogan 1985) of `APPROACH` seconds. There is none where the motion begins there."""
    start, first = np.array(scene.tip), motion.tip[0]
    if np.linalg.norm(first - start) < 0.01:
        return motion
    s = np.arange(round(APPROACH * FPS)) / round(APPROACH * FPS)
    s = s**3 * (10 - 15 * s + 6 * s * s)
    still = np.zeros(len(s), int)  # the clip waits
    object_ = motion.object
    return replace(
        motion,
        tip=np.concatenate([start + s[:, None] * (first - start), motion.tip]),
        object=None if object_ is None else np.concatenate([object_[still], object_]),
        times=np.concatenate([motion.times[still], motion.times]),
        contact=motion.contact + len(s),
        arrival=motion.arrival + len(s),
    )


def pace(motion: Motion, scene: Scene) -> Motion:
    """The motion as fast as the scene's arm can follow: slowed down where it is faster, and hurried
    as a whole where it is longer than `LONGEST` seconds and is no hit."""
    steps = np.abs(np.diff(motion.tip, axis=0)).max(axis=1)  # (N - 1,) m along an axis
    slow = np.maximum(1, steps / (HURRY * scene.step))
    n, longest = 1 + slow.sum(), round(LONGEST * FPS)
    warnings = list(motion.warnings)
    if slow.max(initial=1) > TOO_FAST:
        warnings.append(
            f"The hand is up to {HURRY * slow.max():.1f} times as fast as the scene's arm can be, "
            "and was slowed down there."
        )
    if n > longest and not scene.hit:
        warnings.append(f"{n / FPS:.0f} s are long; the motion was hurried to {LONGEST:.0f} s.")
        slow *= longest / n
    return stretched(replace(motion, warnings=warnings), slow)


def stretched(motion: Motion, times: np.ndarray) -> Motion:
    """The motion with each of its N - 1 steps taking so many times as long."""
    clock = np.concatenate([[0], np.cumsum(times)])
    at = np.interp(np.arange(int(np.ceil(clock[-1])) + 1), clock, np.arange(len(clock)))
    along = np.arange(len(clock))
    return replace(
        motion,
        tip=interpolate(along, motion.tip, at),
        object=None if motion.object is None else interpolate(along, motion.object, at),
        times=np.interp(at, along, motion.times),
        contact=round(clock[motion.contact]),
        arrival=round(clock[motion.arrival]),
    )
