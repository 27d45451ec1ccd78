"""Checks for the exercises of the notebooks: `check("6.1")` in a cell, `pytest tests/grade -k 6.1`,
and `python -m tests.grade FOLDER` for a class. `star(6, answer)` measures what earns no points."""

from tests.grade.notebook import check
from tests.grade.star import star

__all__ = ["check", "star"]
