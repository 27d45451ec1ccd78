"""What an exercise is: a reference, checks on random inputs, and the mistakes people make.

A file in `tests/grade/exercises/` holds the exercises of one notebook:

    @exercise("6.1", "Distance to the nearest frame (Eq. 9)")
    def r1(z, z_E):
        return -np.linalg.norm((z_E[:-1] - z).reshape(len(z_E) - 1, -1), axis=1).min()

    r1.check("random", lambda rng: (rng.normal(size=(5, 2)), rng.normal(size=(9, 5, 2))), points=2)
    r1.mistake("In Eq. 9 p ends at N - 1: yours includes the last frame.", "z_E[:-1]", "z_E")

The decorated code is the reference; a mistake is the reference with a piece of its text replaced. A
wrong answer that equals a mistake's gets the mistake's hint. numpy as np, torch, F, nn and math are
there.
"""

from __future__ import annotations

import ast
import functools
import importlib
import inspect
import pkgutil
import textwrap
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import torch

from tests.grade import exercises
from tests.grade.cell.answer import PREAMBLE
from tests.grade.cell.wire import Other, Raised, decode, encode

TRIALS = 3  # random inputs a check
NOTHING = 1e-12  # what is smaller is written as 0


@dataclass(eq=False)
class Check:
    """`inputs(rng)` makes the arguments; the answer has to equal the reference's within tolerances.

    least(rng) makes those of one question more, of the smallest sizes that the text allows.
    verify(got, args) judges instead, where many answers are right: it returns a sentence, or None
    if all is well.
    """

    label: str
    inputs: Callable
    points: float
    atol: float
    rtol: float
    trials: int
    verify: Callable | None
    least: Callable | None = None


@dataclass
class Mistake:
    """A wrong answer people give, and what to tell them."""

    hint: str
    edits: list[tuple[str, str]]


@dataclass(eq=False)
class Exercise:
    """See the module's text. probe: code that defines `probe(*args)`, how the answer is called.

    changes: the places of arguments that the answer may change; it leaves the others as they are.
    """

    id: str
    title: str
    name: str  # what the cell has to define
    source: str  # of the reference
    given: str  # code that the cell may rely on
    probe: str
    changes: tuple[int, ...] = ()
    checks: list[Check] = field(default_factory=list)
    mistakes: list[Mistake] = field(default_factory=list)

    @property
    def points(self) -> float:
        return sum(check.points for check in self.checks)

    @functools.cached_property
    def gives(self) -> set[str]:
        """Functions and classes among what is given."""
        kinds = ast.FunctionDef | ast.ClassDef
        return {node.name for node in ast.parse(self.given).body if isinstance(node, kinds)}

    @property
    def grade_id(self) -> str:
        """The id of its cell; nbgrader allows no dot."""
        return "ex-" + self.id.replace(".", "-")

    @property
    def job(self) -> dict:
        """What a process has to know that calls its answer."""
        return {key: getattr(self, key) for key in ("name", "given", "probe", "changes")}

    def check(
        self,
        label,
        inputs,
        *,
        points=1,
        atol=1e-5,
        rtol=1e-4,
        trials=TRIALS,
        verify=None,
        least=None,
    ) -> None:
        """Add a check."""
        trials += bool(least)
        self.checks.append(Check(label, inputs, points, atol, rtol, trials, verify, least))

    def mistake(self, hint: str, *edits: str) -> None:
        """Add a mistake: the reference with `edits`, old, new, old, new ..., replaced.

        Raises ValueError if an old piece is not in the reference.
        """
        pairs = list(zip(edits[::2], edits[1::2], strict=True))
        missing = [old for old, _ in pairs if old not in self.source]
        if missing:
            raise ValueError(f"exercise {self.id} has no {missing[0]!r} in its reference")
        self.mistakes.append(Mistake(hint, pairs))

    def wrong(self, mistake: Mistake) -> str:
        """The source of an answer with this mistake."""
        source = self.source
        for old, new in mistake.edits:
            source = source.replace(old, new)
        return source

    def run(self, source: str) -> Callable:
        """The probe over a source we trust, as the student's process would answer, but for its
        warnings: nobody would know them from those of the student's own code."""
        space = {"__name__": "__main__"}
        for part in (PREAMBLE, self.given, source, self.probe):
            exec(part, space)

        def call(args):
            torch.default_generator.manual_seed(0)
            with warnings.catch_warnings(action="ignore"):
                try:
                    value = space["probe"](*decode(encode(args), torch.from_numpy))
                except Exception as e:
                    value = Raised(type(e).__name__, str(e))
            return decode(encode(value))

        return call


GRADIENTS = """
    def probe(*args):
        *args, ask = args
        if ask == "values":
            return {name}(*args)
        for i in {graph}:
            args[i] = args[i].clone().requires_grad_()
        leaves = {{k: args[i].clone().requires_grad_() for i, k in {leaves}.items()}}
        for i, k in {leaves}.items():
            args[i] = leaves[k]
        found = {{}}
        out = {name}(*args)
        try:
            out = tuple(out) if {several} else (out,)
        except TypeError:  # one number
            return out
        for j, part in enumerate(out):
            if torch.is_tensor(part) and part.requires_grad:
                # Weighted, or in a sum of many numbers gradients could cancel.
                weights = torch.cos(torch.arange(float(part.numel()))).view(part.shape)
                total = (weights * part).sum()
                grads = torch.autograd.grad(
                    total, list(leaves.values()), allow_unused=True, retain_graph=True
                )
            else:
                grads = [None] * len(leaves)
            for (k, leaf), g in zip(leaves.items(), grads):
                which = f" of number {{j + 1}}" if {several} else ""
                g = torch.zeros_like(leaf) if g is None else g
                found[f"the gradient{{which}} for {{k}}"] = g
        return found
"""


def gradients(name: str, several: bool = False, graph: tuple = (), **leaves: int) -> str:
    """A probe that asks for "values" or for the "gradient" with respect to some arguments.

    name: of the function. several: whether it returns several tensors. graph: positions of further
    arguments that have a gradient, and nobody asks for it. leaves: names and positions of those
    that are asked for.
    """
    places = {i: k for k, i in leaves.items()}
    return GRADIENTS.format(name=name, several=several, graph=graph, leaves=places)


def exercise(id: str, title: str, *, given: tuple = (), probe: str = "", changes: tuple = ()):
    """Make an exercise of the function or class below.

    given: functions, classes, lines of code or other exercises that the answer may use. probe and
    changes: see Exercise.
    """

    def wrap(thing) -> Exercise:
        source = textwrap.dedent(inspect.getsource(thing))
        source = source[
            min(source.find(word) for word in ("\ndef ", "\nclass ") if word in source) + 1 :
        ]
        before = "\n\n".join(map(_text, given))
        name = thing.__name__
        call = textwrap.dedent(probe) or f"probe = {name}\n"
        return Exercise(id, title, name, source, before, call, changes)

    return wrap


def _text(given) -> str:
    if isinstance(given, Exercise | str):
        return getattr(given, "source", given)
    return textwrap.dedent(inspect.getsource(given))


@functools.cache
def everything() -> dict[str, Exercise]:
    """All exercises by id, in order."""
    found = {}
    for info in sorted(pkgutil.iter_modules(exercises.__path__), key=lambda m: m.name):
        module = importlib.import_module(f"{exercises.__name__}.{info.name}")
        found |= {e.id: e for e in vars(module).values() if isinstance(e, Exercise)}
    return dict(sorted(found.items(), key=lambda pair: [int(n) for n in pair[0].split(".")]))


def find(id: str) -> Exercise:
    """Raises KeyError, with the ids there are."""
    known = everything()
    if id not in known:
        raise KeyError(f"no exercise {id!r}; there are {', '.join(known)}")
    return known[id]


def different(got, want, check: Check) -> str | None:
    """In what `got` differs from `want`, as a sentence to the student; None if it does not."""
    if type(got) is Raised:
        if type(want) is Raised and got == want:
            return None
        return f"it raises {got.in_full()}"
    if type(want) is Raised:
        return f"it should raise {want} here"
    if type(got) is Other:
        return f"it returns {got}; expected {_kind(want)}"
    if isinstance(want, np.ndarray) or _is_number(want):
        return _different_numbers(got, want, check)
    if isinstance(want, list | tuple):
        if isinstance(got, np.ndarray) and got.ndim:
            got = list(got)  # np.quantile and others return an array where one asks for two numbers
        if not isinstance(got, list | tuple) or len(got) != len(want):
            return f"it returns {_kind(got)}; expected {_kind(want)}"
        for i, pair in enumerate(zip(got, want, strict=True)):
            if message := different(*pair, check):
                return f"item {i}: {message}"
        return None
    if isinstance(want, dict):  # a probe's findings
        if not isinstance(got, dict) or set(got) != set(want):
            return f"it returns {_kind(got)}, which is not what the text asks for"
        for key in want:
            if message := different(got[key], want[key], check):
                return f"{key}: {message}"
        return None
    if type(got) is type(want) and got == want:
        return None
    return f"it returns {got!r:.60}; expected {want!r:.60}"


def _is_number(x) -> bool:
    return isinstance(x, int | float | np.generic) and not isinstance(x, bool)


def _kind(x) -> str:
    if isinstance(x, np.ndarray):
        return f"an array {x.shape} of {x.dtype}"
    if isinstance(x, list | tuple):
        return f"a {type(x).__name__} of {len(x)}"
    return "nothing (None)" if x is None else f"a {type(x).__name__}"


def _array(items):
    """A list of numbers, or of lists of them, as an array; itself where it is none."""
    try:
        array = np.array(items)
    except ValueError:
        return items
    return array if array.dtype.kind in "biufc" else items


def _different_numbers(got, want, check):
    if isinstance(got, list | tuple) and (np.ndim(want) or len(got) == 1):
        got = _array(got)
    if not (isinstance(got, np.ndarray) or _is_number(got) or isinstance(got, bool)):
        return f"it returns {_kind(got)}; expected {_kind(want)}"
    got, want = np.asarray(got), np.asarray(want)
    if got.shape == (1,) and not want.ndim:  # one number
        got = got.reshape(())
    if got.shape != want.shape:
        return f"it has shape {got.shape}; expected {want.shape}"
    if (got.dtype.kind == "b") != (want.dtype.kind == "b"):
        return f"its values are {got.dtype}; expected {want.dtype}"
    if not np.isfinite(got).all() and np.isfinite(want).all():
        return "it contains NaN or infinity"
    if (got == want).all():  # most right answers, and faster than isclose
        return None
    if got.dtype.kind == "b":
        return "some of its truth values are wrong"
    close = np.isclose(got, want, atol=check.atol, rtol=check.rtol, equal_nan=True)
    if close.all():
        return None
    # Where it is furthest off; of what is barely off, one would believe that it is rounding.
    with np.errstate(invalid="ignore"):  # infinity less infinity
        off = np.where(close, 0, np.nan_to_num(np.abs(got - 1.0 * want), nan=np.inf))
    at = np.unravel_index(np.argmax(off), close.shape) if close.ndim else ()
    where = f" at {tuple(int(i) for i in at)}" if at else ""
    return f"it gives {_short(got[at])}{where}; expected {_short(want[at])}"


def _short(number) -> str:
    """A number in five digits; what rounding has left of 0 is 0."""
    return "0" if abs(number) < NOTHING else f"{number:.5g}"
