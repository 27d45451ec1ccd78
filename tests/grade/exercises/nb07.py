"""Notebook 7, slide: how hard to hit."""

import numpy as np

from tests.grade.exercise import exercise


@exercise("7.1", "How far, how long")
def stopping(v, mu):
    g = 9.81
    return v**2 / (2 * mu * g), v / (mu * g)


stopping.check("a puck on the kit's table", lambda rng: (float(rng.uniform(0.3, 1.5)), 0.1))
stopping.mistake("The friction is the argument, not always 0.1.", "g = 9.81", "g, mu = 9.81, 0.1")
stopping.mistake(
    "The time is v / (mu g): the 2 belongs to the distance alone.",
    "v / (mu * g)",
    "v / (2 * mu * g)",
)
stopping.mistake(
    "More friction stops it sooner: mu stands in the denominator.",
    "v**2 / (2 * mu * g), v / (mu * g)",
    "v**2 * mu / (2 * g), v * mu / g",
)
stopping.mistake(
    "The time goes with the speed itself, v / (mu g), not with its square.",
    "v / (mu * g)",
    "v**2 / (mu * g)",
)
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
stopping.mistake("The table has g = 9.81 m/s^2; yours is 9.8.", "g = 9.81", "g = 9.8")
stopping.mistake("The table has g = 9.81 m/s^2; yours is 9.80665.", "g = 9.81", "g = 9.80665")
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
stopping.mistake(
    "Mind the brackets: v^2 / (2 mu g).",
    "v**2 / (2 * mu * g)",
    "v**2 / 2 * mu * g",
)
stopping.mistake(
    "g is 9.81 m/s^2, not 10.",
    "9.81",
    "10",
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
    lambda rng: (
        float(rng.uniform(0.01, 0.05)),
        float(rng.uniform(0.06, 0.12)),
        float(rng.uniform(0.05, 0.5)),
    ),
)
speeds.mistake("The slack is the argument, not always 5 cm.", "g = 9.81", "g, slack = 9.81, 0.05")
speeds.mistake("The friction is the argument, not always 0.1.", "g = 9.81", "g, mu = 9.81, 0.1")
speeds.mistake(
    "Where the slack is larger than the way, the lowest speed is 0; yours takes the way's size, "
    "whatever its sign.",
    "max(low, 0)",
    "abs(low)",
)
speeds.mistake("Friction slows by mu times g: gravity is missing.", "g = 9.81", "g = 1.0")
speeds.mistake(
    "Return two speeds, the lowest and the highest: yours is the one for `distance`.",
    "return np.sqrt(2 * mu * g * max(low, 0)), np.sqrt(2 * mu * g * high)",
    "return np.sqrt(2 * mu * g * distance)",
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
speeds.mistake(
    "The speed grows as the root of the way: add the slack before you take it.",
    "np.sqrt(2 * mu * g * max(low, 0)), np.sqrt(2 * mu * g * high)",
    "(max(np.sqrt(2 * mu * g * distance) - np.sqrt(2 * mu * g * slack), 0), "
    "np.sqrt(2 * mu * g * distance) + np.sqrt(2 * mu * g * slack))",
)
speeds.mistake(
    "Slack is a length in m, not a share of the distance.",
    "distance - slack, distance + slack",
    "distance * (1 - slack), distance * (1 + slack)",
)
speeds.mistake(
    "The distance grows as the square of the speed: take the slack from the distance before the "
    "root, and not the same share from the speed.",
    "low, high = distance - slack, distance + slack",
    "v, share = np.sqrt(2 * mu * g * distance), slack / distance",
    "np.sqrt(2 * mu * g * max(low, 0)), np.sqrt(2 * mu * g * high)",
    "v * max(1 - share, 0), v * (1 + share)",
)


@exercise("7.3", "Friction from a track")
def friction(x, dt):
    t = dt * np.arange(len(x))
    return -2 * np.polyfit(t, x, 2)[0] / 9.81


def _track(rng, noise=0.0, most=0.3):
    mu, v, dt = rng.uniform(0.05, most), rng.uniform(0.8, 1.5), float(rng.uniform(0.02, 0.06))
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
friction.mistake("Frames are dt apart, not always 0.04 s.", "dt * np", "0.04 * np")
friction.mistake(
    "np.polyfit returns the highest power first: that of t^2 is [0].", "t, x, 2)[0]", "t, x, 2)[1]"
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
friction.mistake(
    "t^2 is frames squared times dt squared: divide by dt twice.",
    "dt * np.arange(len(x))",
    "np.arange(len(x))",
    "/ 9.81",
    "/ dt / 9.81",
)


@exercise("7.4", "At the target, at rest")
def solved(x, target, dt):
    speed = np.abs(np.diff(x)) / dt
    return (np.abs(x[1:] - target) < 0.05) & (speed < 0.02)


def _where(rng):
    """A target (m) and the time between frames (s)."""
    return float(rng.uniform(0.5, 1.5)), float(rng.uniform(0.02, 0.06))


def _stop(rng, off):
    """A puck that comes to rest `off` the target."""
    target, dt = _where(rng)
    t = np.linspace(0, 1, int(1 / dt) + int(rng.integers(15, 25)))
    return target + off - 0.4 * (1 - t) ** 2, target, dt


def _across(rng, turns=False):
    """One that slides across the target, and back if it turns."""
    target, dt = _where(rng)
    way = rng.uniform(0.6, 0.9) * dt * np.arange(-rng.integers(15, 20), rng.integers(16, 24))
    return target - (np.abs(way) - 0.1 if turns else -way), target, dt


def _hit_away(rng):
    target, dt = _where(rng)
    x = target + rng.uniform(-0.04, 0.04)
    rest, away = np.full(rng.integers(5, 10), x), np.linspace(x, x + 0.5, rng.integers(15, 30))
    return np.concatenate([rest, away]), target, dt


def _creeps(rng):
    """At 1 cm/s across the target, from 6 cm before it."""
    target, dt = _where(rng)
    return target - 0.06 - rng.uniform(0, 0.01) + 0.01 * dt * np.arange(int(13 / dt)), target, dt


def _at_the_bounds(rng):
    """One that rests too far off, and is then put just 5 cm off, and moved at just 2 cm/s.

    Its target is 0 and its time a power of 2, so that no sum and no quotient rounds.
    """
    x = _stop(rng, rng.choice([-1, 1]) * rng.uniform(0.06, 0.2))
    x, dt = x[0] - x[1], 2.0 ** -int(rng.integers(4, 6))
    just, step = rng.choice([-0.05, 0.05]), rng.choice([-1, 1]) * 0.02 * dt
    return np.concatenate([x, [just, just, -just, -just, 0.03, 0.03, 0, step, 0, step]]), 0.0, dt


solved.check(
    "a puck that comes to rest at the target",
    lambda rng: _stop(rng, rng.uniform(-0.045, 0.045)),
)
solved.check("one that rests elsewhere, or moves or lies just at a bound", _at_the_bounds)
solved.check("one that slides across the target and on", _across)
solved.check("one that slides across and back", lambda rng: _across(rng, turns=True))
solved.check("one that rests at the target and is hit away", _hit_away)
solved.check("one that creeps in at 1 cm/s, and out on the other side", _creeps)
solved.mistake("The target is the argument, not always 0.94.", "- target", "- 0.94")
solved.mistake("Frames are dt apart, not always 0.04 s.", "/ dt", "/ 0.04")
solved.mistake(
    "An answer for every step, T - 1 of them: yours says whether it was solved at all.",
    "return (np.abs(x[1:] - target) < 0.05) & (speed < 0.02)",
    "return ((np.abs(x[1:] - target) < 0.05) & (speed < 0.02)).any()",
)
solved.mistake(
    "Near is within 0.05 m, slow is below 0.02 m/s: your two bounds are swapped.",
    "< 0.05) & (speed < 0.02)",
    "< 0.02) & (speed < 0.05)",
)
solved.mistake(
    "A resting puck counts where it is near the target: you look at the speed alone.",
    "(np.abs(x[1:] - target) < 0.05) & (speed < 0.02)",
    "speed < 0.02",
)
solved.mistake("A step is dt seconds: divide the way by it to get a speed in m/s.", " / dt", "")
solved.mistake(
    "A puck that slides across the target is not there: ask for less than 2 cm/s at the same "
    "moment.",
    "& (speed < 0.02)",
    "",
)
solved.mistake(
    "Nearer than 0.05 m and slower than 0.02 m/s: a step just at a bound does not count, < and not "
    "<=.",
    "< 0.05) & (speed < 0.02)",
    "<= 0.05) & (speed <= 0.02)",
)
solved.mistake(
    "Slower than 0.02 m/s: a step of just that speed does not count, < and not <=.",
    "speed < 0.02",
    "speed <= 0.02",
)
solved.mistake(
    "Nearer than 0.05 m: a puck just that far off does not count, < and not <=.",
    "< 0.05",
    "<= 0.05",
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
solved.mistake(
    "T places have T - 1 steps: yours has one more, before the first.",
    "np.diff(x)) / dt",
    "np.diff(x, prepend=x[0])) / dt",
    "x[1:]",
    "x",
)
solved.mistake(
    "`and` asks for one truth value; arrays are joined entry by entry, with &.",
    "0.05) & (speed",
    "0.05) and (speed",
)
