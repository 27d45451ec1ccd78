"""Notebook 7, slide: how hard to hit."""

import numpy as np

from tests.grade.exercise import exercise


@exercise("7.1", "How far, how long")
def stopping(v, mu):
    g = 9.81
    return v**2 / (2 * mu * g), v / (mu * g)


stopping.check("a puck on the kit's table", lambda rng: (float(rng.uniform(0.3, 1.5)), 0.1))
stopping.check(
    "other friction", lambda rng: (float(rng.uniform(0.3, 3)), float(rng.uniform(0.05, 0.8)))
)
stopping.mistake(
    "Your distance is that of a puck that keeps its speed: the mean speed of a puck that stops is "
    "v / 2.",
    "v**2 / (2 * mu * g)",
    "v**2 / (mu * g)",
)
stopping.mistake(
    "Python divides and multiplies from left to right: put the denominator in brackets.",
    "v**2 / (2 * mu * g), v / (mu * g)",
    "v**2 / 2 * mu * g, v / mu * g",
)
stopping.mistake("Friction slows by mu times g: gravity is missing.", "g = 9.81", "g = 1.0")
stopping.mistake(
    "The energy goes with the square of the speed, and so does the distance.",
    "v**2 / (2 * mu * g)",
    "v / (2 * mu * g)",
)
stopping.mistake(
    "Return the distance first, then the time.",
    "v**2 / (2 * mu * g), v / (mu * g)",
    "v / (mu * g), v**2 / (2 * mu * g)",
)


@exercise("7.2", "The speeds that are good enough")
def speeds(distance, slack, mu):
    g = 9.81
    low, high = distance - slack, distance + slack
    return np.sqrt(2 * mu * g * max(low, 0)), np.sqrt(2 * mu * g * high)


def _shot(rng):
    return float(rng.uniform(0.2, 1)), float(rng.uniform(0.01, 0.15)), float(rng.uniform(0.05, 0.5))


speeds.check("targets in reach of a hit", _shot)
speeds.check(
    "so near that no hit at all is right, too",
    lambda rng: (0.03, 0.05, float(rng.uniform(0.05, 0.5))),
)
speeds.mistake(
    "You take the slack as a slack of speed: find the nearest and the farthest place, then their "
    "speeds.",
    "np.sqrt(2 * mu * g * max(low, 0)), np.sqrt(2 * mu * g * high)",
    "np.sqrt(2 * mu * g * distance) - slack, np.sqrt(2 * mu * g * distance) + slack",
)
speeds.mistake(
    "Where the slack is larger than the way, the lowest speed is 0: a root of a negative number is "
    "NaN.",
    "max(low, 0)",
    "low",
)
speeds.mistake(
    "Return the lowest speed first, then the highest.",
    "np.sqrt(2 * mu * g * max(low, 0)), np.sqrt(2 * mu * g * high)",
    "np.sqrt(2 * mu * g * high), np.sqrt(2 * mu * g * max(low, 0))",
)
speeds.mistake(
    "The slack counts in full on either side: from distance - slack to distance + slack.",
    "distance - slack, distance + slack",
    "distance - slack / 2, distance + slack / 2",
)
speeds.mistake(
    "Solve v^2 / (2 mu g) = distance for v: the square root is missing.", "np.sqrt", "float"
)
speeds.mistake("Solve v^2 / (2 mu g) = distance for v: the 2 is missing.", "2 * mu", "mu")


@exercise("7.3", "Friction from a track")
def friction(x, dt):
    t = dt * np.arange(len(x))
    return -2 * np.polyfit(t, x, 2)[0] / 9.81


def _track(rng, noise=0.0, most=0.3):
    mu, v, dt = rng.uniform(0.05, most), rng.uniform(0.8, 1.5), 0.04
    t = dt * np.arange(int(0.8 * v / (mu * 9.81) / dt) + 4)
    t = t[t < v / (mu * 9.81)]
    x = rng.uniform(0.4, 0.6) + v * t - mu * 9.81 * t**2 / 2
    return x + rng.normal(0, noise, len(x)), dt


friction.check("a clean track", _track, rtol=1e-3)
friction.check(
    "a track with two millimetres of jitter",
    lambda rng: _track(rng, 2e-3, most=0.1),
    rtol=1e-3,
    atol=1e-5,
)
friction.mistake(
    "x = x0 + v t - (1/2) mu g t^2: the coefficient of t^2 is half the deceleration.",
    "-2 * np",
    "-np",
)
friction.mistake("The track bends down: the sign of your mu is wrong.", "-2 * np", "2 * np")
friction.mistake(
    "Frames are dt apart: you fitted over frame numbers, not over seconds.",
    "dt * np.arange",
    "np.arange",
)
friction.mistake(
    "np.polyfit returns the highest power first: that of t^2 is [0].", "t, x, 2)[0]", "t, x, 2)[2]"
)
friction.mistake(
    "T frames have T - 1 steps of dt between them: the last is at (T - 1) * dt. np.arange counts "
    "right.",
    "dt * np.arange(len(x))",
    "np.linspace(0, len(x) * dt, len(x))",
)
friction.mistake(
    "Second differences add up the jitter of single frames: fit a parabola to the whole track.",
    "-2 * np.polyfit(t, x, 2)[0]",
    "-np.diff(x, 2).mean() / dt**2",
)
friction.mistake(
    "A line through the speeds has the jitter of two frames in each: fit a parabola to the places.",
    "-2 * np.polyfit(t, x, 2)[0]",
    "-np.polyfit(t[:-1], np.diff(x) / dt, 1)[0]",
)
friction.mistake("What you return is a deceleration in m/s^2: divide by g.", "[0] / 9.81", "[0]")


@exercise("7.4", "At the target, at rest")
def solved(x, target, dt):
    speed = np.abs(np.diff(x)) / dt
    return (np.abs(x[1:] - target) < 0.05) & (speed < 0.02)


def _stop(rng, end, drift=0.0):
    t = np.linspace(0, 1, 40)
    return end - 0.4 * (1 - t) ** 2 + drift * t * 40 * 0.04, 0.94, 0.04


solved.check(
    "a puck that comes to rest at the target",
    lambda rng: _stop(rng, 0.94 + rng.uniform(-0.045, 0.045)),
)
solved.check(
    "one that rests elsewhere",
    lambda rng: _stop(rng, 0.94 + rng.choice([-1, 1]) * rng.uniform(0.06, 0.2)),
)
solved.check(
    "one that slides across the target and on",
    lambda rng: (0.5 + rng.uniform(0.6, 0.9) * 0.04 * np.arange(30), 0.94, 0.04),
)
solved.check(
    "one that slides across and back",
    lambda rng: (1.2 - rng.uniform(0.6, 0.9) * 0.04 * np.abs(np.arange(-20, 21)), 0.94, 0.04),
)
solved.check(
    "one that rests at the target and is hit away",
    lambda rng: (
        np.concatenate([np.full(8, x := 0.94 + rng.uniform(-0.04, 0.04)), np.linspace(x, 1.4, 30)]),
        0.94,
        0.04,
    ),
)
solved.check(
    "one that creeps in at 1 cm/s, and out on the other side",
    lambda rng: (0.88 + rng.uniform(0, 0.01) + 0.01 * 0.04 * np.arange(320), 0.94, 0.04),
)
solved.mistake("A step is dt seconds: divide the way by it to get a speed in m/s.", " / dt", "")
solved.mistake(
    "A puck that slides across the target is not there: ask for less than 2 cm/s at the same "
    "moment.",
    "& (speed < 0.02)",
    "",
)
solved.mistake(
    "Near and slow have to hold together; yours is content with one of them.",
    "& (speed < 0.02)",
    "| (speed < 0.02)",
)
solved.mistake(
    "A distance has no sign: a puck far short of the target counts as near in yours.",
    "np.abs(x[1:] - target)",
    "(x[1:] - target)",
)
solved.mistake(
    "A speed has no sign here: a puck that slides backward counts as slow in yours.",
    "np.abs(np.diff(x))",
    "np.diff(x)",
)
solved.mistake(
    "The place counts at the step's end, x[t + 1]; yours is where the step began.",
    "np.abs(x[1:] - target)",
    "np.abs(x[:-1] - target)",
)
solved.mistake(
    "Each step is judged by itself: a puck that is hit away is no longer at the target.",
    "return (np.abs(x[1:] - target) < 0.05) & (speed < 0.02)",
    "return np.logical_or.accumulate((np.abs(x[1:] - target) < 0.05) & (speed < 0.02))",
)
solved.mistake(
    "np.gradient takes the mean of two steps; the speed is that of one, |x[t + 1] - x[t]| / dt.",
    "np.abs(np.diff(x)) / dt",
    "np.abs(np.gradient(x, dt))[1:]",
)
