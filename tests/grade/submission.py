"""Reading a submission: which cell answers which exercise. Nothing of it is run here."""

from __future__ import annotations

import ast
import builtins
import json
import re
import symtable
from pathlib import Path

from tests.grade.exercise import Exercise

MOST = 20 << 20  # bytes of a notebook; those of the course have 0.1 MB
STUB = 'raise NotImplementedError("your lines here")'


class Unreadable(Exception):
    """Not a notebook; the message says why, to the student."""


def cells(path: Path) -> list[dict]:
    """The code cells of a notebook: {"id": grade id or None, "source": text}. Raises Unreadable."""
    if path.is_symlink() or not path.is_file():
        raise Unreadable("not a plain file")
    if path.stat().st_size > MOST:
        raise Unreadable(
            f"{path.stat().st_size >> 20} MB: a notebook of this course has less than {MOST >> 20}"
        )
    try:
        found = json.loads(path.read_bytes().decode("utf-8-sig"))["cells"]
        code = [c for c in found if c["cell_type"] == "code"]
        return [{"id": _grade_id(c), "source": _plain(c["source"])} for c in code]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as e:
        raise Unreadable(f"no Jupyter notebook ({type(e).__name__})") from None


def _grade_id(cell) -> str | None:
    note = cell.get("metadata", {}).get("nbgrader", {})
    return note.get("grade_id") if isinstance(note, dict) else None


def _plain(source) -> str:
    """Cell source without IPython's own lines (%magic, !shell), which are no Python."""
    text = source if isinstance(source, str) else "".join(source)
    return re.sub(r"^(\s*)[%!].*$", r"\1pass", text, flags=re.MULTILINE)


def _parse(source: str) -> ast.Module | None:
    try:
        return ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return None


def _defined(node) -> set[str]:
    """Names that a top-level statement defines, if it only defines."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return {node.name}
    if isinstance(node, ast.Import | ast.ImportFrom):
        return {(alias.asname or alias.name).split(".")[0] for alias in node.names}
    if isinstance(node, ast.Assign) and all(isinstance(t, ast.Name) for t in node.targets):
        busy = ast.Call | ast.Attribute | ast.Subscript | ast.Await
        simple = not any(isinstance(n, busy) for n in ast.walk(node.value))
        return {t.id for t in node.targets} if simple else set()
    return set()


def answer(exercise: Exercise, code: list[dict]) -> str | None:
    """The source that answers an exercise: its cell, and from other cells the definitions it uses.

    The cell is found by its grade id; where that is gone, by the name it defines. Of several the last that
    is no stub counts. None if there is none.
    """
    own = [c["source"] for c in code if c["id"] == exercise.grade_id]
    own = own or [c["source"] for c in code if _defines(c["source"], exercise.name)]
    if not own:
        return None
    source = ([s for s in own if STUB not in s] or own)[-1]
    return "\n".join([*_helpers(source, code, exercise), source])


def _defines(source, name) -> bool:
    tree = _parse(source)
    return tree is not None and any(name in _defined(node) for node in tree.body)


def _helpers(source: str, code: list[dict], exercise: Exercise) -> list[str]:
    """Imports, functions and constants of other cells that `source` uses, in the order of the notebook."""
    known = set(dir(builtins)) | {"math", "np", "torch", "F", "nn"}
    for text in (exercise.given, source):
        known |= {name for node in getattr(_parse(text), "body", []) for name in _defined(node)}
    offers = []
    for cell in code:
        tree = _parse(cell["source"]) if STUB not in cell["source"] else None
        offers += [(_defined(node), ast.unparse(node)) for node in (tree.body if tree else [])]
    wanted, taken = _names(source) - known, set()
    while wanted:
        name = wanted.pop()
        known.add(name)
        for i, (names, text) in enumerate(offers):
            if name in names and i not in taken:
                taken.add(i)
                wanted |= _names(text) - known
    return [offers[i][1] for i in sorted(taken)]


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
