"""A star: a project with an open end. `star(6, patient)` in a cell measures how far one has come.

A file in `tests/grade/stars/` holds the star of one notebook: how an answer is measured, where it
shines from, and what we reached. It is worth no points, so nothing of it runs in the grader.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Star:
    """measure: what an answer reaches, a number, the same each time. unit: what it counts.

    bar: where it shines from. naive, ours: what a first thought reaches, and the kit's solution.
    Less is better where the naive one lies above the bar.
    """

    measure: Callable[[Callable], float]
    unit: str
    bar: float
    naive: float
    ours: float

    def shines(self, reached: float) -> bool:
        """Whether that is enough. Not a number is not."""
        return reached >= self.bar if self.naive < self.bar else reached <= self.bar

    def report(self, number: int, reached: float) -> str:
        """What an answer reached, beside what others did."""
        said = "it shines" if self.shines(reached) else f"not yet: it shines from {self.bar:g}"
        others = f"A first thought reaches {self.naive:g}, the kit's solution {self.ours:g}."
        return f"Star {number}: {reached:.3g} {self.unit}; {said}. {others}"


def shaped(got, like: np.ndarray, what: str) -> np.ndarray:
    """What an answer returned, as floats. Raises ValueError if its shape is not that of `like`."""
    got = np.asarray(got, float)
    if got.shape != like.shape:
        raise ValueError(f"{what} has shape {got.shape}; it should be {like.shape}")
    return got


def find(number: int) -> Star:
    """The star of a notebook. Raises ValueError if it has none."""
    try:
        return importlib.import_module(f"tests.grade.stars.nb{number:02}").STAR
    except ModuleNotFoundError as e:
        if not (e.name or "").startswith("tests.grade.stars"):
            raise
        raise ValueError(f"notebook {number} has no star") from None


def star(number: int, answer: Callable) -> None:
    """Measure an answer to the star of a notebook, and print what it reaches, or that it is open.

    What else the answer raises is not caught.
    """
    found = find(number)
    try:
        said = found.report(number, float(found.measure(answer)))
    except NotImplementedError:
        said = f"Star {number} is open. It is worth no points, and the notebook goes on without it."
    print(said)
