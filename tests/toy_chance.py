"""Chance that writes down what it was asked, and pictures in a few figures, for golden tests."""

import numpy as np


class Draw(float):
    """A number drawn from 0 to 1 that writes down what it is compared with: the chance it meets."""

    told: list

    def __lt__(self, chance):
        self.told.append(float(chance))
        return float(self) < chance

    def __gt__(self, chance):
        self.told.append(-float(chance))
        return float(self) > chance

    def __le__(self, chance):
        self.told.append(1000 + float(chance))
        return float(self) <= chance

    def __ge__(self, chance):
        self.told.append(-1000 - float(chance))
        return float(self) >= chance


class Told:
    """A generator that writes down its draws, in their order.

    A uniform or a normal number tells its bounds itself. Of a choice or a whole number it writes
    down what it was drawn from, as most numbers come out of other bounds, too; and of a chance with
    what the number was compared.
    """

    def __init__(self, seed):
        self.rng, self.draws = np.random.default_rng(seed), []

    def _told(self, *numbers):
        for one in numbers:
            array = np.asarray(one, float).ravel()
            few = array if array.size <= 4 else [np.abs(array).mean(), array.size]
            self.draws.extend(map(float, few))

    def random(self, size=None):
        if size is not None:
            return self.rng.random(size)
        draw = Draw(self.rng.random())
        draw.told = self.draws
        return draw

    def uniform(self, *bounds):
        drawn = self.rng.uniform(*bounds)
        self._told(drawn)
        return drawn

    def normal(self, *asked):
        drawn = self.rng.normal(*asked)
        self._told(drawn)
        return drawn

    def standard_normal(self, shape, dtype=np.float64):
        self._told(shape)
        return self.rng.standard_normal(shape, dtype)

    def integers(self, low, high=None):
        drawn = self.rng.integers(low, high)
        self._told(low, drawn if high is None else high, drawn)
        return drawn

    def choice(self, of, p=None):
        numbers = of if np.asarray(of).dtype.kind in "if" else len(of)
        self._told(numbers, *([] if p is None else p))
        drawn = self.rng.choice(of, p=p)
        self._told(drawn if isinstance(drawn, np.number | int) else list(of).index(drawn))
        return drawn


def cells(picture, n=5):
    """The mean of each of n x n parts of a picture (H, W, ...), row by row, channel by channel."""
    picture = np.asarray(picture, float)
    rows = np.array_split(picture, n, axis=0)
    return (
        np.array([part.mean((0, 1)) for row in rows for part in np.array_split(row, n, axis=1)])
        .T.ravel()
        .round(2)
    )
