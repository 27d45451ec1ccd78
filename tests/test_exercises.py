"""The exercises themselves: references earn everything, and every anticipated mistake gets its own hint."""

import pytest

from tests.grade.cell.wire import decode, encode
from tests.grade.exercise import everything
from tests.grade.judge import judge

ALL = everything()
MISTAKES = [(e, m) for e in ALL.values() for m in e.mistakes]


def trusted(exercise, source):
    """The judge's call, without the sandbox."""
    run = exercise.run(source)

    def call(args):
        return run(args), False

    return call


@pytest.mark.parametrize("exercise", ALL.values(), ids=list(ALL))
def test_the_reference_earns_every_point(exercise):
    result = judge(exercise, trusted(exercise, exercise.source))
    assert result.points == result.most > 0, result.lines()


@pytest.mark.parametrize("exercise, mistake", MISTAKES, ids=[f"{e.id}-{m.hint[:40]}" for e, m in MISTAKES])
def test_a_mistake_costs_points_and_gets_its_own_hint(exercise, mistake):
    result = judge(exercise, trusted(exercise, exercise.wrong(mistake)))
    assert result.points < result.most
    assert mistake.hint in [o.message for o in result.outcomes], result.lines()


@pytest.mark.parametrize("exercise", ALL.values(), ids=list(ALL))
def test_three_mistakes_are_anticipated_each_with_a_hint_of_its_own(exercise):
    hints = [m.hint for m in exercise.mistakes]
    assert len(hints) == len(set(hints)) >= 3


@pytest.mark.parametrize("exercise", ALL.values(), ids=list(ALL))
def test_inputs_pass_to_the_students_process_unchanged(exercise):
    import numpy as np

    for check in exercise.checks:
        args = check.inputs(np.random.default_rng(0))
        assert encode(decode(encode(args))) is not None and b'"other"' not in encode(args)[:10_000]
