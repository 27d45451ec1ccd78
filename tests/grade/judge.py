"""Judging an answer: the same checks in the notebook, under pytest, and in the grader.

The judge makes the inputs, keeps the references and compares; how an answer is called is somebody
else's (`call`): the notebook calls its own function, the grader a process it does not trust.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from tests.grade.cell.wire import Other, Raised
from tests.grade.exercise import Check, Exercise, different
from tests.grade.sandbox import Lost

OPEN = ("NotImplementedError", "StillOpen")  # what an untouched exercise raises
UNDONE = "not done yet"


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
            mark = "wrong" if o.message else "ok   "
            lines.append(f"{mark} {o.points:g}/{o.most:g}  {o.label}{note}")
        return lines


def nothing(exercise: Exercise, message: str, open: bool = False) -> Result:
    """No points, one reason."""
    outcomes = [Outcome(c.label, 0, c.points, message) for c in exercise.checks]
    return Result(exercise.id, exercise.title, outcomes, open)


def judge(exercise: Exercise, call, seed: int = 0, renew=None) -> Result:
    """Run all checks of an exercise on the answer behind call(args) -> (value, changed its inputs).

    renew() starts that answer afresh, as if it had never been called. A call that raises Lost ends
    the exercise: what was earned before stays. An answer that is the same for all inputs earns
    nothing, also where it happens to be right; nor does one that hangs on what it was asked before.
    """
    reference = exercise.run(exercise.source)
    mistakes = [(m.hint, exercise.run(exercise.wrong(m))) for m in exercise.mistakes]
    result, lost, known = Result(exercise.id, exercise.title), "", []
    answers, truths, guesses = [], [], []
    for i, check in enumerate(exercise.checks):
        rng = np.random.default_rng([seed, i])
        message, hints = lost, []
        for trial in range(check.trials):
            if message:
                break
            args = check.inputs(rng)
            try:
                got, changed = call(args)
            except Lost as e:
                message = lost = str(e)
                break
            if type(got) is Raised and got in OPEN:
                message = UNDONE
                break
            want = reference(args)
            answers.append(got)
            truths.append(want)
            message = _message(check, got, want, args)
            if message:
                hints = [h for h, wrong in mistakes if _same(check, got, wrong(args), want)]
            elif changed:
                message = "it changes its inputs: work on a copy"
            if trial == 0:
                known.append((args, got))
        points = 0 if message else check.points
        result.outcomes.append(Outcome(check.label, points, check.points, message))
        guesses.append(hints)
    if all(o.message == UNDONE for o in result.outcomes):
        return nothing(exercise, UNDONE, open=True)
    # On some inputs two mistakes give the same answer: the one that explains most checks is it, if
    # that is half of what went wrong. A mistake that explains less happens to give the same there.
    votes = Counter(hint for hints in guesses for hint in set(hints))
    wrong = sum(o.points == 0 and o.message not in (lost, UNDONE) for o in result.outcomes)
    for outcome, hints in zip(result.outcomes, guesses, strict=True):
        likely = [h for h in hints if 2 * votes[h] >= wrong]
        outcome.message = max(likely, key=votes.get, default=outcome.message)
    if any(o.points for o in result.outcomes) and not lost:
        if _all_same(answers) and not _all_same(truths):
            message = "it returns the same, whatever it is given"
        else:
            message = _repeat(known, call, renew)
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
    if type(theirs) is Other:
        return False
    if type(theirs) is Raised and theirs.text != getattr(got, "text", None):
        return False
    return not different(got, theirs, check) and bool(different(want, theirs, check))


EXACT = Check("", lambda rng: (), 0, 1e-6, 1e-6, 1, None)
LOOSE = Check("", lambda rng: (), 0, 1e-5, 1e-4, 1, None)  # as a check that names no tolerances


def _all_same(values) -> bool:
    """Whether values are equal, but for what a check would not notice."""
    return not any(different(v, values[0], LOOSE) for v in values)


def _repeat(known, call, renew) -> str:
    """Inputs once more: a function's answer hangs on its inputs alone.

    First the very first, then, of the answer afresh, one of every check, the last check first: an
    answer that counts its calls, or remembers what it said, is at another place then.
    """
    try:
        if not _agrees(known[0], call):
            return "the same input gives another answer the second time"
        if renew:
            renew()
            if not all(_agrees(pair, call) for pair in reversed(known)):
                return "the same input gives another answer after other inputs"
    except Lost as e:
        return str(e)
    return ""


def _agrees(pair, call) -> bool:
    args, before = pair
    again, _ = call(args)
    if type(again) is type(before) is Other and again == before:
        return True
    return not different(again, before, EXACT)
