"""Notebook 10, does it work: intervals, chance, differences, and whether a task is fair."""

import math

import numpy as np

from tests.grade.exercise import different, exercise


@exercise(
    "10.1",
    "The Wilson interval",
    probe="""
    def probe(wins, n):
        if isinstance(n, int):
            return wilson(wins, n)
        return [wilson(k, m) for k, m in zip(wins, n, strict=True)]
    """,
)
def wilson(wins, n):
    z = 1.96
    p = wins / n
    centre = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2)) / (1 + z**2 / n)
    return max(0.0, centre - half), min(1.0, centre + half)


def _count(rng):
    n = int(rng.integers(5, 200))
    return int(rng.integers(0, n + 1)), n


def _extremes(rng):
    """None of n and n of n: where the ends leave 0 to 1 by rounding, if nobody cuts them off."""
    n = [int(k) for k in rng.permutation(np.arange(1, 120))]
    return [0] * len(n) + n, n + n


def _between(got, args):
    if not isinstance(got, list) or len(got) != len(args[0]):
        return different(got, [(0.0, 1.0)] * len(args[0]), wilson.checks[0])
    right = wilson.run(wilson.source)(args)
    for k, n, ends, want in zip(*args, got, right, strict=True):
        if wrong := different(ends, want, wilson.checks[0]):
            return f"{k} wins of {n}: {wrong}"
        low, high = ends
        if low < 0 or high > 1:
            return f"{k} wins of {n} give {low!r} to {high!r}: cut off what lies outside 0 to 1"
    return None


wilson.check("any number of episodes", _count)
wilson.check("ten of ten, and none of ten", lambda rng: (int(rng.choice([0, 10])), 10))
wilson.check("at the very ends it stays between 0 and 1", _extremes, trials=1, verify=_between)
wilson.mistake("z is 1.96, not 2.", "z = 1.96", "z = 2")
wilson.mistake(
    "Rounding leads out of 0 to 1 at times: cut it off, max(0, ...) and min(1, ...).",
    "max(0.0, centre - half), min(1.0, centre + half)",
    "centre - half, centre + half",
)
wilson.mistake(
    "The square root is missing.",
    "math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))",
    "(p * (1 - p) / n + z**2 / (4 * n**2))",
)
wilson.mistake("In front of the root stands z.", "half = z * math.sqrt", "half = math.sqrt")
wilson.mistake(
    "p is the share, wins / n; yours is the number of wins.",
    "p = wins / n",
    "p = wins",
    "p * (1 - p) / n",
    "abs(p * (1 - p)) / n",
)
wilson.mistake("p (1 - p) is divided by n under the root.", "p * (1 - p) / n", "p * (1 - p)")
wilson.mistake(
    "z is squared in the centre and in the denominator, z^2 / n.",
    "z**2 / (2 * n)",
    "z / (2 * n)",
    "(1 + z**2 / n)",
    "(1 + z / n)",
)
wilson.mistake(
    "The centre is p + z^2 / (2 n), over 1 + z^2 / n: yours leaves it at p.",
    "(p + z**2 / (2 * n)) / (1 + z**2 / n)",
    "p",
)
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
wilson.mistake(
    "The centre has z^2 / (2 n), half of what you add.",
    "z**2 / (2 * n)",
    "z**2 / n",
)
wilson.mistake(
    "1 + z^2 / n divides the half width, too.",
    " + z**2 / (4 * n**2)) / (1 + z**2 / n)",
    " + z**2 / (4 * n**2))",
)
wilson.mistake(
    "95 % lie within 1.96 on both sides; 1.645 leaves out 5 % on each.",
    "1.96",
    "1.645",
)
for cut in ("max(0.0, centre - half), min(1.0, centre + half)", "centre - half, centre + half"):
    wilson.mistake(
        "Your centre is Wilson's and your half width that of Agresti and Coull: under the root "
        "stand p (1 - p) / n, with the share p itself, and z^2 / (4 n^2).",
        "z * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2)) / (1 + z**2 / n)",
        "z * math.sqrt(centre * (1 - centre) / (n + z**2))",
        "max(0.0, centre - half), min(1.0, centre + half)",
        cut,
    )
wilson.mistake(
    "That is the interval with two wins and two losses added; Wilson's has z^2 in its formula, and "
    "another root.",
    "(p + z**2 / (2 * n)) / (1 + z**2 / n)",
    "(wins + 2) / (n + 4)",
    "z * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2)) / (1 + z**2 / n)",
    "z * math.sqrt(centre * (1 - centre) / (n + 4))",
)
wilson.mistake(
    "// cuts off what is behind the point: the share of wins is wins / n.",
    "wins / n",
    "wins // n",
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
    "At least k includes k itself; yours is the chance of more than k.",
    "range(k, n + 1)",
    "range(k + 1, n + 1)",
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
    "The others fail, with probability 1 - p each: (1 - p)^(n - i) is missing.",
    " * (1 - p) ** (n - i)",
    "",
)
chance.mistake(
    "p belongs to the wins, 1 - p to the others: yours are exchanged.",
    "p**i * (1 - p) ** (n - i)",
    "(1 - p) ** i * p ** (n - i)",
)
chance.mistake(
    "That is the probability of fewer than k: at least k is the rest.",
    "range(k, n + 1)",
    "range(k)",
)
chance.mistake(
    "In n episodes there are n - i failures beside i wins: yours are raised to n.",
    "** (n - i)",
    "**n",
)
chance.mistake(
    "k wins can fall on many sets of episodes: count them with math.comb.", "math.comb(n, i) * ", ""
)


@exercise("10.3", "Is it better, or lucky in its seeds?")
def difference(a, b, picks_a, picks_b):
    means = a[picks_a].mean(1) - b[picks_b].mean(1)
    return float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))


def _seeds(rng, n=5, m=5):
    draws = int(rng.integers(200, 500))
    a, b = rng.uniform(0.3, 1, n), rng.uniform(0, 0.9, m)
    return a, b, rng.integers(0, n, (draws, n)), rng.integers(0, m, (draws, m))


difference.check(
    "five seeds each",
    _seeds,
    least=lambda rng: ((s := _seeds(rng, 1, 1))[0], s[1], s[2][:1], s[3][:1]),
)
difference.check(
    "more seeds of one than of the other",
    lambda rng: _seeds(rng, int(rng.integers(3, 5)), int(rng.integers(6, 9))),
)
difference.mistake(
    "Mean plus and minus 1.96 standard deviations is the normal curve's interval: take the "
    "quantiles of the draws.",
    "float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))",
    "float(means.mean() - 1.96 * means.std()), float(means.mean() + 1.96 * means.std())",
)
difference.mistake(
    "Return (low, high): yours are the other way round.",
    "float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))",
    "float(np.quantile(means, 0.975)), float(np.quantile(means, 0.025))",
)
difference.mistake(
    "A draw is the mean of its picks, not their sum.",
    "a[picks_a].mean(1) - b[picks_b].mean(1)",
    "a[picks_a].sum(1) - b[picks_b].sum(1)",
)
difference.mistake(
    "np.quantile counts from 0 to 1, np.percentile from 0 to 100: its 2.5 is the other's 0.025.",
    "np.quantile",
    "np.percentile",
)
difference.mistake(
    "The smallest and the largest difference hold all draws: 95 % are between the quantiles.",
    "float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))",
    "float(means.min()), float(means.max())",
)
difference.mistake(
    "The picks are not used: a draw's mean is that of a[picks_a], a row of the picks at a time.",
    "a[picks_a].mean(1) - b[picks_b].mean(1)",
    "a.mean() - b.mean()",
)
difference.mistake(
    "You take the median of a draw's picks; the difference is one of means.",
    "a[picks_a].mean(1) - b[picks_b].mean(1)",
    "np.median(a[picks_a], 1) - np.median(b[picks_b], 1)",
)
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
    "You put the low end of a against the high end of b, which holds more than 95 %. Each draw has "
    "a difference of its own; take quantiles of these.",
    "float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))",
    "tuple(float(np.quantile(a[picks_a].mean(1), q) - np.quantile(b[picks_b].mean(1), 1 - q)) "
    "for q in (0.025, 0.975))",
)
difference.mistake(
    "That is the basic bootstrap, which mirrors the quantiles about the difference of all: return "
    "the quantiles of the draws themselves.",
    "float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))",
    "tuple(float(2 * (a.mean() - b.mean()) - np.quantile(means, q)) for q in (0.975, 0.025))",
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
difference.mistake(
    "The picks say which episodes are drawn: you draw your own.",
    "a[picks_a].mean(1) - b[picks_b].mean(1)",
    "(a[np.random.default_rng(0).integers(len(a), size=picks_a.shape)].mean(1) - "
    "b[np.random.default_rng(1).integers(len(b), size=picks_b.shape)].mean(1))",
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
    few, n, some = (int(k) for k in rng.integers((5, 61, 15), (80, 600, 30)))
    return (
        rng.random(few) < idle,
        rng.permutation(n) < int(n * random),
        rng.random(some) < expert,
    )


def _one(rng, values, value):
    """These truth values with one of them set."""
    values = values.copy()
    values[rng.integers(len(values))] = value
    return values


def _twentieth(rng):
    n = 20 * int(rng.integers(2, 8))
    return _task(rng)[0], rng.permutation(n) < n // 20, _task(rng)[2]


def _several(rng):
    """Two or three of the faults; in the last question of three the expert is at fault as well."""
    idle, random, expert = _task(rng, random=rng.uniform(0.2, 0.6))
    kind = rng.integers(3)
    if kind < 2:
        idle = _one(rng, idle, True)
    if kind > 0:
        expert = _one(rng, expert, False)
    return idle, random, expert


verdict.check(
    "a fair task",
    lambda rng: _task(rng, random=rng.uniform(0, 0.045)),
    least=lambda rng: (np.zeros(1, bool), np.zeros(1, bool), np.ones(1, bool)),
)
verdict.check(
    "one that idling solves now and then",
    lambda rng: (_one(rng, (t := _task(rng))[0], True), *t[1:]),
)
verdict.check("one that chance solves", lambda rng: _task(rng, random=rng.uniform(0.08, 0.5)))
verdict.check("at just one in twenty chance may stand", _twentieth)
verdict.check(
    "one with an expert that fails", lambda rng: (*(t := _task(rng))[:2], _one(rng, t[2], False))
)
verdict.check("two or three of them at once: name the first", _several, trials=6)
verdict.mistake(
    "More than 5 %: a share of just 0.05 may stand, > and not >=.",
    "random.mean() > 0.05",
    "random.mean() >= 0.05",
)
verdict.mistake(
    "5 % is 0.05; yours is a limit of 0.5.", "random.mean() > 0.05", "random.mean() > 0.5"
)
verdict.mistake(
    "mean() is a share, 0 to 1: 5 % is 0.05, not 5.", "random.mean() > 0.05", "random.mean() > 5"
)
verdict.mistake(
    "One idle episode is enough: you apply chance's 5 % to idling as well.",
    "idle.any()",
    "idle.mean() > 0.05",
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
    "The expert has to solve every episode; you are content with fewer.",
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
verdict.mistake(
    "The first reason that holds is the verdict; in yours a later one takes its place.",
    "    if idle.any():\n"
    '        return "solved by doing nothing"\n'
    "    if random.mean() > 0.05:\n"
    '        return "solved by chance"\n'
    "    if not expert.all():\n"
    '        return "not even the expert solves it"\n',
    "    if not expert.all():\n"
    '        return "not even the expert solves it"\n'
    "    if random.mean() > 0.05:\n"
    '        return "solved by chance"\n'
    "    if idle.any():\n"
    '        return "solved by doing nothing"\n',
)
verdict.mistake(
    "numpy's truth values are not Python's own: `is True` never holds. Ask `if idle.any():`.",
    "if idle.any():",
    "if idle.any() is True:",
    "if not expert.all():",
    "if expert.all() is False:",
)
verdict.mistake(
    "The first reason counts, in the order of the text: chance is asked about before the expert.",
    "if random.mean() > 0.05:",
    "if expert.all() and random.mean() > 0.05:",
)
