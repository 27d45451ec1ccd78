"""A student's answer: from the cells of a notebook to names, and from inputs to what it returns.

The sandbox's process and `check()` in the notebook both go through here, so that they agree.
"""

import __future__

import ast
import contextlib
import functools
import importlib.machinery
import linecache
import re
import signal
import time
import traceback
from types import CodeType

if __package__:
    from tests.grade.cell import wire
else:  # in the sandbox, which has this folder and nothing else of the kit
    import wire

PREAMBLE = """
import math
import numpy as np
import torch
import torch.nn.functional as F
from torch import nn
"""
FORBIDDEN = ("lbw_minimal", "tasks", "solutions", "tests")
DRAWING = ("matplotlib", "IPython")
STUB = 'raise NotImplementedError("your lines here")'
# What Python calls the file of an answer: here, in JupyterLab and its kin, in IPython's terminal.
OWN = re.compile(r"^your cell$|[/\\]ipykernel_\d+[/\\]|^<ipython-input")
CELL, CELLS = 1.0, 3.0  # s of processor time for a cell beside the answer, and for all of them
FUTURE = {name: getattr(__future__, name).compiler_flag for name in __future__.all_feature_names}


class Hidden:
    """Import hook: the package that holds the answers is not here."""

    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in FORBIDDEN:
            raise ImportError(own_lines(name))


def own_lines(name: str) -> str:
    return (
        f"{name} is not here while an exercise is checked: answer with your own lines, and write "
        "numbers as numbers"
    )


class Blank:
    """What drawing is done with in the sandbox: it takes any call, draws nothing, costs nothing."""

    __path__ = []

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return Blank()

    def __call__(self, *args, **kwargs):
        return Blank()

    def __iter__(self):
        return iter(())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return False


class Drawing:
    """Import hook: libraries that draw, as `Blank`."""

    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in DRAWING:
            return importlib.machinery.ModuleSpec(name, self)

    def create_module(self, spec):
        return Blank()

    def exec_module(self, module):
        pass


# What a statement does to the notebook's names


def bound(node) -> set[str]:
    """Names that a statement binds, inside its ifs, loops and tries, too."""
    names, open_nodes = set(), [node]
    while open_nodes:
        n = open_nodes.pop()
        if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.add(n.name)
            continue
        if isinstance(n, ast.Lambda | ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp):
            continue
        if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store):
            names.add(n.id)
        elif isinstance(n, ast.alias):
            names.add((n.asname or n.name).split(".")[0])
        open_nodes += ast.iter_child_nodes(n)
    return names


def quiet(node) -> bool:
    """Whether a statement only defines: an import, a function, a class, a value without a call."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Import | ast.ImportFrom):
        return True
    if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
        return False
    if isinstance(node.value, ast.Lambda):
        return True
    return not any(isinstance(n, ast.Call | ast.Await) for n in ast.walk(node.value))


def is_stub(node) -> bool:
    """Whether a function, or each one in a class, has nothing but the line that was handed out."""
    if not isinstance(node, ast.FunctionDef | ast.ClassDef):
        return False
    if isinstance(node, ast.FunctionDef) and not _is_bare(node.body):
        return False
    bodies = [n.body for n in ast.walk(node) if isinstance(n, ast.FunctionDef)]
    return bool(bodies) and all(map(_is_bare, bodies))


def _is_bare(body) -> bool:
    says = isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant)
    bare = len(body) == 1 + says and isinstance(body[-1], ast.Raise)
    return bare and ast.unparse(body[-1]) == STUB_TEXT


STUB_TEXT = ast.unparse(ast.parse(STUB))


class Statement:
    """A statement of a cell, looked at once. flags: of the cell's imports from __future__."""

    def __init__(self, node, label: str, flags: int):
        self.node, self.label, self.flags = node, label, flags
        self.stub, self.quiet = is_stub(node), quiet(node)

    @functools.cached_property
    def code(self) -> CodeType:
        """Raises SyntaxError for what parses and means nothing, such as a lone return."""
        tree, flags = ast.Module([self.node], []), self.flags | ast.PyCF_ALLOW_TOP_LEVEL_AWAIT
        return compile(tree, self.label, "exec", flags, dont_inherit=True)


@functools.lru_cache(maxsize=1000)
def statements(source: str, label: str = "another cell") -> list[Statement]:
    """Those of a cell. Raises SyntaxError."""
    tree, flags = ast.parse(source, label), 0
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.module == "__future__":
            for alias in node.names:
                flags |= FUTURE.get(alias.name, 0)
    return [Statement(node, label, flags) for node in tree.body]


def learn(source: str) -> None:
    """Compile what a cell of the course defines, so that processes forked from here need not."""
    for statement in statements(source):
        if statement.quiet and not statement.stub:
            statement.code  # noqa: B018


# From cells to names


class Shell:
    """What a notebook's cells may call beside Python; here it does nothing."""

    def __getattr__(self, name):
        return lambda *args, **kwargs: None


class TooLong(BaseException):
    """A cell beside the answer has used up its time."""


class Cells:
    """The names that a notebook's cells define, run statement by statement.

    A statement that fails costs itself: it may be a plot, or ask for what is not here. `why` says
    of the names it would have bound why they are missing.
    """

    def __init__(self, names: dict, definitions_only: bool = False):
        self.names, self.why, self.failed = names, {}, None
        self.definitions_only = definitions_only
        self.left = CELLS

    def run(self, source: str, definitions_only: bool = False, label: str = "another cell") -> None:
        """Run a cell but for stubs, or only its definitions. Raises SyntaxError."""
        found = statements(source, label)
        self.failed, seconds = None, max(0.2, min(CELL, self.left))
        definitions_only |= self.definitions_only or self.left <= 0
        before = time.process_time()
        for statement in found:
            if statement.stub or (definitions_only and not statement.quiet):
                continue
            self._statement(statement, seconds - (time.process_time() - before))
        if label == "another cell":
            self.left -= time.process_time() - before

    def _statement(self, statement: Statement, seconds: float):
        code = statement.code
        try:
            if seconds <= 0 and not statement.quiet:
                raise TooLong
            with within(max(seconds, 0.2)):
                execute(code, self.names)
        except TooLong:
            why = TimeoutError(f"it ran for more than {CELL:g} s, and was left out")
            self._lost(statement.node, why)
        except BaseException as e:
            self._lost(statement.node, e)

    def _lost(self, node, e):
        """Remember why; where a missing name was the reason, the reason why that one is missing."""
        if isinstance(e, NameError) and e.name in self.why:
            e = self.why[e.name]
        self.failed = self.failed or e
        self.why |= {name: e for name in bound(node) if name not in self.names}

    def fill(self, below: list) -> None:
        """Run cells from below the answer for the names that are not there yet."""
        have = dict(self.names)
        self.others(below)
        self.names.update(have)

    def others(self, cells: list) -> None:
        for source, definitions_only in cells:
            with contextlib.suppress(SyntaxError, ValueError, RecursionError, MemoryError):
                self.run(source, definitions_only)


def execute(code: CodeType, names: dict) -> None:
    """Run a statement; one that awaits something, which Jupyter allows at the top, to its end."""
    awaits = eval(code, names)
    with contextlib.suppress(StopIteration):
        while awaits:
            awaits.send(None)


@contextlib.contextmanager
def within(seconds: float):
    """Raise TooLong in a block that takes more processor time, or five times as long asleep.

    Where the system has no such clocks, on Windows, students run their own cells, without a limit.
    """
    if not hasattr(signal, "setitimer"):
        yield
        return

    def stop(*_):
        raise TooLong

    clocks = ((signal.SIGPROF, signal.ITIMER_PROF, 1), (signal.SIGALRM, signal.ITIMER_REAL, 5))
    for number, clock, times in clocks:
        signal.signal(number, stop)
        signal.setitimer(clock, times * seconds)
    try:
        yield
    finally:
        for _, clock, _ in clocks:
            signal.setitimer(clock, 0)


def define(job: dict) -> Cells:
    """The names that an answer's cell and the cells around it define. Raises what it raises.

    job: source, of the answer; helpers, the cells above it, and below, each with whether only its
    definitions are run; name, what has to be defined; given, code that the answer may rely on, and
    over, whether it also replaces what the student has written by these names.
    """
    names = {"__name__": "__main__", "get_ipython": Shell, "display": print, "check": Shell().check}
    exec(compile(PREAMBLE + job["given"], "given", "exec"), names)
    cells = Cells(names, job["definitions_only"])
    cells.others(job["helpers"])
    lines = job["source"].splitlines(keepends=True)
    linecache.cache["your cell"] = (len(job["source"]), None, lines, "your cell")
    cells.run(job["source"], label="your cell")
    failed = cells.failed
    if job["name"] not in names and job["below"]:
        cells.fill(job["below"])
        cells.run(job["source"], label="your cell")
    if job["name"] not in names:
        raise failed or NameError(f"this cell does not define {job['name']}")
    if job["over"]:
        exec(compile(job["given"], "given", "exec"), names)
    return cells


# From inputs to what the answer returns


class Watched:
    """An answer's function, which also notes what it leaves of its arguments otherwise.

    free: the places of arguments that it may change. said: the kind of the first change, see
    `state`, or "".
    """

    def __init__(self, function, free):
        self.function, self.free = function, set(free)
        self.said, self.inside = "", False

    def __call__(self, *args, **named):
        if self.inside:  # it calls itself, with what may be its own
            return self.function(*args, **named)
        kept = [x for i, x in enumerate(args) if i not in self.free] + [*named.values()]
        before, self.inside = [state(x) for x in kept], True
        try:
            value = self.function(*args, **named)
        finally:
            self.inside = False
        for old, new in zip(before, map(state, kept), strict=True):
            self.said = self.said or next((kind for kind in old if old[kind] != new[kind]), "")
        return value


def state(x) -> dict:
    """What an answer has to leave as it is of an argument, by kinds: numbers, whether tensors in
    it have a gradient, a network's mode, and gradients that have been summed up."""
    found = list(_tensors(x))
    return {
        "values": [wire.encode(part) for part in (x, *found)],
        "graph": [(t.requires_grad, t.is_leaf) for t in found],
        "mode": [part.training for part in x.modules()] if hasattr(x, "modules") else [],
        "grad": [wire.encode(t.grad if t.is_leaf else None) for t in found],
    }


def _tensors(x):
    """The tensors of an argument, in lists, dictionaries and networks, too."""
    if hasattr(x, "requires_grad"):
        yield x
    elif hasattr(x, "state_dict"):
        yield from (*x.parameters(), *x.buffers())
    elif isinstance(x, list | tuple | dict):
        for part in x.values() if isinstance(x, dict) else x:
            yield from _tensors(part)


def watch(names: dict, job: dict) -> Watched:
    """Define the probe among an answer's names, and watch the function that it calls.

    job: see `define`; probe, code; changes, the places of arguments that the answer may change.
    A class is not watched: what it changes is its own.
    """
    watched = Watched(names[job["name"]], job["changes"])
    if not isinstance(watched.function, type):
        names[job["name"]] = watched
    exec(compile(job["probe"], "the check", "exec"), names)
    return watched


def ask(probe, watched: Watched, request: bytes, catch=Exception):
    """(what the probe returns or raises, the kind of what it changed of its arguments or "", the
    exception)."""
    import torch

    watched.said = ""
    args = wire.decode(request, torch.from_numpy)
    torch.default_generator.manual_seed(0)  # not those of devices, which take a while
    trains = torch.is_grad_enabled()
    try:
        value = probe(*args)
    except catch as e:
        return raised(e), watched.said, e  # the probe may raise at what has been changed
    if trains and not torch.is_grad_enabled():
        torch.set_grad_enabled(True)
        why = "it leaves autograd switched off; `with torch.no_grad():` switches it on again"
        value = wire.Raised("RuntimeError", why)
    return value, watched.said or ("values" if wire.encode(args) != request else ""), None


def raised(e: BaseException) -> wire.Raised:
    """What was raised, and the last line of the student's cells on the way there."""
    line = ""
    for frame, number in traceback.walk_tb(e.__traceback__):
        name = frame.f_code.co_filename
        if OWN.search(name):
            line = f"line {number}: {linecache.getline(name, number).strip()}".rstrip(": ")
    return wire.Raised(type(e).__name__, str(e)[:1000], line[:200])


def explained(raised: wire.Raised, e, why: dict) -> wire.Raised:
    """What was raised, with the reason if it is a name that some cell failed to define."""
    reason = why.get(getattr(e, "name", None)) if isinstance(e, NameError) else None
    if reason is None:
        return raised
    if isinstance(reason, ImportError):  # what is missing was to be imported
        return wire.Raised(type(reason).__name__, str(reason)[:1000])
    said = f"{type(reason).__name__}: {str(reason)[:200]}"
    return wire.Raised(raised, f"{raised.text} (the cell had failed: {said})", raised.line)
