"""Checks for the exercises of the notebooks: `check("6.1")` in a cell, `pytest tests/grade -k 6.1`,
and `python -m tests.grade FOLDER` for a class."""

from tests.grade.notebook import check

__all__ = ["check"]
