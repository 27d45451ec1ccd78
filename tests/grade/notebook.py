"""`check("6.1")`: the judge inside the student's own notebook, on the student's own function."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterable
from contextlib import contextmanager
from types import ModuleType

from tests.grade.cell.answer import FORBIDDEN, PREAMBLE, Hidden, ask, explained, own_lines, watch
from tests.grade.cell.wire import decode, encode
from tests.grade.exercise import Exercise, find
from tests.grade.judge import Result, best, forget, judge
from tests.grade.sandbox import WALL, Lost


class StillOpen(Exception):
    """The notebook has come to an exercise that is not done: one sentence, no traceback."""

    def _render_traceback_(self):
        return [str(self)]


class TooLong(TimeoutError):
    """A call that took longer than it may."""


class Points(float):
    """What a check cell evaluates to; nbgrader reads it as the points earned."""

    def __repr__(self):
        return f"{float(self):g}"

    def _repr_html_(self):
        """What a reader sees, who has seen them in the report's first line."""
        return f"<small>(for the gradebook: {self!r})</small>"


def check(id: str, seed: int = 0) -> Points:
    """Check exercise `id` ("6.1") of the calling notebook; print what is right and what is not.

    seed: other random inputs. Returns the points. Raises StillOpen, a quiet stop, while the
    exercise is open, and where there is none of that id.
    """
    id = str(id)  # 6.1 without quotes
    try:
        exercise = find(id)
    except KeyError as e:
        raise StillOpen(*e.args) from None
    space = sys._getframe(1).f_globals
    if exercise.name not in space:
        raise StillOpen(f"Exercise {id}: run the cell that defines {exercise.name} first.")
    if _root(space[exercise.name]) in FORBIDDEN:
        raise StillOpen(
            f"Exercise {id}: {exercise.name} is the package's own; write it with your own lines."
        )
    forget()
    own = exercise.gives & set(space)
    ways = [here(exercise, space, over) for over in ((True, False) if own else (True,))]
    result = best(lambda call=call: judge(exercise, call, seed) for call in ways)
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


def here(exercise: Exercise, space: dict, over: bool):
    """How the judge calls an answer that lives in this process.

    While it runs, its notebook has what it has in the sandbox: the names that every answer may use,
    `exercise.given` (in place of the student's own by these names if `over`), and no package.
    """
    exec(PREAMBLE, library := {})
    exec(PREAMBLE + exercise.given, given := {})
    package = {name: _root(value) for name, value in space.items() if _root(value) in FORBIDDEN}
    why = {name: ImportError(own_lines(name)) for name in package}
    there = {name: v for name, v in given.items() if name not in space or name in package}
    there |= {name: given[name] for name in exercise.gives if over}
    probing = {**library, **given, **space, **there}
    watched = watch(probing, exercise.job)

    def call(args):
        with _within(WALL), _swapped(space, there, package), _hidden():
            value, changed, e = ask(probing["probe"], watched, encode(args))
        if isinstance(e, TooLong):  # one is enough: each of the others would take as long
            raise Lost(f"{value.text} ({value.line})" if value.line else value.text)
        value = value if e is None else explained(value, e, why)
        return decode(encode(value)), changed

    return call


def _root(value) -> str:
    """The package that a value comes from: a module, a function, a class or an instance of one."""
    name = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
    return name.split(".")[0] if isinstance(name, str) else ""


@contextmanager
def _swapped(space: dict, there: dict, gone: Iterable[str]):
    """The names of a notebook with others in their place, and without those that are `gone`."""
    before = dict(space)
    try:
        for name in gone:
            space.pop(name, None)
        space.update(there)
        yield
    finally:
        for name in {*there, *gone}:
            space.pop(name, None)
            if name in before:
                space[name] = before[name]


@contextmanager
def _hidden():
    """No module of the package can be imported."""
    near = [name for name in sys.modules if name.startswith(FORBIDDEN)]  # of thousands: quickly
    ours = {name: sys.modules[name] for name in near if name.split(".")[0] in FORBIDDEN}
    hook = Hidden()
    for name in ours:
        del sys.modules[name]
    sys.meta_path.insert(0, hook)
    try:
        yield
    finally:
        sys.meta_path.remove(hook)
        sys.modules.update(ours)


@contextmanager
def _within(seconds: int):
    """Raise TooLong in a block that takes longer; only the main thread can be stopped."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(*_):
        raise TooLong(f"no answer within {seconds} s: does a loop never end?")

    # Windows has no alarm: there a thread asks for the interrupt, which comes when a line of Python
    # runs again, so a call that sleeps is waited for.
    alarm = getattr(signal, "SIGALRM", None)
    which = alarm or signal.SIGINT
    timer = threading.Timer(seconds, _thread.interrupt_main, [which])
    timer.daemon = True
    before = signal.signal(which, stop)
    signal.alarm(seconds) if alarm else timer.start()
    try:
        yield
    finally:
        signal.alarm(0) if alarm else timer.cancel()
        signal.signal(which, before)
