"""The smallest input at which an answer is wrong, as Python to paste."""

from __future__ import annotations

import functools
import math
import textwrap

import numpy as np
import torch

from tests.grade.cell.answer import PREAMBLE
from tests.grade.cell.wire import Raised, decode, encode
from tests.grade.exercise import Check, Exercise

LONGEST = 900  # characters of a call, ten lines; longer ones nobody reads, let alone pastes
MANY, WIDTH = 500, 88  # numbers of an array, characters of a line
DIGITS = 2  # of the numbers in it, where it fails with them, too
DTYPES = ("float64", "int64", "bool")  # what np.array makes of numbers by itself
DRAWS, TRIES = 20, 3  # inputs drawn of each check that failed, and how many are tried


class Unprintable(Exception):
    """A value that cannot be pasted, such as a function."""


def size(value) -> int:
    """How many numbers there are in a value."""
    if isinstance(value, dict):
        return sum(map(size, value.values()))
    if isinstance(value, list | tuple):
        return sum(map(size, value))
    return math.prod(value.shape) if hasattr(value, "shape") else 1


def candidates(wrong: list[tuple[Check, tuple]]) -> list[tuple[Check, tuple]]:
    """(check, inputs) to try, the smallest first: some that are drawn anew and are smaller than all
    that an answer has failed at, then some of those; each with few digits, and as it is."""
    least = min((size(args) for _, args in wrong), default=0)
    checks = dict.fromkeys(check for check, _ in wrong)
    small = [(n, c, i) for c in checks for i, n in enumerate(_sizes(c)) if n < least]
    small.sort(key=lambda one: one[0])
    drawn = [(check, _draw(check, i)) for _, check, i in small[:TRIES]]
    known = sorted(wrong, key=lambda pair: size(pair[1]))
    return [(c, a) for c, args in drawn + known[:TRIES] for a in (rounded(args), args)]


def _draw(check, i):
    return ((not i and check.least) or check.inputs)(np.random.default_rng(i))


@functools.cache
def _sizes(check) -> list[int]:
    """How large the inputs are that are drawn: they hang on the check alone, not on the answer."""
    return [size(_draw(check, i)) for i in range(DRAWS)]


def rounded(value):
    """A value whose numbers have few digits, but for those that rise, such as times: they get as
    many as it takes to rise still."""
    if isinstance(value, dict):
        return {key: rounded(x) for key, x in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(map(rounded, value))
    if torch.is_tensor(value):
        return torch.from_numpy(np.asarray(rounded(value.numpy())))
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind == "f":
        for digits in range(DIGITS, 18):
            few = [float(f"{x:.{digits}g}") for x in np.ravel(value)]
            if not _rises(value) or _rises(few):
                break
        return np.array(few, value.dtype).reshape(value.shape)[()]
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    return value


def _rises(numbers) -> bool:
    return np.ndim(numbers) == 1 and bool((np.diff(numbers) > 0).all())


def written(value) -> str:
    """A value as Python in a notebook has it. Raises Unprintable."""
    if isinstance(value, np.generic):
        value = value.item()
    if torch.is_tensor(value):
        array = value.detach().numpy()
        plain = value.dtype in (torch.float32, torch.int64, torch.bool)
        dtype = "" if plain else f"dtype={value.dtype}"
        grad = "requires_grad=True" if value.requires_grad else ""
        return f"torch.tensor({', '.join(filter(None, (_numbers(array), dtype, grad)))})"
    if isinstance(value, np.ndarray):
        dtype = "" if value.dtype.name in DTYPES else f", np.{value.dtype.name}"
        return f"np.array({_numbers(value)}{dtype})"
    if isinstance(value, list | tuple):
        inside = ", ".join(map(written, value)) + ("," if len(value) == 1 else "")
        return f"[{inside.rstrip(',')}]" if isinstance(value, list) else f"({inside})"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{k!r}: {written(x)}' for k, x in value.items())}}}"
    if isinstance(value, float) and not np.isfinite(value):
        return f'float("{value}")'
    if value is None or isinstance(value, bool | int | float | str):
        return repr(value)
    raise Unprintable


def _numbers(array: np.ndarray) -> str:
    """The numbers of an array, in brackets."""
    if array.dtype.kind not in "biuf" or not np.isfinite(array).all() or not 0 < array.size < MANY:
        raise Unprintable
    text = np.array2string(array, separator=", ", threshold=MANY, formatter={"all": str})
    return textwrap.fill(" ".join(text.split()), WIDTH)


@functools.cache
def pasted(exercise: Exercise) -> bool:
    """Whether an exercise has inputs that can be pasted. A class is more than a call; functions,
    networks and a client of PyBullet cannot be written, and films are too long."""
    if exercise.source.startswith(("class ", f"def {exercise.name}(client")):
        return False
    rng = np.random.default_rng(0)
    drawn = [
        min((make(rng) for make in [c.inputs] * TRIES + [c.least or c.inputs]), key=size)
        for c in exercise.checks
    ]
    return any(tried(exercise, rounded(args))[1] for args in drawn)


def tried(exercise: Exercise, args: tuple) -> tuple[object, str]:
    """(the reference's value, how it was called) where the probe gets these inputs.

    The call is "" where it cannot be pasted, or where it would not show what the probe sees: one
    that calls several times, or does more with the value than to ask for its gradient.
    """
    space: dict = {"__name__": "__main__"}
    for part in (PREAMBLE, exercise.given, exercise.source):
        exec(part, space)
    calls, reference = {}, space[exercise.name]

    def recorded(*given, **named):
        text = _call(exercise.name, given, named)
        value = reference(*given, **named)
        calls[text] = encode(value)
        return value

    space[exercise.name] = recorded
    exec(exercise.probe, space)
    torch.default_generator.manual_seed(0)
    try:
        value = encode(space["probe"](*decode(encode(args), torch.from_numpy)))
    except Exception as e:
        value = encode(Raised(type(e).__name__, str(e)))
    text = next(iter(calls), "") if len(calls) == 1 else ""
    told = "requires_grad" in text or value in calls.values()
    return decode(value), text if told else ""


def _call(name: str, given: tuple, named: dict) -> str:
    try:
        parts = [*map(written, given), *(f"{key}={written(x)}" for key, x in named.items())]
    except Unprintable:
        return ""
    call = f"{name}({', '.join(parts)})"
    return call if len(call) <= LONGEST else ""
