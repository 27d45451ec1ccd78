"""`pytest tests/grade -k 6.1`: the exercises as they stand in `notebooks/`, but for open ones."""

import pytest

from tests.grade.__main__ import grade_one
from tests.grade.exercise import everything
from tests.grade.sandbox import Sandbox
from tests.grade.submission import RELEASED, answer, read

ALL = everything()


@pytest.fixture(scope="module")
def box():
    with Sandbox() as sandbox:
        yield sandbox


@pytest.fixture(scope="module")
def books():
    return [read(path) for path in sorted(RELEASED.glob("*.ipynb"))]


@pytest.mark.parametrize("exercise", ALL.values(), ids=list(ALL))
def test_exercise(exercise, box, books):
    given = answer(exercise, books)
    if given is None:
        pytest.skip("its cell is gone")
    result = grade_one(exercise, given, box)
    if result.open:
        pytest.skip("still open")
    if result.points < result.most:  # a traceback would show the reference
        pytest.fail("\n".join(["", *result.lines()]), pytrace=False)
