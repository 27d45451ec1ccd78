"""The exercises themselves: references earn everything, every mistake gets its own hint."""

import numpy as np
import pytest

from tests.grade.cell.wire import Garbage, Other, Raised, decode, encode
from tests.grade.exercise import everything
from tests.grade.judge import judge

ALL = everything()
NONSENSE = [
    None, True, 0, -1, 1 << 62, 1 << 150, 1.5, float("nan"), float("inf"), "", "fair", b"x",
    [], [1], [[1]], (), {}, (1, 2), (1, 2, 3), ((),), ({},), {"a": 1}, {(1, 2): 3},
    (None,) * 3, (1 << 150,) * 2, [0, "a"], ["a", "b"], (True, False), (0.0,) * 5,
    np.zeros(0), np.zeros(()), np.zeros((1, 1, 1)), np.zeros((2, 0, 3)), np.zeros(3, complex),
    np.zeros(3, bool), np.zeros(3, int), np.full(3, np.nan), np.float32(3), np.bool_(True),
    np.array(["a"]), (np.zeros(3), np.zeros(3)), [np.zeros(2), "a"], {"x": np.zeros(2)},
    Raised("KeyError", "x"), Other("set"),
]  # fmt: skip
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


@pytest.mark.parametrize(
    "exercise, mistake", MISTAKES, ids=[f"{e.id}-{m.hint[:40]}" for e, m in MISTAKES]
)
def test_a_mistake_costs_points_and_gets_its_own_hint(exercise, mistake):
    result = judge(exercise, trusted(exercise, exercise.wrong(mistake)))
    assert result.points < result.most
    assert mistake.hint in [o.message for o in result.outcomes], result.lines()


def test_mistakes_of_three_kinds_and_more_are_anticipated():
    assert not [e.id for e in ALL.values() if len({m.hint for m in e.mistakes}) < 3]


def test_inputs_pass_to_the_students_process_unchanged():
    for id, check in ((e.id, check) for e in ALL.values() for check in e.checks):
        args = check.inputs(np.random.default_rng(0))
        assert encode(decode(encode(args))) is not None, id
        assert b'"other"' not in encode(args)[:10_000], id


@pytest.mark.parametrize("exercise", ALL.values(), ids=list(ALL))
def test_nonsense_earns_nothing_and_breaks_nothing(exercise):
    said = 0

    def say_something_else(args):
        nonlocal said
        said += 1
        return decode(encode(NONSENSE[said % len(NONSENSE)])), False

    while said < len(NONSENSE):
        result = judge(exercise, say_something_else)
        assert result.points == 0, result.lines()


@pytest.mark.parametrize("value", [0.0, "fair"])
def test_an_answer_that_is_always_the_same_earns_nothing(value):
    for exercise in ALL.values():
        assert judge(exercise, lambda args: (value, False)).points == 0, exercise.id


def test_a_hint_that_explains_little_of_what_is_wrong_is_not_given():
    exercise = ALL["6.4"]
    result = judge(exercise, trusted(exercise, "def trim(z, least):\n    return z[::2]"))
    assert result.points == 0  # and one result of five is that of > for >=
    assert not {o.message for o in result.outcomes} & {m.hint for m in exercise.mistakes}


def test_ints_that_numpy_cannot_hold_do_not_pass():
    assert decode(encode(1 << 62)) == 1 << 62
    assert type(decode(encode(1 << 63))) is Other
    with pytest.raises(Garbage):
        decode(encode(1 << 62).replace(str(1 << 62).encode(), b"9" * 19))
