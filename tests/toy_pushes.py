"""A push in a scene of its own whose truth is known, as a camera of known place would see it."""

import numpy as np

from lbw_minimal.clips.paths import Tracks, interpolate
from lbw_minimal.clips.retarget import Scene

SCENE = Scene(
    start=(0.50, 0.025), goal=(0.65, 0.025), tip=(0.45, 0.12), low=(0.42, 0.015),
    high=(0.74, 0.17), step=0.03, contact=0.04, height=0.02,
)  # fmt: skip
HIT = Scene(
    start=(0.53, 0.02), goal=(0.94, 0.02), tip=(0.46, 0.15), low=(0.42, 0.015),
    high=(0.64, 0.28), step=0.04, contact=0.04, height=0.02,
)  # fmt: skip
SIDE = 480  # pixels, of the pictures
CAMERA = np.array([[900.0, 0.0, -300.0], [0.0, -900.0, 400.0]])  # m to pixels


def jerk(s):
    """The minimum-jerk profile from 0 to 1 over s from 0 to 1."""
    s = np.clip(s, 0, 1)
    return s**3 * (10 - 15 * s + 6 * s * s)


def push(t, rest=0.0):
    """Tip and object (N, 2) m at t s: the tip comes down until 0.8 s, pushes from 1.0 to 2.0 s."""
    t = t - np.clip(t - 1.5, 0, rest)  # a rest half of the way
    down, along = jerk(t / 0.8)[:, None], 0.15 * jerk(t - 1)
    tip = np.array([0.43, 0.12]) + down * (np.array([0.46, 0.02]) - [0.43, 0.12])
    tip[:, 0] += along
    return tip, np.stack([0.50 + along, np.full(len(t), 0.025)], 1)


def hit(t, speed=0.8):
    """Tip and object at t s: a stroke of 12 cm at about that speed (m/s) meets a puck at 1 s."""
    s = np.clip((t - 1) * speed / 0.06, -1, 1)
    tip = np.stack([0.49 + 0.06 * np.sin(s * np.pi / 2), np.full(len(t), 0.02)], 1)
    after = np.maximum(t - 1, 0)
    way = 0.41 * (1 - np.exp(-after * speed * np.pi / 2 / 0.41))
    return tip, np.stack([0.53 + way, np.full(len(t), 0.02)], 1)


def seen(world, times, camera=CAMERA, noise=0.0, cuts=()):
    """The tracks of a clip with those time stamps; camera (2, 3): m to pixels."""
    tip, thing = (points @ camera[:, :2].T + camera[:, 2] for points in world)
    rng, sure = np.random.default_rng(0), np.ones(len(times))
    tip, thing = (points + noise * rng.normal(size=points.shape) for points in (tip, thing))
    return Tracks(times, tip, thing, sure, sure, SIDE, tuple(cuts))


def clip(fps=30.0, last=2.6, **options):
    """The push as a clip of `fps` frames a second."""
    t = np.arange(0, last, 1 / fps)
    return seen(push(t), t, **options)


def at(motion, world, seconds):
    """How far (m) the motion's tip is from that of `world` at those moments of the clip."""
    true, _ = world(seconds)
    order = np.argsort(motion.times, kind="stable")
    return np.abs(interpolate(motion.times[order], motion.tip[order], seconds) - true)
