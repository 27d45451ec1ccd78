"""`check("6.1")`: the judge inside the student's own notebook, on the student's own function."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import contextmanager

import torch

from tests.grade.cell.wire import Raised, decode, encode
from tests.grade.exercise import Exercise, find
from tests.grade.judge import Result, judge
from tests.grade.sandbox import WALL


class StillOpen(Exception):
    """The notebook has come to an exercise that is not done: one sentence, no traceback."""

    def _render_traceback_(self):
        return [str(self)]


class Points(float):
    """What a check cell evaluates to; nbgrader reads it as the points earned."""

    def __repr__(self):
        return f"{float(self):g}"


def check(id: str, seed: int = 0) -> Points:
    """Check exercise `id` ("6.1") of the calling notebook; print what is right and what is not.

    seed: other random inputs. Returns the points. Raises StillOpen, a quiet stop, while the
    exercise is open.
    """
    exercise = find(id)
    space = sys._getframe(1).f_globals
    if exercise.name not in space:
        raise StillOpen(f"Exercise {id}: run the cell that defines {exercise.name} first.")
    if str(getattr(space[exercise.name], "__module__", "")).startswith("lbw_minimal"):
        raise StillOpen(
            f"Exercise {id}: {exercise.name} is the package's own; write it with your own lines."
        )
    result = judge(exercise, here(exercise, space), seed)
    if result.open:
        raise StillOpen(
            f"Exercise {id} ({exercise.title}) is still open. "
            "Fill in its cell and run on from there."
        )
    print(report(result))
    return Points(result.points)


def report(result: Result) -> str:
    """The feedback as text."""
    head = f"Exercise {result.id}: {result.points:g} of {result.most:g} points"
    return "\n".join([head, *result.lines()])


def here(exercise: Exercise, space: dict):
    """How the judge calls an answer that lives in this process."""
    space = dict(space)
    exec(exercise.probe, space)

    def call(args):
        before = encode(args)
        args = decode(before, torch.from_numpy)
        torch.manual_seed(0)
        try:
            with _within(WALL):
                value = space["probe"](*args)
        except Exception as e:
            value = Raised(type(e).__name__, str(e))
        return decode(encode(value)), encode(args) != before

    return call


@contextmanager
def _within(seconds: int):
    """Raise TimeoutError in a block that takes longer; only the main thread can be stopped."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(*_):
        raise TimeoutError(f"no answer within {seconds} s: does a loop never end?")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
