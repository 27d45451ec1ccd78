"""Judging an answer: the same checks in the notebook, under pytest, and in the grader.

The judge makes the inputs, keeps the references and compares; how an answer is called is somebody else's
(`call`): the notebook calls its own function, the grader a process it does not trust.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from tests.grade.cell.wire import Other, Raised, encode
from tests.grade.exercise import Check, Exercise, different
from tests.grade.sandbox import Lost

OPEN = ("NotImplementedError", "StillOpen")  # what an untouched exercise raises


@dataclass
class Outcome:
    """What became of one check. message: empty if it passed."""

    label: str
    points: float
    most: float
    message: str = ""


@dataclass
class Result:
    """What became of an exercise. open: nobody has worked on it yet."""

    id: str
    title: str
    outcomes: list[Outcome] = field(default_factory=list)
    open: bool = False

    @property
    def points(self) -> float:
        return sum(o.points for o in self.outcomes)

    @property
    def most(self) -> float:
        return sum(o.most for o in self.outcomes)

    def lines(self) -> list[str]:
        """The feedback, a line a check; a message stands once."""
        said, lines = set(), []
        for o in self.outcomes:
            note = f": {o.message}" if o.message and o.message not in said else ""
            said.add(o.message)
            lines.append(f"{'ok   ' if not o.message else 'wrong'} {o.points:g}/{o.most:g}  {o.label}{note}")
        return lines


def nothing(exercise: Exercise, message: str, open: bool = False) -> Result:
    """No points, one reason."""
    outcomes = [Outcome(c.label, 0, c.points, message) for c in exercise.checks]
    return Result(exercise.id, exercise.title, outcomes, open)


def judge(exercise: Exercise, call, seed: int = 0) -> Result:
    """Run all checks of an exercise on the answer behind call(args) -> (value, changed its inputs).

    A call that raises Lost ends the exercise: what was earned before stays. An answer that is the same for
    all inputs earns nothing, also where it happens to be right.
    """
    reference = exercise.run(exercise.source)
    mistakes = [(m.hint, exercise.run(exercise.wrong(m))) for m in exercise.mistakes]
    result, lost, first = Result(exercise.id, exercise.title), "", None
    answers, truths, guesses = set(), set(), []
    for i, check in enumerate(exercise.checks):
        rng = np.random.default_rng([seed, i])
        message, hints = lost, []
        for _ in range(check.trials):
            if message:
                break
            args = check.inputs(rng)
            try:
                got, changed = call(args)
            except Lost as e:
                message = lost = str(e)
                break
            if type(got) is Raised and got in OPEN:
                return nothing(exercise, "not done yet", open=True)
            want = reference(args)
            answers.add(encode(got))
            truths.add(encode(want))
            message = _message(check, got, want, args)
            hints = [h for h, wrong in mistakes if _same(check, got, wrong(args), want)] if message else []
            if not message and changed:
                message = "it changes its inputs: work on a copy"
            if not message and first is None:
                first = args, got
        result.outcomes.append(Outcome(check.label, 0 if message else check.points, check.points, message))
        guesses.append(hints)
    # On some inputs two mistakes give the same answer; the one that explains most checks is it.
    votes = Counter(hint for hints in guesses for hint in hints)
    for outcome, hints in zip(result.outcomes, guesses, strict=True):
        outcome.message = max(hints, key=votes.get, default=outcome.message)
    if first and not lost:
        same = len(answers) == 1 < len(truths)
        message = "it returns the same, whatever it is given" if same else _repeat(first, call)
        if message:
            for o in result.outcomes:
                o.points, o.message = 0, o.message or message
    return result


def _message(check: Check, got, want, args) -> str:
    wrong = check.verify(got, args) if check.verify else different(got, want, check)
    if not wrong:
        return ""
    if type(got) is Raised and got == "ImportError" and "your own lines" in got.text:
        return got.text
    if type(got) is Raised and got == "MemoryError":
        return "it needs more memory than an exercise may take (2 GB)"
    return wrong


def _same(check: Check, got, theirs, want) -> bool:
    """Whether the answer is that of a mistake, and not right."""
    if type(theirs) is Other or (type(theirs) is Raised and theirs.text != getattr(got, "text", None)):
        return False
    return not different(got, theirs, check) and bool(different(want, theirs, check))


def _repeat(first, call) -> str:
    """The first input once more: a function's answer hangs on its inputs alone."""
    args, before = first
    try:
        again, _ = call(args)
    except Lost as e:
        return str(e)
    exact = Check("", lambda rng: (), 0, 1e-6, 1e-6, 1, None)
    return "the same input gives another answer the second time" if different(again, before, exact) else ""
