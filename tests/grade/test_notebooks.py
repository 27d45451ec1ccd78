"""`pytest tests/grade -k 6.1`: the exercises as they stand in `notebooks/`, but for open ones.

They are the reader's own: where there is no sandbox, they run in this process, as in the notebook.
"""

import pytest

from tests.grade.__main__ import grade_one
from tests.grade.cell.answer import define
from tests.grade.exercise import everything
from tests.grade.judge import judge, nothing
from tests.grade.notebook import here
from tests.grade.sandbox import Sandbox, holds
from tests.grade.submission import RELEASED, answer, read

ALL = everything()


@pytest.fixture(scope="module")
def box():
    if holds():
        with Sandbox() as sandbox:
            yield sandbox
    else:
        yield None


def graded(exercise, given, box):
    """The result of an answer, in the sandbox if there is one."""
    if box:
        return grade_one(exercise, given, box)
    if given.open:
        return nothing(exercise, "not done", open=True)
    job = {"source": given.source, "helpers": given.helpers, "below": given.below, "over": False}
    job |= {"name": exercise.name, "given": exercise.given, "definitions_only": False}
    try:
        space = define(job).names
    except Exception as e:
        return nothing(exercise, f"the cell does not run: {type(e).__name__}: {e}")
    return judge(exercise, here(exercise, space, over=False))


@pytest.fixture(scope="module")
def books():
    return [read(path) for path in sorted(RELEASED.glob("*.ipynb"))]


@pytest.mark.parametrize("exercise", ALL.values(), ids=list(ALL))
def test_exercise(exercise, box, books):
    given = answer(exercise, books)
    if given is None:
        pytest.skip("needs its cell, which is gone")
    result = graded(exercise, given, box)
    if result.open:
        pytest.skip("needs an answer: the exercise is still open")
    if result.points < result.most:  # a traceback would show the reference
        pytest.fail("\n".join(["", *result.lines()]), pytrace=False)
