"""Notebook 10, does it work: intervals, chance, differences, and whether a task is fair."""

import math

import numpy as np

from tests.grade.exercise import exercise


@exercise("10.1", "The Wilson interval")
def wilson(wins, n):
    z = 1.96
    p = wins / n
    centre = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2)) / (1 + z**2 / n)
    return max(0.0, centre - half), min(1.0, centre + half)


def _count(rng):
    n = int(rng.integers(5, 200))
    return int(rng.integers(0, n + 1)), n


wilson.check("any number of episodes", _count, points=2)
wilson.check("ten of ten, and none of ten", lambda rng: (int(rng.choice([0, 10])), 10))
wilson.mistake(
    "That is the interval of the normal curve: it says 1.00 to 1.00 for ten of ten.",
    "(p + z**2 / (2 * n)) / (1 + z**2 / n)",
    "p",
    "z * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2)) / (1 + z**2 / n)",
    "z * math.sqrt(p * (1 - p) / n)",
)
wilson.mistake(
    "The root holds p (1 - p) / n and z^2 / (4 n^2): the second one has n squared.",
    "(4 * n**2)",
    "(4 * n)",
)
wilson.mistake("Both centre and half width are divided by 1 + z^2 / n.", " / (1 + z**2 / n)", "")
wilson.mistake(
    "Under the root and in the centre, n is in the denominator: z**2 / (2 * n), with brackets.",
    "z**2 / (2 * n)",
    "z**2 / 2 * n",
)
wilson.mistake(
    "Probabilities go from 0 to 1; yours are per cent.",
    "max(0.0, centre - half), min(1.0, centre + half)",
    "100 * max(0.0, centre - half), 100 * min(1.0, centre + half)",
)
wilson.mistake("95 % lie within 1.96 standard deviations, not within 1.", "z = 1.96", "z = 1.0")
wilson.mistake(
    "You return centre and half width; return the two ends.",
    "max(0.0, centre - half), min(1.0, centre + half)",
    "centre, half",
)


@exercise("10.2", "How often by luck?")
def chance(p, n, k):
    return sum(math.comb(n, i) * p**i * (1 - p) ** (n - i) for i in range(k, n + 1))


def _luck(rng):
    n = int(rng.integers(2, 30))
    return float(rng.uniform(0.05, 0.95)), n, int(rng.integers(1, n + 1))


chance.check("any policy, any number of episodes", _luck, points=2)
chance.check("all of ten", lambda rng: (float(rng.uniform(0.5, 0.99)), 10, 10))
chance.check("at least none is certain", lambda rng: (float(rng.uniform(0, 1)), 10, 0))
chance.mistake(
    "At least k includes k itself: start the sum there.", "range(k, n + 1)", "range(k + 1, n + 1)"
)
chance.mistake(
    "At least k means all counts from k to n; yours is exactly k.",
    "range(k, n + 1)",
    "range(k, k + 1)",
)
chance.mistake(
    "n of n belongs to it: range stops one before its end.", "range(k, n + 1)", "range(k, n)"
)
chance.mistake(
    "You sum up to k, at most k wins; at least k goes from k to n.",
    "range(k, n + 1)",
    "range(0, k + 1)",
)
chance.mistake(
    "The number of ways belongs to each count i of the sum: math.comb(n, i), not of k.",
    "comb(n, i)",
    "comb(n, k)",
)
chance.mistake(
    "k wins can fall on many sets of episodes: count them with math.comb.", "math.comb(n, i) * ", ""
)


@exercise("10.3", "Is it better, or lucky in its seeds?")
def difference(a, b, picks_a, picks_b):
    means = a[picks_a].mean(1) - b[picks_b].mean(1)
    return float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))


def _seeds(rng, n=5, m=5, draws=400):
    a, b = rng.uniform(0.3, 1, n), rng.uniform(0, 0.9, m)
    return a, b, rng.integers(0, n, (draws, n)), rng.integers(0, m, (draws, m))


difference.check("five seeds each", _seeds)
difference.check("three seeds and four", lambda rng: _seeds(rng, 3, 4))
difference.check(
    "a method against itself", lambda rng: ((s := _seeds(rng))[0], s[0].copy(), s[2], s[3])
)
difference.mistake(
    "You ask for the middle 90 %: a 95 % interval leaves out 2.5 % on each side.",
    "0.025",
    "0.05",
    "0.975",
    "0.95",
)
difference.mistake(
    "You draw the same seeds for both: each method has its own picks.", "b[picks_b]", "b[picks_a]"
)
difference.mistake(
    "A draw is the mean over its seeds: one number a row of the picks.", ".mean(1)", ".mean(0)"
)
difference.mistake(
    "Each draw has a difference of its own; take quantiles of these, not differences of quantiles.",
    "float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))",
    "tuple(float(np.quantile(a[picks_a].mean(1), q) - np.quantile(b[picks_b].mean(1), q)) "
    "for q in (0.025, 0.975))",
)
difference.mistake(
    "You take quantiles over single seeds: a draw is the mean over its seeds.",
    "a[picks_a].mean(1) - b[picks_b].mean(1)",
    "a[picks_a] - b[picks_b]",
)
difference.mistake(
    "You subtract the wrong way round: a - b.",
    "a[picks_a].mean(1) - b[picks_b].mean(1)",
    "b[picks_b].mean(1) - a[picks_a].mean(1)",
)


@exercise("10.4", "Is this task fair?")
def verdict(idle, random, expert):
    if idle.any():
        return "solved by doing nothing"
    if random.mean() > 0.05:
        return "solved by chance"
    if not expert.all():
        return "not even the expert solves it"
    return "fair"


def _task(rng, idle=0.0, random=0.02, expert=1.0):
    n = int(rng.choice([40, 100, 300]))
    return rng.random(20) < idle, np.arange(n) < int(n * random), rng.random(20) < expert


def _twentieth(rng):
    n = 20 * int(rng.integers(2, 8))
    return np.zeros(20, bool), np.arange(n) < n // 20, rng.random(20) < 1


verdict.check("a fair task", lambda rng: _task(rng, random=rng.uniform(0, 0.05)))
verdict.check(
    "one that idling solves now and then",
    lambda rng: ((t := _task(rng, 0.0))[0] | (np.arange(20) == 7), t[1], t[2]),
)
verdict.check("one that chance solves", lambda rng: _task(rng, random=rng.uniform(0.06, 0.5)))
verdict.check("at just one in twenty chance may stand", _twentieth)
verdict.check("one with an expert that fails", lambda rng: (*_task(rng)[:2], np.arange(20) != 3))
verdict.check(
    "two or three of them at once: name the first",
    lambda rng: (
        np.ones(20, bool) * bool(k := rng.integers(2)),
        np.arange(100) < 30,
        np.arange(20) < 20 * k,
    ),
)
verdict.mistake(
    "Once is enough: a task that idling solves in one episode is not fair.",
    "idle.any()",
    "idle.all()",
)
verdict.mistake(
    "Chance may solve one episode in twenty: compare the share with 0.05.",
    "random.mean() > 0.05",
    "random.any()",
)
verdict.mistake(
    "The expert has to solve every episode; you are content with one.",
    "not expert.all()",
    "not expert.any()",
)
verdict.mistake(
    "Compare the share of the random episodes with 0.05, not their number with 5: there may be any "
    "number.",
    "random.mean() > 0.05",
    "random.sum() > 5",
)
verdict.mistake(
    "The expert comes last: where doing nothing or chance solves the task, that is what to say.",
    "if idle.any():",
    "if not expert.all():\n        return 'not even the expert solves it'\n    if idle.any():",
)
verdict.mistake(
    "Ask for idling first: where it solves the task, chance does as well.",
    "if idle.any():",
    "if random.mean() > 0.05:\n        return 'solved by chance'\n    if idle.any():",
)
