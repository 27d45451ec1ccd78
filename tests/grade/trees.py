"""Answers as syntax trees without what a copyist changes: names, numbers, texts and formatting.

A name that the cell itself binds is one like any other; names of libraries and Python's own, and
attributes, stay, since nobody can rename them. Docstrings and annotations go.
"""

from __future__ import annotations

import ast
import functools
import hashlib

from tests.grade.cell.answer import is_stub
from tests.grade.exercise import Exercise

LEAST = 4  # nodes of a piece that is looked at: fewer say nothing (x + 1 has 3)
DEEPEST = 60  # levels of a tree; those of right answers have 20
LARGEST = 3_000  # nodes of an answer; the longest reference has 300


def pieces(source: str) -> dict[str, int]:
    """The normalised subtrees of a cell by a short name each, and how many nodes they have.

    None of a cell that does not parse, or that is far too long to be an answer.
    """
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return {}
    body = [node for node in tree.body if _counts(node)]
    own = _bound(body)
    found: dict[str, int] = {}
    left = LARGEST

    def walk(node, deep) -> tuple[str, int]:
        nonlocal left
        left -= 1
        if left < 0 or deep > DEEPEST:
            raise OverflowError
        parts, size = [_label(node, own)], 1
        for child in _children(node):
            name, nodes = walk(child, deep + 1)
            parts.append(name)
            size += nodes
        name = hashlib.blake2b(" ".join(parts).encode(), digest_size=8).hexdigest()
        if size >= LEAST:
            found[name] = size
        return name, size

    try:
        for node in body:
            walk(node, 0)
    except OverflowError:
        return {}
    return found


def _counts(node) -> bool:
    """Whether a statement of a cell is part of an answer: no import, no stub, no lone value."""
    return not (isinstance(node, ast.Import | ast.ImportFrom | ast.Expr) or is_stub(node))


def _bound(body) -> set[str]:
    """All names that a cell binds, anywhere."""
    names = set()
    for node in (n for top in body for n in ast.walk(top)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.arg):
            names.add(node.arg)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
    return names


def _label(node, own: set[str]) -> str:
    """What is compared of a node itself."""
    kind = type(node).__name__
    if isinstance(node, ast.Name):
        return "own" if node.id in own else node.id
    if isinstance(node, ast.Constant):
        return type(node.value).__name__
    if isinstance(node, ast.Attribute):
        return f"{kind} {node.attr}"
    if isinstance(node, ast.keyword):
        return f"{kind} {node.arg}"
    return kind


def _children(node) -> list:
    """The nodes below one, without contexts, annotations, docstrings and stubs."""
    found = []
    for name, value in ast.iter_fields(node):
        if name in ("ctx", "annotation", "returns", "type_comment", "type_params"):
            continue
        if name == "body" and isinstance(value, list):
            value = value[_says(value) :]
        nodes = value if isinstance(value, list) else [value]
        found += [n for n in nodes if isinstance(n, ast.AST) and not is_stub(n)]
    return found


def _says(body) -> bool:
    """Whether a body begins with a text."""
    first = body[0] if body else None
    return (
        isinstance(first, ast.Expr)
        and isinstance(first.value, ast.Constant)
        and isinstance(first.value.value, str)
    )


@functools.cache
def ours(exercise: Exercise) -> frozenset[str]:
    """The pieces that are the kit's own, of the reference and of what is given: an answer that is
    short and right is like the reference by necessity. The reference has the lines of the cell
    that is handed out."""
    return frozenset(pieces(exercise.source)) | frozenset(pieces(exercise.given))
