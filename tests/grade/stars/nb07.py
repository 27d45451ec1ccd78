"""Star 7, an unknown table: how many hits until a puck stops where it should?"""

import math

import numpy as np

from tests.grade.star import Star

TABLES, MOST = 300, 10  # hits a table; a table without success counts MOST
SLACK = 0.02  # m
SHAKY = 0.01  # share by which a hit is off, standard deviation


def hits(choose) -> float:
    """Mean number of hits up to the first within SLACK of the target.

    choose(target, tries) is the next speed in m/s; tries lists (speed, distance in m) so far.
    """
    rng = np.random.default_rng(0)
    return float(np.mean([_table(choose, rng) for _ in range(TABLES)]))


def _table(choose, rng):
    mu, drag, target = rng.uniform(0.04, 0.25), rng.uniform(0, 1.5), rng.uniform(0.2, 0.8)
    shakes, tries = rng.normal(0, SHAKY, MOST), []
    for shake in shakes:
        speed = min(max(float(choose(target, list(tries))), 0.0), 5.0)
        tries.append((speed, slid(speed * (1 + shake), mu, drag)))
        if abs(tries[-1][1] - target) < SLACK:
            return len(tries)
    return MOST


def slid(v: float, mu: float, drag: float) -> float:
    """How far in m a puck of speed v (m/s) slides: dv/dt = -(mu g + drag v), drag in 1/s."""
    dry = mu * 9.81
    if drag * v < 1e-3 * dry:
        return v**2 / (2 * dry)
    return v / drag - dry / drag**2 * math.log1p(drag * v / dry)


STAR = Star(hits, "hits", bar=2.4, naive=2.64, ours=2.25)
