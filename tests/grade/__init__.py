"""Checks for the exercises of the notebooks: `check("6.1")` in a cell, `pytest tests/grade -k 6.1`,
and `python -m tests.grade FOLDER` for a class. `star(6, answer)` measures what earns no points."""

from tests.grade.star import star

__all__ = ["check", "star"]


def __getattr__(name: str):
    """`check`, once it is asked for: it imports torch, and who grades on a cluster starts that
    first."""
    if name != "check":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from tests.grade.notebook import check

    return check
