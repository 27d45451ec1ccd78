"""A motion laid into a task's scene, done there by the simulated human in front of its camera.

In: a `Motion` of the tip, from a person's clip. Out: a film like the human videos of the kit, and
what was changed so that the object ends where it has to. Contact is the simulator's: how far an
object goes depends on friction and on how the arm yields. So the motion is rehearsed without
pictures, and one number of it is set by where the object ends: how far a push goes on, or how fast
a hit is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from lbw_minimal.clips.paths import Unusable
from lbw_minimal.clips.retarget import FPS, Motion, stretched
from tasks.world.env import TaskEnv
from tasks.world.recording import Recording, film

TRIES = 6  # rehearsals of a push; it takes one or two
SWINGS = 12  # of a hit; it takes three to eight
CLOSE = 0.01  # m from the goal, a fifth of what counts as success
COAST = 1.6  # s after a hit, in which a puck slides and comes to rest
SPEEDS = 0.25, 4.0  # times the clip's speed at which a hit may be done
# s for which a hand may go along with what it hits: with 0.3 s made hits were done again, whatever
# their way, with 1 s mostly not.
ALONG = 0.5
ODD = 1.5  # times: a hit that has to be so much faster or slower is worth a warning
SLOWER = 1.5  # times as slow is a push done again that failed, as when a mug tips over


@dataclass(frozen=True)
class Reenactment:
    """A motion as it was done in the simulator."""

    frames: np.ndarray  # (N, 84, 84, 3) uint8
    pixels: np.ndarray  # (N, 4) true pixels of tip and object, for plots and tests
    recording: Recording
    motion: Motion  # as it was done in the end, N steps or, with a hit, fewer
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def reenact(env: TaskEnv, motion: Motion) -> Reenactment:
    """Let `env`, a task's environment with the human's arm, do the motion, and film it.

    Raises Unusable if the task is not done at the end.
    """
    env.reset(seed=0)
    notes: list[str] = []
    warnings: list[str] = []
    further, along = 0.0, 0.0
    if motion.object is not None and env.scene().hit:
        along = motion.tip[motion.contact :, 0].argmax() / FPS  # s
        motion = _timed_hit(env, motion, notes, warnings)
    elif motion.object is not None:
        further, done = _measured_push(env, motion)
        if not done:
            motion = stretched(motion, np.full(len(motion.tip) - 1, SLOWER))
            further, done = _measured_push(env, motion)
            warnings.append(f"Done at the clip's pace it fails: it is done {SLOWER} times slower.")
        if abs(further) > CLOSE:
            way = "farther" if further > 0 else "less far"
            notes.append(
                f"The simulated hand aims {100 * abs(further):.1f} cm {way} than the clip's hand "
                "went, so that the object stops at the goal."
            )
    frames, pixels, recording = film(env, 0, commands(env, motion, further))
    if not recording.success[-1]:
        off = 100 * np.linalg.norm(recording.states[-1, 3:6] - recording.states[-1, 6:9])
        if along > ALONG:
            raise Unusable(
                f"the hand goes along with the object for {along:.1f} s, which so is pushed and "
                f"not hit: done again, it stops {off:.0f} cm from the goal",
                "give it one quick hit, and let it slide on alone",
            )
        raise Unusable(
            f"done again in the task's scene, the motion ends {off:.0f} cm from the goal",
            "film one steady motion from the start to the goal",
        )
    return Reenactment(frames, pixels, recording, motion, notes, warnings)


def commands(env: TaskEnv, motion: Motion, further: float = 0.0) -> Iterator[np.ndarray]:
    """Yield the actions that lead the goal of the tip along the motion, and hold it after a hit.

    further: m that are added to a push, little by little from contact to arrival.
    """
    along = [motion.contact, max(motion.contact + 1, motion.arrival)]
    more = further * np.interp(np.arange(len(motion.tip)), along, [0, 1])
    for (x, z), lead in zip(motion.tip[1:], more[1:], strict=True):
        wanted = np.array([x + lead, 0, z])
        yield np.clip((wanted - env.arm.goal) / env.STEP, -1, 1).astype(np.float32)
    for _ in range(round(COAST * FPS) if env.scene().hit else 0):
        yield np.zeros(3, np.float32)


def _rehearse(env, motion, further=0.0):
    """What is recorded of the motion, without pictures."""
    seen, env.observation = env.observation, "state"
    try:
        return film(env, 0, commands(env, motion, further))[2]
    finally:
        env.observation = seen


def _measured_push(env, motion):
    """By how much (m) a push has to go on for the object to end at the goal, and if it does."""
    further, tried = 0.0, []
    for _ in range(TRIES):
        end = _rehearse(env, motion, further)
        miss = float(end.states[-1, 6] - end.states[-1, 3])
        tried.append((not end.success[-1], abs(miss), further))
        if abs(miss) < CLOSE or (len(tried) > 1 and abs(miss) > 0.9 * tried[-2][1]):
            break  # it is there, or comes no nearer
        further += miss
    failed, _, further = min(tried)
    return further, not failed


def _timed_hit(env, motion, notes, warnings):
    """The motion with its hit as fast as the object needs that is to rest at the goal.

    A hit that is too weak and one that is too strong enclose the next guess. Until there are both
    it is in proportion: a puck slides as far as the square of its speed, but the arm yields.
    """
    factor, weak, strong, tried = 1.0, 0.0, np.inf, []
    for _ in range(SWINGS):
        end = _rehearse(env, _faster(motion, factor))
        start, x, goal = end.states[0, 3], end.states[-1, 3], end.states[-1, 6]
        tried.append((abs(float(goal - x)), factor))
        if tried[-1][0] < CLOSE:
            break
        weak, strong = (factor, strong) if x < goal else (weak, factor)
        factor /= max(float((x - start) / (goal - start)), 0.1)
        if weak > 0 and strong < np.inf:
            factor = float(np.sqrt(weak * strong))
        factor = float(np.clip(factor, *SPEEDS))
        if factor in (weak, strong):
            break
    factor = min(tried)[1]
    text = f"The hit is done at {factor:.2f} times its speed in the clip, so that the object rests "
    if 1 / ODD < factor < ODD:
        notes.append(text + "at the goal.")
    else:
        kind = "weak" if factor > 1 else "strong"
        warnings.append(f"{text}at the goal: as filmed it is too {kind}.")
    return _faster(motion, factor)


def _faster(motion, factor):
    """The motion with its hit, from the run-up's start to the hand's stop, so much faster."""
    x = motion.tip[:, 0]
    speed = np.diff(x)
    slow = np.flatnonzero(speed[: motion.contact] < 0.1 * speed.max())
    first = int(slow[-1]) + 1 if len(slow) else 0
    last = motion.contact + int(np.argmax(x[motion.contact :]))
    times = np.ones(len(speed))
    times[first:last] = 1 / factor
    return stretched(motion, times)
