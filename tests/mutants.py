"""Faults put in on purpose, one at a time: do the tests notice? `make mutants`

Operators are Cosmic Ray's, and four of ours for what a refactoring breaks: a constant twice or half
as large, a call's first two arguments swapped, a step left out, a call that passes its argument on.
A place of the code is drawn
at random and then one of the operators that fit it, so that a line with many operators does not
count more. Each mutant lives in a copy of the tree and meets the tests of the files that import its
own. What the others would notice is not counted: the score is a lower bound.
"""

from __future__ import annotations

import argparse
import ast
import json
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from typing import NamedTuple

import parso
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators import (
    binary_operator_replacement,
    boolean_replacer,
    break_continue,
    comparison_operator_replacement,
    number_replacer,
    unary_operator_replacement,
    zero_iteration_for_loop,
)
from cosmic_ray.operators.operator import Operator

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "solutions" / "results" / "mutants.json"
CODE = ("lbw_minimal", "tasks", "tasks/world")
# What only draws, prints or reads arguments is looked at by other tests' eyes, not by numbers.
LEFT_OUT = {
    "__init__.py",
    "__main__.py",
    "report.py",
    "report_texts.py",
    "pictures.py",
    "viewer.py",
}
COPIED = ("lbw_minimal", "tasks", "tests", "solutions", "notebooks", "pyproject.toml", "README.md")
WORLD = tuple(
    f"tests/test_{name}.py" for name in ("arm", "tasks", "limits", "viewer", "recordings")
)
SLACK = 5  # times as long as without a fault, and the tests hang


class Ours(Operator):
    """An operator without the examples that Cosmic Ray asks of its own."""

    @classmethod
    def examples(cls):
        return ()


class ScaleFloat(Ours):
    """0.1 -> 0.2, and 0.1 -> 0.05: Cosmic Ray adds and takes away 1, which nobody would do here."""

    def mutation_positions(self, node):
        if node.type == "number" and isinstance(ast.literal_eval(node.value), float):
            yield from 2 * [(node.start_pos, node.end_pos)]

    def mutate(self, node, index):
        value = ast.literal_eval(node.value) * (2.0, 0.5)[index]
        return parso.python.tree.Number(repr(value), node.start_pos, node.prefix)


class SwapArguments(Ours):
    """f(a, b, ...) -> f(b, a, ...)"""

    def mutation_positions(self, node):
        if node.type == "arglist" and self._plain(node):
            yield node.start_pos, node.end_pos

    def _plain(self, node):
        first, _, second = node.children[:3]
        return all(c.type not in ("argument",) for c in (first, second)) and (
            first.get_code().strip() != second.get_code().strip()
        )

    def mutate(self, node, index):
        first, second = node.children[0], node.children[2]
        swapped = second.get_code().strip(), first.get_code().strip()
        for i, code in zip((0, 2), swapped, strict=True):
            prefix = " " * (i > 0)
            node.children[i] = parso.python.tree.Name(code, (1, 0), prefix)
        return node


class LeaveOutStep(Ours):
    """optimizer.step() -> None"""

    def mutation_positions(self, node):
        if node.type == "simple_stmt" and node.children[0].type == "atom_expr":
            yield node.start_pos, node.children[0].end_pos

    def mutate(self, node, index):
        node.children[0] = parso.python.tree.Name(
            "None", (1, 0), node.children[0].get_first_leaf().prefix
        )
        return node


class PassOn(Ours):
    """np.clip(x, low, high) -> x, and x.detach() -> x"""

    ON_FIRST = re.compile(r"(np|torch|F)\.\w+$|min$|max$|abs$|round$|float$|int$")
    METHODS = re.compile(r"\.(detach|clamp|abs|mean|sum|square|exp|round|copy|clone|float)$")

    def mutation_positions(self, node):
        if node.type == "atom_expr" and self._kept(node):
            yield node.start_pos, node.end_pos

    def _kept(self, node):
        *head, call = node.children
        if call.type != "trailer" or call.children[0].value != "(":
            return None
        called = "".join(part.get_code() for part in head).strip()
        if self.METHODS.search(called):
            return called.rsplit(".", 1)[0]
        inside = call.children[1]
        if self.ON_FIRST.match(called) and inside.type == "arglist":
            first = inside.children[0]
            return None if first.type == "argument" else f"({first.get_code().strip()})"
        return None

    def mutate(self, node, index):
        prefix = node.get_first_leaf().prefix
        return parso.python.tree.Name(self._kept(node), node.start_pos, prefix)


def _operators() -> dict[str, Operator]:
    """All operators by name; of the replacements of + and < those that a person would mistake."""
    pairs = {
        binary_operator_replacement: "Add_Sub Sub_Add Mul_Div Div_Mul FloorDiv_Div Pow_Mul",
        comparison_operator_replacement: "Lt_LtE LtE_Lt Gt_GtE GtE_Gt Lt_Gt Gt_Lt Eq_NotEq "
        "NotEq_Eq Is_IsNot IsNot_Is",
    }
    chosen = [
        operator
        for module, names in pairs.items()
        for name, operator in vars(module).items()
        if name.startswith("Replace") and name.split("_", 1)[1] in names.split()
    ]
    chosen += [
        number_replacer.NumberReplacer,
        boolean_replacer.ReplaceTrueWithFalse,
        boolean_replacer.ReplaceFalseWithTrue,
        boolean_replacer.ReplaceAndWithOr,
        boolean_replacer.ReplaceOrWithAnd,
        boolean_replacer.AddNot,
        break_continue.ReplaceBreakWithContinue,
        zero_iteration_for_loop.ZeroIterationForLoop,
        unary_operator_replacement.ReplaceUnaryOperator_Delete_USub,
        unary_operator_replacement.ReplaceUnaryOperator_Delete_Not,
        *(ScaleFloat, SwapArguments, LeaveOutStep, PassOn),
    ]
    return {op.__name__: op() for op in chosen}


class Mutant(NamedTuple):
    """A fault: the file, the operator and which of its occurrences, and the line."""

    file: str
    operator: str
    occurrence: int
    line: int


def places(path: Path, operators: dict[str, Operator]) -> dict[tuple[int, int], list[Mutant]]:
    """All mutants of a file by the place of the code they change."""
    source, found = path.read_text(), {}
    skipped = set(_no_code(ast.parse(source)))
    for name, operator in operators.items():
        occurrence = 0
        for node in ast_nodes(get_ast(source)):
            for (line, column), _ in operator.mutation_positions(node):
                if (line, column) not in skipped and line not in skipped:
                    mutant = Mutant(str(path.relative_to(ROOT)), name, occurrence, line)
                    found.setdefault((line, column), []).append(mutant)
                occurrence += 1
    return found


def _no_code(tree: ast.Module) -> Iterator[tuple[int, int] | int]:
    """Places of type hints, and lines of imports and of what is raised: a fault there says nothing.

    A place is (line, column); a whole line is its number.
    """
    for node in ast.walk(tree):
        hints = [getattr(node, "annotation", None), getattr(node, "returns", None)]
        for hint in filter(None, hints):
            for part in ast.walk(hint):
                if hasattr(part, "lineno"):
                    for column in range(part.col_offset, part.end_col_offset):
                        yield part.lineno, column
        if isinstance(node, ast.Import | ast.ImportFrom | ast.Raise):
            yield from range(node.lineno, node.end_lineno + 1)


def draw(count: int, seed: int) -> list[Mutant]:
    """`count` mutants of the core, the world and the tasks, the same for the same seed."""
    operators, rng, all_places = _operators(), random.Random(seed), []
    for folder in CODE:
        for path in sorted((ROOT / folder).glob("*.py")):
            if path.name not in LEFT_OUT:
                all_places += sorted(places(path, operators).items())
    chosen = rng.sample(all_places, min(count, len(all_places)))
    return [rng.choice(mutants) for _, mutants in chosen]


def tests_of(file: str) -> list[str]:
    """The test files that meet a fault in a file: its own and those of what imports it."""
    name = Path(file).stem
    if file.startswith("tasks"):
        return list(WORLD)
    imports = re.compile(rf"^from lbw_minimal(\.{name}\b| import [^\n]*\b{name}\b)", re.M)
    modules = (ROOT / "lbw_minimal").glob("*.py")
    names = [name, *sorted(m.stem for m in modules if imports.search(m.read_text()))]
    paths = [f"tests/test_{name}.py" for name in names]
    return [path for path in paths if (ROOT / path).exists()]


class Tree:
    """A copy of the repository in which files are changed and tests run."""

    def __init__(self, folder: Path):
        self.folder = folder
        for name in COPIED:
            source = ROOT / name
            copy = shutil.copytree if source.is_dir() else shutil.copy
            copy(source, folder / name)

    def test(self, tests: list[str], limit: float | None = None) -> tuple[bool, str]:
        """Whether the tests pass, and the first that does not, within `limit` seconds."""
        line = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-p",
                "no:randomly", "-m", "not slow and not peers", *tests]  # fmt: skip
        try:
            done = subprocess.run(
                line, cwd=self.folder, capture_output=True, text=True, timeout=limit
            )
        except subprocess.TimeoutExpired:
            return False, "out of time"
        failed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.M)
        return done.returncode == 0, failed[1] if failed else ""

    def meet(self, mutant: Mutant, tests: list[str], limit: float) -> dict:
        """Put the fault in, run the tests, take it out: a row of the results."""
        path = self.folder / mutant.file
        source = path.read_text()
        changed = mutate_code(source, _operators()[mutant.operator], mutant.occurrence)
        before, after = (text.splitlines() for text in (source, changed))
        line = next(
            (i for i, pair in enumerate(zip(before, after, strict=False)) if pair[0] != pair[1]), 0
        )
        try:
            path.write_text(changed)
            passed, by = self.test(tests, limit)
        finally:
            path.write_text(source)
        row = mutant._asdict() | {"before": before[line].strip(), "after": after[line].strip()}
        return row | {"noticed": not passed, "by": by}


def main() -> None:
    """Meet the mutants that have no result yet, and print the score."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--count", type=int, default=500, help="mutants in all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2, help="copies of the tree, one process each")
    parser.add_argument("--out", type=Path, default=RESULTS, help="results, which are gone on with")
    args = parser.parse_args()
    wanted = draw(args.count, args.seed)
    rows = json.loads(args.out.read_text()) if args.out.exists() else []
    done = {Mutant(*(row[field] for field in Mutant._fields)) for row in rows}
    with tempfile.TemporaryDirectory(prefix="mutants_") as folder:
        trees: Queue[Tree] = Queue()
        for i in range(args.jobs):
            Path(folder, str(i)).mkdir()
            trees.put(Tree(Path(folder, str(i))))
        limits: dict[str, float] = {}

        def meet(mutant: Mutant) -> None:
            tree, tests = trees.get(), tests_of(mutant.file)
            try:
                if mutant.file not in limits:
                    start = time.monotonic()
                    passed, by = tree.test(tests)
                    assert passed, f"{by} fails without a fault"
                    limits[mutant.file] = 60 + SLACK * (time.monotonic() - start)
                rows.append(tree.meet(mutant, tests, limits[mutant.file]))
            finally:
                trees.put(tree)
            args.out.write_text(
                json.dumps(sorted(rows, key=lambda r: (r["file"], r["line"])), indent=1)
            )
            row = rows[-1]
            word = "noticed " if row["noticed"] else "SURVIVED"
            print(
                f"{len(rows)}/{len(wanted)} {word} {row['file']}:{row['line']} {row['after']}",
                flush=True,
            )

        with ThreadPoolExecutor(args.jobs) as pool:
            list(pool.map(meet, [m for m in wanted if m not in done]))
    noticed = sum(row["noticed"] for row in rows)
    print(f"{noticed} of {len(rows)} noticed")


if __name__ == "__main__":
    main()
