"""Reading a submission: which cell answers which exercise. Nothing of it is run here."""

from __future__ import annotations

import ast
import functools
import json
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from tests.grade.cell.answer import bound, is_stub
from tests.grade.exercise import Exercise, everything
from tests.grade.files import RELEASED, File, read_all

PARTS = 500_000  # lists and objects of a notebook's JSON; a long one has 5,000
CELLS = 1_000  # of code; the course's have 30
LENGTH = 200_000  # characters of a cell
SOURCES = 1_000_000  # characters of all cells; the course's have 20,000
CONFLICT = re.compile(r"^<{7} ", re.MULTILINE)
# A line for IPython: %magic, !shell, names = %magic, ?name, name?. What %time times is Python.
MAGIC = re.compile(
    r"(?P<indent>\s*)(?:(?P<names>[A-Za-z_][\w., ]*)=\s*)?"
    r"(?:%time[ \t]+(?P<timed>.+)|[%!]|\?{1,2}[\w.%]|%?[\w.*]+\?{1,2}\s*$)"
)
PIECE = re.compile(r"\"\"\"|'''|\"(?:\\.|[^\"\\\n])*\"?|'(?:\\.|[^'\\\n])*'?|#.*|[\[({]|[\])}]")
ENDS = {quotes: re.compile(rf"(?:\\.|[^\\])*?{quotes}", re.DOTALL) for quotes in ('"""', "'''")}


class Unreadable(Exception):
    """Not a notebook; the message says why, to the student."""


@dataclass
class Cell:
    """A code cell.

    exercise: the id of the one it is marked for, by grade id or its first line; or "". course:
    whether it stands in the released notebooks as it is. defines: the names that its top-level
    statements bind, but for functions and classes as they were handed out. checks: the ids of the
    exercises it checks. Both are empty if it does not parse.
    """

    source: str
    exercise: str
    course: bool = False

    def __post_init__(self):
        look = _look_at_course if self.course else _look
        self.defines, self.checks = look(self.source)


def _look(source: str) -> tuple[set[str], set[str]]:
    """`Cell.defines` and `Cell.checks`."""
    tree = _parse(source)
    body = [node for node in (tree.body if tree else []) if not is_stub(node)]
    checks = set().union(*map(_checked, body)) if "check" in source else set()
    return set().union(*map(bound, body)), checks


_look_at_course = functools.cache(_look)  # most cells of a class are the same


@dataclass
class Notebook:
    """A notebook that somebody handed in. number: which of the course's it is, "" if none."""

    name: str
    cells: list[Cell]
    number: str = ""

    def __post_init__(self):
        votes = Counter(c.exercise.split(".")[0] for c in self.cells if c.exercise)
        theirs = [c for c in self.cells if not c.course]
        for e in everything().values():
            votes[e.id.split(".")[0]] += any(e.name in c.defines for c in theirs)
        self.number = max(votes, key=votes.get) if votes.total() else ""


def read(path: Path) -> Notebook:
    """Raises Unreadable."""
    return parse(read_all([(path, path.name)])[0][0])


def parse(file: File) -> Notebook:
    """A notebook out of a file, in time and memory that its size limits. Raises Unreadable."""
    if file.why:
        raise Unreadable(file.why)
    if not file.data.strip(b"\0 \t\r\n"):
        raise Unreadable("no Jupyter notebook: the file is empty")
    if sum(map(file.data.count, (b"[", b"{"))) > PARTS:
        raise Unreadable(f"no notebook of this course: more than {PARTS:,} lists and objects")
    try:
        found = json.loads(file.data)["cells"]
        code = [c for c in found if isinstance(c, dict) and c.get("cell_type") == "code"]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as e:
        raise Unreadable(_why(file, e)) from None
    if len(code) > CELLS:
        raise Unreadable(f"no notebook of this course: {len(code):,} cells")
    cells: list[Cell] = []
    for cell in filter(None, map(_cell, code)):
        cells.append(cell)
        if sum(len(c.source) for c in cells) > SOURCES:
            raise Unreadable(
                f"no notebook of this course: more than {SOURCES:,} characters of code"
            )
    return Notebook(file.name, cells)


def _why(file: File, error: Exception) -> str:
    """Why a file is no notebook, to the student."""
    if place := re.search(r"^\s*<{7} ", file.text, re.MULTILINE):
        line = file.text.count("\n", 0, place.start()) + 1
        return f"a merge conflict is left in it (<<<<<<<, near line {line}): resolve it, save again"
    if file.text.lstrip("\ufeff \r\n\t").startswith("<"):
        return "no Jupyter notebook but a web page: download the file itself"
    if isinstance(error, ValueError) and "\ufffd" in file.text:
        return "no Jupyter notebook: its text is not UTF-8"
    if isinstance(error, json.JSONDecodeError) and error.pos >= len(file.text.rstrip()) - 1:
        return "no Jupyter notebook: its end is missing"
    return f"no Jupyter notebook ({type(error).__name__})"


def _cell(cell) -> Cell | None:
    """A code cell; None if it is damaged, or too long to be an answer."""
    try:
        text = cell["source"] if isinstance(cell["source"], str) else "".join(cell["source"])
        if len(text) > LENGTH:
            return None
        if text.strip() in _released():
            source, course = text.strip(), True
        else:
            source, course = _plain(text), False
        return Cell(source, _marked(cell, source), course)
    except (KeyError, TypeError, AttributeError, RecursionError, MemoryError):
        return None


def _marked(cell, source: str) -> str:
    """The exercise a cell is marked for."""
    note = cell.get("metadata", {}).get("nbgrader", {})
    grade_id = note.get("grade_id") if isinstance(note, dict) else None
    title = re.match(r"#\s*Exercise (\d+\.\d+)\b", source)
    known = everything()
    by_title = title[1] if title and title[1] in known else ""
    return _by_grade_id().get(grade_id, by_title) if isinstance(grade_id, str) else by_title


@functools.cache
def _by_grade_id() -> dict[str, str]:
    return {e.grade_id: id for id, e in everything().items()}


def _plain(text: str) -> str:
    """Cell source as Python: without IPython's own lines (%magic, !shell, name?)."""
    text = re.sub(r"\A\s*%%.*\n", "", text)  # such as %%time, above a cell that is Python
    if _parse(text):
        return text
    from IPython.core.inputtransformer2 import TransformerManager  # slow, and seldom needed

    try:  # prompts and indents; its other transformations take time as the square of the length
        lines = text.splitlines(keepends=True)
        for transform in TransformerManager().cleanup_transforms:
            lines = transform(lines)
    except Exception:  # whatever a stranger's text does to it
        return text
    return _without_magic(lines)


def _without_magic(lines: list[str]) -> str:
    """Python in place of IPython's lines: nothing, or None where they have a value."""
    done, quotes, depth, goes_on, magic = [], "", 0, False, False
    for line in lines:
        if not goes_on:
            magic = not quotes and not depth and MAGIC.match(line)
        if not magic:
            quotes, depth = _inside(line, quotes, depth)
            done.append(line)
        elif not goes_on:
            timed = magic["timed"] if magic["timed"] and _parse(magic["timed"]) else ""
            value = f"{magic['names']}= {timed or None}" if magic["names"] else timed or "pass"
            done.append(f"{magic['indent']}{value}\n")
        goes_on = line.rstrip("\r\n").endswith("\\")
    return "".join(done)


def _inside(line: str, quotes: str, depth: int) -> tuple[str, int]:
    """The string of three quotes, and how many brackets, that the end of a line is inside of, from
    those of its start."""
    at = 0
    while True:
        if quotes:
            end = ENDS[quotes].match(line, at)
            if not end:
                return quotes, depth
            quotes, at = "", end.end()
        piece = PIECE.search(line, at)
        if not piece:
            return quotes, depth
        at = piece.end()
        if piece[0] in ENDS:
            quotes = piece[0]
        elif piece[0] in "[({":
            depth += 1
        elif piece[0] in "])}":
            depth = max(0, depth - 1)


@functools.lru_cache(maxsize=1)  # `_plain` asks first, and then `_look`
def _parse(source: str) -> ast.Module | None:
    try:
        return ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return None


def _checked(node) -> set[str]:
    """Ids that a statement calls `check` with."""
    calls = (n for n in ast.walk(node) if isinstance(n, ast.Call) and n.args)
    named = (n.args[0] for n in calls if isinstance(n.func, ast.Name) and n.func.id == "check")
    return {a.value for a in named if isinstance(a, ast.Constant) and isinstance(a.value, str)}


@functools.cache
def _released() -> set[str]:
    """The code cells of the course's notebooks, but for those of the exercises."""
    found = set()
    for path in RELEASED.glob("*.ipynb"):
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            text = "".join(cell["source"]).strip()
            if cell["cell_type"] == "code" and not _marked(cell, text) and _parse(text):
                found.add(text)
    return found


@dataclass
class Answer:
    """The cell that answers an exercise, and those around it, in the notebook's order.

    helpers, above it, and below: (source, whether only its definitions matter, since it is one of
    the course's). own: whether the student has written what the exercise may rely on (its `given`),
    too. others: further cells of the notebook that answer it.
    """

    source: str
    helpers: list[tuple[str, bool]]
    where: str
    elsewhere: str = ""  # another notebook of the submission that answers the exercise, too
    below: list[tuple[str, bool]] = field(default_factory=list)
    own: bool = False
    open: bool = False  # nothing but what was handed out
    broken: bool = False  # a merge conflict is left in it
    others: list[Answer] = field(default_factory=list)


def answer(exercise: Exercise, books: list[Notebook]) -> Answer | None:
    """What answers an exercise in the notebooks of a submission; None if there is nothing.

    A cell counts that binds its name by more than the stub: marked for it, or in a notebook of the
    exercise's number. Else a cell marked for it. Of several notebooks the last counts.
    """
    number = exercise.id.split(".")[0]
    found = []
    for book in books:
        places = [
            i
            for i, cell in enumerate(book.cells)
            if exercise.name in cell.defines and not cell.course
            and (cell.exercise == exercise.id or book.number == number)
        ]  # fmt: skip
        if places:
            found.append((book, _by_rank(exercise, book, places)))
    if not found:
        return _untouched(exercise, books)
    book, places = found[-1]
    best, *others = [_around(exercise, book, i) for i in places]
    best.others = others
    sources = [(b.name, b.cells[p[0]].source) for b, p in found[:-1]]
    best.elsewhere = next((name for name, text in sources if text != best.source), "")
    return best


def _by_rank(exercise: Exercise, book: Notebook, places: list[int]) -> list[int]:
    """Which of several cells that bind an exercise's name to grade, the likeliest first.

    What stands when the notebook comes to its last check of the exercise; the marked cell; what
    stands at the notebook's end.
    """
    checks = [i for i, cell in enumerate(book.cells) if exercise.id in cell.checks]
    before = [i for i in places if checks and i <= checks[-1]]
    marked = [i for i in places if book.cells[i].exercise == exercise.id]
    return list(dict.fromkeys([*before[-1:], *marked[-1:], places[-1]]))


def _untouched(exercise: Exercise, books: list[Notebook]) -> Answer | None:
    """The cell marked for an exercise where none defines its name."""
    cells = [(b, i) for b in books for i, c in enumerate(b.cells) if c.exercise == exercise.id]
    if not cells:
        return None
    found = _around(exercise, *cells[-1])
    tree = _parse(found.source)
    found.open = bool(tree) and any(map(is_stub, tree.body))
    found.broken = not tree and bool(CONFLICT.search(found.source))
    return found


def _around(exercise: Exercise, book: Notebook, own: int) -> Answer:
    cells = [(cell.source, cell.course) for cell in book.cells]
    given = exercise.gives & set().union(*(c.defines for c in book.cells if not c.course))
    helpers, below = cells[:own], cells[own + 1 :]
    return Answer(cells[own][0], helpers, book.name, below=below, own=bool(given))
