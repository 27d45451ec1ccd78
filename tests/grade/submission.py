"""Reading a submission: which cell answers which exercise. Nothing of it is run here."""

from __future__ import annotations

import ast
import builtins
import json
import re
import symtable
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from tests.grade.exercise import Exercise, everything

MOST = 20 << 20  # bytes of a notebook; those of the course have 0.1 MB
STUB = 'raise NotImplementedError("your lines here")'
RELEASED = Path(__file__).resolve().parents[2] / "notebooks"
LIBRARIES = {"math", "np", "torch", "F", "nn"}  # what every exercise may use


class Unreadable(Exception):
    """Not a notebook; the message says why, to the student."""


@dataclass
class Cell:
    """A code cell.

    exercise: the id of the one it is marked for, by grade id or its first line; or "". body: its
    top-level statements, but for functions and classes as they were handed out; none if it does not
    parse. defines: the names these define.
    """

    source: str
    exercise: str

    def __post_init__(self):
        tree = _parse(self.source)
        self.body = [node for node in (tree.body if tree else []) if not _is_stub(node)]
        self.defines = set().union(*map(_defined, self.body))


@dataclass
class Notebook:
    """A notebook that somebody handed in. number: which of the course's it is, "" if none."""

    name: str
    cells: list[Cell]
    number: str = ""

    def __post_init__(self):
        votes = Counter(c.exercise.split(".")[0] for c in self.cells if c.exercise)
        for e in everything().values():
            votes[e.id.split(".")[0]] += any(e.name in c.defines for c in self.cells)
        self.number = max(votes, key=votes.get) if votes.total() else ""


def read(path: Path) -> Notebook:
    """Raises Unreadable."""
    if path.is_symlink() or not path.is_file():
        raise Unreadable("not a plain file")
    if path.stat().st_size > MOST:
        raise Unreadable(
            f"{path.stat().st_size >> 20} MB: a notebook of this course has less than {MOST >> 20}"
        )
    try:
        found = json.loads(path.read_bytes().decode("utf-8-sig"))["cells"]
        code = [(c, _plain(c["source"])) for c in found if c["cell_type"] == "code"]
        return Notebook(path.name, [Cell(source, _marked(c, source)) for c, source in code])
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as e:
        raise Unreadable(f"no Jupyter notebook ({type(e).__name__})") from None


def _marked(cell, source: str) -> str:
    """The exercise a cell is marked for."""
    note = cell.get("metadata", {}).get("nbgrader", {})
    grade_id = note.get("grade_id") if isinstance(note, dict) else None
    title = re.match(r"#\s*Exercise (\d+\.\d+)\b", source)
    known = everything()
    by_title = title[1] if title and title[1] in known else ""
    return next((id for id, e in known.items() if e.grade_id == grade_id), by_title)


def _plain(source) -> str:
    """Cell source as Python: IPython's own lines (%magic, !shell, name?) become calls to it."""
    text = source if isinstance(source, str) else "".join(source)
    text = re.sub(r"\A\s*%%.*\n", "", text)  # such as %%time, above a cell that is Python
    if _parse(text):
        return text
    from IPython.core.inputtransformer2 import TransformerManager  # slow, and seldom needed

    try:
        return TransformerManager().transform_cell(text)
    except Exception:  # whatever a stranger's text does to it
        return text


def _parse(source: str) -> ast.Module | None:
    try:
        tree = ast.parse(source)
        ast.unparse(tree)  # what is nested too deep for that is for what comes, too
        return tree
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return None


def _is_stub(node) -> bool:
    """Whether a body in a function or class has nothing but the line that was handed out."""
    bodies = [n.body for n in ast.walk(node) if isinstance(n, ast.FunctionDef)]
    stub = ast.unparse(ast.parse(STUB))
    return any(ast.unparse(body[-1]) == stub and _bare(body) for body in bodies)


def _bare(body) -> bool:
    """Whether a body has one statement, beside its docstring."""
    return len(body) == 1 or (len(body) == 2 and isinstance(body[0], ast.Expr))


def _defined(node) -> set[str]:
    """Names that a top-level statement defines, if it only defines; "*" if nobody knows which."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return {node.name}
    if isinstance(node, ast.Import | ast.ImportFrom):
        return {(alias.asname or alias.name).split(".")[0] for alias in node.names}
    if isinstance(node, ast.Assign | ast.AnnAssign) and node.value and not _busy(node.value):
        targets = getattr(node, "targets", None) or [node.target]
        names = [t.elts if isinstance(t, ast.Tuple | ast.List) else [t] for t in targets]
        flat = [t for some in names for t in some]
        return {t.id for t in flat} if all(isinstance(t, ast.Name) for t in flat) else set()
    return set()


def _busy(value) -> bool:
    """Whether an expression calls anything but Python and the libraries; a lambda calls nothing."""
    if isinstance(value, ast.Lambda):
        return False
    if isinstance(value, ast.Await):
        return True
    if isinstance(value, ast.Call):
        root = value.func
        while isinstance(root, ast.Attribute):
            root = root.value
        if not isinstance(root, ast.Name) or root.id not in LIBRARIES | set(dir(builtins)):
            return True
    return any(map(_busy, ast.iter_child_nodes(value)))


@dataclass
class Answer:
    """The cell that answers an exercise, what it uses of other cells, and where it stands."""

    source: str
    helpers: list[str]
    where: str
    elsewhere: str = ""  # another notebook of the submission that answers the exercise, too


def answer(exercise: Exercise, books: list[Notebook]) -> Answer | None:
    """What answers an exercise in the notebooks of a submission; None if there is nothing.

    A cell marked for it that defines its name with more than the stub; else another cell that does,
    in a notebook of the exercise's number; else a cell marked for it. Of several the last counts,
    and of several notebooks the one that is called as it was released.
    """
    number = exercise.id.split(".")[0]
    books = sorted(books, key=lambda book: (RELEASED / book.name).is_file())
    cells = [(book, i, cell) for book in books for i, cell in enumerate(book.cells)]
    marked = [place for place in cells if place[2].exercise == exercise.id]
    others = [place for place in cells if not place[2].exercise and place[0].number == number]
    done = [place for place in marked if exercise.name in place[2].defines]
    found = done or [place for place in others if exercise.name in place[2].defines] or marked
    if not found:
        return None
    book, i, cell = found[-1]
    rest = [b.name for b, _, c in found if b is not book and c.source != cell.source]
    helpers = _helpers(book.cells, i, exercise)
    return Answer(cell.source, helpers, book.name, rest[-1] if rest else "")


def _helpers(cells: list[Cell], own: int, exercise: Exercise) -> list[str]:
    """Imports, functions and constants of other cells that cell `own` uses, in notebook order.

    Of several definitions of a name the last above the cell counts, else the first below.
    """
    source = cells[own].source
    known = set(dir(builtins)) | LIBRARIES
    for text in (exercise.given, source):
        known |= {name for node in getattr(_parse(text), "body", []) for name in _defined(node)}
    offers = []  # (cell, names, text)
    for i, cell in enumerate(cells):
        offers += [(i, _defined(n), ast.unparse(n)) for n in cell.body if i != own]
    wanted = _names(source) - known
    taken = {k for k, (_, names, _) in enumerate(offers) if "*" in names}
    while wanted:
        name = wanted.pop()
        known.add(name)
        places = [k for k, (_, names, _) in enumerate(offers) if name in names]
        above = [k for k in places if offers[k][0] < own]
        for k in [*above[-1:], *places][:1]:
            taken.add(k)
            wanted |= _names(offers[k][2]) - known
    return [offers[k][2] for k in sorted(taken)]


def _names(source: str) -> set[str]:
    """Names that `source` takes from outside."""
    try:
        tables = [symtable.symtable(source, "cell", "exec")]
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return set()
    found = set()
    for table in tables:
        tables += table.get_children()
        for name in table.get_symbols():
            outside = name.is_global() if table.get_type() != "module" else not name.is_assigned()
            if name.is_referenced() and outside:
                found.add(name.get_name())
    return found
