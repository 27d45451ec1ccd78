"""Judging an answer: the same checks in the notebook, under pytest, and in the grader.

The judge makes the inputs, keeps the references and compares; how an answer is called is somebody
else's (`call`): the notebook calls its own function, the grader a process it does not trust.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import threading
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
import torch

from tests.grade import example
from tests.grade.cell.wire import Other, Raised
from tests.grade.exercise import Check, Exercise, different
from tests.grade.sandbox import KEPT, PIECE, Lost

OPEN = ("NotImplementedError", "StillOpen")  # what an untouched exercise raises
UNDONE = "not done yet"
ALONE = threading.RLock()  # torch has one generator of random numbers for all threads
TRY = "The smallest input that fails, to paste:"
CHANGES = {  # by the kinds of `cell.answer.state`
    "graph": "it cuts an input off from its gradient for good, as detach_ and requires_grad_ do: "
    "leave it as it is; detach() makes a new tensor",
    "mode": "it changes the mode of a network it was given, by train or eval: leave it as it is",
    "values": "it changes an input that has to stay as it is",
    "grad": "it clears or adds to gradients of what it was given, as zero_grad and backward do: "
    "leave them as they are",
}


def settle() -> None:
    """Make this process a judge's: one thread, and memory that it keeps, as the sandbox does. With
    memory that comes and goes, PyBullet's worlds take half of the time of `questions`."""
    torch.set_num_threads(1)
    mallopt = ctypes.CDLL(None).mallopt
    mallopt(-3, PIECE)  # M_MMAP_THRESHOLD
    mallopt(-1, KEPT)  # M_TRIM_THRESHOLD


@dataclass
class Outcome:
    """What became of one check. message: empty if it passed."""

    label: str
    points: float
    most: float
    message: str = ""


@dataclass
class Result:
    """What became of an exercise. open: nobody has worked on it yet. example: the smallest input
    that failed, as a call to paste, and what is wrong there; empty if there is none. source: the
    cell that was graded; empty if nobody has worked on it."""

    id: str
    title: str
    outcomes: list[Outcome] = field(default_factory=list)
    open: bool = False
    example: str = ""
    source: str = ""

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
        return [*lines, TRY, *self.example.splitlines()] if self.example else lines


def nothing(exercise: Exercise, message: str, open: bool = False) -> Result:
    """No points, one reason."""
    outcomes = [Outcome(c.label, 0, c.points, message) for c in exercise.checks]
    return Result(exercise.id, exercise.title, outcomes, open)


def best(ways: Iterable[Callable[[], Result]]) -> Result:
    """The best result of several ways to take an answer, the first where they are equal.

    A way after one that earned every point is not tried.
    """
    found = None
    for way in ways:
        result = way()
        if found is None or result.points > found.points:
            found = result
        if found.points == found.most:
            break
    return found


def judge(exercise: Exercise, call, seed: int = 0, renew=None) -> Result:
    """Run all checks of an exercise on the answer behind call(args) -> (value, the kind of what it
    changed of its inputs or "").

    renew(agrees) has agrees(call) tried on that answer afresh, as if it had never been called, and
    returns what is to be said against it. A call that raises Lost ends the exercise: what was
    earned before stays. An answer that is the same for all inputs earns
    nothing, also where it happens to be right; nor does one that hangs on what it was asked before.
    The order of the questions hangs on the seed, so that counting them helps nobody.
    """
    checks = exercise.checks
    said, left, lost = [""] * len(checks), [c.trials for c in checks], ""
    asked = []
    for question in questions(exercise, seed):
        i = question.check
        if said[i] == UNDONE:
            continue
        try:
            got, changed = call(question.args)
        except Lost as e:
            lost = str(e)
            break
        left[i] -= 1
        if type(got) is Raised and got in OPEN:
            said[i] = UNDONE
            continue
        asked.append(Asked(checks[i], question, got))
        said[i] = said[i] or CHANGES.get(changed) or asked[-1].message
    if all(message == UNDONE for message in said):
        return nothing(exercise, UNDONE, open=True)
    result = Result(exercise.id, exercise.title)
    for check, message, more in zip(checks, said, left, strict=True):
        message = message or (lost if more else "")
        points = 0 if message else check.points
        result.outcomes.append(Outcome(check.label, points, check.points, message))
    if hint := _hint(exercise, asked):
        failed = {a.check.label for a in asked if a.message}
        for o in result.outcomes:
            o.message = hint if o.label in failed else o.message
    doubt = _doubt(asked, call, renew) if result.points and not lost else ""
    if doubt:
        for o in result.outcomes:
            o.points, o.message = 0, o.message or doubt
    if not (doubt or lost):
        result.example = _example(exercise, asked, call)
    return result


@dataclass(eq=False)
class Question:
    """The number of a check, inputs, the right answer, and those of mistakes by their numbers."""

    check: int
    args: tuple
    want: object
    theirs: dict[int, object] = field(default_factory=dict)


@dataclass
class Asked:
    """A question, the answer, and what to say of it: nothing if it is right."""

    check: Check
    question: Question
    got: object
    message: str = ""

    def __post_init__(self):
        self.message = _message(self.check, self.got, self.question)


def questions(exercise: Exercise, seed: int) -> list[Question]:
    """An exercise's questions in an order that hangs on the seed, worked out once for a class."""
    with ALONE:
        return _worked_out(exercise, seed)


def forget() -> None:
    """Work the questions out anew: a notebook's cell may have changed what they are made with."""
    _worked_out.cache_clear()


@functools.lru_cache(maxsize=100)  # a class asks those of one seed, and there are 50 exercises
def _worked_out(exercise: Exercise, seed: int) -> list[Question]:
    right = exercise.run(exercise.source)
    return [Question(i, args, right(args)) for i, args in _questions(exercise, seed)]


def _questions(exercise: Exercise, seed: int):
    """(check, inputs) in an order that hangs on the seed."""
    sources = [np.random.default_rng([seed, i]) for i in range(len(exercise.checks))]
    order = np.repeat(np.arange(len(sources)), [c.trials for c in exercise.checks])
    least = {i: c.least for i, c in enumerate(exercise.checks) if c.least}
    for i in map(int, np.random.default_rng([seed, len(sources)]).permutation(order)):
        yield i, (least.pop(i, None) or exercise.checks[i].inputs)(sources[i])


def _theirs(exercise: Exercise, mistake: int, question: Question):
    """What an answer with a mistake, by its number, says to a question."""
    if mistake not in question.theirs:
        with ALONE:
            question.theirs[mistake] = _mistaken(exercise, mistake)(question.args)
    return question.theirs[mistake]


@functools.lru_cache(maxsize=1000)
def _mistaken(exercise: Exercise, mistake: int) -> Callable:
    return exercise.run(exercise.wrong(exercise.mistakes[mistake]))


def _hint(exercise: Exercise, asked: list[Asked]) -> str:
    """That of the anticipated mistake that answers as the student does, wherever it was asked.

    One that agrees on part of the questions alone happens to give the same there.
    """
    wrong = [a for a in asked if a.message]
    asked = [*wrong, *(a for a in asked if not a.message)]
    for number, mistake in enumerate(exercise.mistakes if wrong else ()):
        if all(_same(a, _theirs(exercise, number, a.question)) for a in asked):
            return mistake.hint
    return ""


def _example(exercise: Exercise, asked: list[Asked], call) -> str:
    """The smallest input found that is answered wrongly, as a call to paste, and what is wrong."""
    wrong = [(a.check, a.question.args) for a in asked if a.message]
    with warnings.catch_warnings(action="ignore"), contextlib.suppress(Lost):
        with ALONE:
            to_try = example.candidates(wrong) if wrong and example.pasted(exercise) else []
        for check, args in to_try:
            with ALONE:
                want, text = example.tried(exercise, args)
            if text and (said := _message(check, call(args)[0], Question(0, args, want))):
                return f"{text}\n# {said}"
    return ""


def _message(check: Check, got, question: Question) -> str:
    if check.verify:
        wrong = check.verify(got, question.args)
    else:
        wrong = different(got, question.want, check)
    if not wrong:
        return ""
    if type(got) is Raised and got == "ImportError" and "your own lines" in got.text:
        return got.text
    if type(got) is Raised and got == "RuntimeError" and "requires grad" in got.text:
        where = f" ({got.line})" if got.line else ""
        if "in-place" in got.text:  # of an input, which is a leaf
            return f"{CHANGES['values']}{where}"
        return f"it leaves torch, and the gradient ends there: {got.text}{where}"
    if type(got) is Raised and got == "MemoryError":
        return "it needs more memory than an exercise may take (2 GB)"
    return wrong


def _same(asked: Asked, theirs) -> bool:
    """Whether an answer is that of a mistake; where it is wrong, the mistake has to be, too."""
    if type(theirs) is Other:
        return False
    if type(theirs) is Raised and theirs.text != getattr(asked.got, "text", None):
        return False
    if different(asked.got, theirs, asked.check):
        return False
    return not asked.message or bool(_message(asked.check, theirs, asked.question))


EXACT = Check("", lambda rng: (), 0, 1e-6, 1e-6, 1, None)
LOOSE = Check("", lambda rng: (), 0, 1e-5, 1e-4, 1, None)  # as a check that names no tolerances


def _all_same(values) -> bool:
    """Whether values are equal, but for what a check would not notice."""
    return not any(different(v, values[0], LOOSE) for v in values)


def _doubt(asked: list[Asked], call, renew) -> str:
    """Why right answers earn nothing; empty if they do."""
    if _all_same([a.got for a in asked]) and not _all_same([a.question.want for a in asked]):
        return "it returns the same, whatever it is given"
    known = {}
    for a in asked:
        known.setdefault(id(a.check), (a.question.args, a.got))
    return _repeat(list(known.values()), call, renew)


def _repeat(known, call, renew) -> str:
    """Inputs once more: a function's answer hangs on its inputs alone.

    First the very first, then, of the answer afresh, one of every check, the last check first: an
    answer that counts its calls, or remembers what it said, is at another place then.
    """
    try:
        if not _agrees(known[0], call):
            return "the same input gives another answer the second time"
        if renew:
            return renew(lambda call: all(_agrees(pair, call) for pair in reversed(known)))
    except Lost as e:
        return str(e)
    return ""


def _agrees(pair, call) -> bool:
    args, before = pair
    again, _ = call(args)
    if type(again) is type(before) is Other and again == before:
        return True
    return not different(again, before, EXACT)
