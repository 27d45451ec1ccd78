"""Faults put in on purpose, one at a time: do the tests notice? `make mutants`

Operators are Cosmic Ray's, and four of ours for what a refactoring breaks: a constant twice or half
as large, a call's first two arguments swapped, a step left out, a call that passes its argument on.
A place of the code is drawn at random and then one of the operators that fit it, so that a line
with many operators does not count more. Each mutant lives in a copy of the tree and meets the tests
that run its line (`tests.by_line`), in a process that has torch already (`tests.warm`): the brief
ones first, up to the first that fails, and ten seconds' worth of them. What others would notice
is not counted: the score is a lower bound. A smaller `--count` takes the first of the same sample.
Results that are there are gone on with, and so are the lines that tests run, in `runs/`. What
passed meets every test of its line, and those written since, by `--again`.
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
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib.util import cache_from_source
from pathlib import Path
from queue import Queue
from threading import Lock
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

from lbw_minimal.report import wilson
from lbw_minimal.training import write_atomic
from tests.by_line import Lines, measure

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "solutions" / "results" / "mutants.json"
LINES = ROOT / "runs" / "tested_lines.json"
CODE = ("lbw_minimal", "lbw_minimal/clips", "tasks", "tasks/commands", "tasks/world")
# What only draws, prints or reads arguments is looked at by a person's eyes, not by numbers. Ray
# and Minari are not installed for the tests. A benchmark's figures are those of the machine.
LEFT_OUT = {
    *("__init__.py", "__main__.py", "report.py", "report_texts.py", "pictures.py", "viewer.py"),
    *("diagram.py", "films.py", "play.py", "page.py", "shots.py", "figures.py"),
    *("gallery.py", "links.py", "own_arm.py", "stage.py", "stage_page.py"),
    *("cluster.py", "export.py", "bench.py"),
}
FIRST = 12  # tests that a fault meets first, so that few files are read
COPIED = ("lbw_minimal", "tasks", "tests", "solutions", "notebooks", "pyproject.toml", "README.md")


class Ours(Operator):
    """An operator without the examples that Cosmic Ray asks of its own."""

    @classmethod
    def examples(cls):
        return ()


class ScaleFloat(Ours):
    """0.1 -> 0.2, and 0.1 -> 0.05: Cosmic Ray adds and takes away 1, which nobody would do here."""

    def mutation_positions(self, node):
        value = ast.literal_eval(node.value) if node.type == "number" else 0
        if value and isinstance(value, float):
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
    METHODS = re.compile(
        r"(?!(np|torch|F)\.)\S.*"
        r"\.(detach|clamp|abs|mean|sum|square|exp|round|copy|clone|float)$"
    )

    def mutation_positions(self, node):
        if node.type == "atom_expr" and self._kept(node):
            yield node.start_pos, node.end_pos

    def _kept(self, node):
        *head, call = node.children
        if call.type != "trailer" or call.children[0].value != "(":
            return None
        called = "".join(part.get_code() for part in head).strip()
        if self.METHODS.match(called):
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
    skipped, nodes = set(_no_code(ast.parse(source))), list(ast_nodes(get_ast(source)))
    for name, operator in operators.items():
        occurrence = 0
        for node in nodes:
            # The * before a function's keyword arguments multiplies nothing.
            star = node.type == "operator" and node.parent.type == "parameters"
            for (line, column), _ in operator.mutation_positions(node):
                if not star and (line, column) not in skipped and line not in skipped:
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
    """The first `count` of all mutants of the core, the world and the tasks, in an order drawn."""
    operators, rng, all_places = _operators(), random.Random(seed), []
    for folder in CODE:
        for path in sorted((ROOT / folder).glob("*.py")):
            if path.name not in LEFT_OUT:
                all_places += sorted(places(path, operators).items())
    rng.shuffle(all_places)
    return [rng.choice(mutants) for _, mutants in all_places[:count]]


class Tree:
    """A copy of the repository in which files are changed, and a process that runs its tests."""

    def __init__(self, folder: Path):
        self.folder, self.sound, self.unsound = folder, set(), set()
        for name in COPIED:
            source = ROOT / name
            copy = shutil.copytree if source.is_dir() else shutil.copy
            copy(source, folder / name)
        self.warm = subprocess.Popen([sys.executable, "-m", "tests.warm"], cwd=folder, text=True,
                                     stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # fmt: skip

    def run(self, **asked) -> dict:
        """Run tests, see `tests.warm`."""
        self.warm.stdin.write(json.dumps(asked) + "\n")
        self.warm.stdin.flush()
        return json.loads(self.warm.stdout.readline())

    def meet(self, mutant: Mutant, lines: Lines, every: bool) -> dict:
        """Put the fault in, run the tests, or every one, take it out: a row of the results."""
        path = self.folder / mutant.file
        source = path.read_text()
        changed = mutate_code(source, _operators()[mutant.operator], mutant.occurrence)
        before, after = (text.splitlines() for text in (source, changed))
        line = next(
            (i for i, pair in enumerate(zip(before, after, strict=False)) if pair[0] != pair[1]), 0
        )
        tests = lines.tests(mutant.file, mutant.line, every)
        while True:
            self.write(path, changed)
            try:
                answer = self.first_failure([t for t in tests if t not in self.unsound], lines)
            finally:
                self.write(path, source)
            if answer["passed"] or self.is_sound(answer["by"]):
                break
        row = mutant._asdict() | {"before": before[line].strip(), "after": after[line].strip()}
        row |= {"noticed": not answer["passed"], "by": answer["by"], "why": answer["why"]}
        return row | {"tests": len(tests)}

    def first_failure(self, tests: list[str], lines: Lines) -> dict:
        answer = {"passed": True, "by": "", "why": "no test runs it"}
        for some in filter(None, (tests[:FIRST], tests[FIRST:])):
            answer = self.run(tests=some, seconds={t: lines.seconds[t] for t in some})
            if not answer["passed"]:
                break
        return answer

    def write(self, path: Path, text: str) -> None:
        """Write it anew: versions of one second and one length have the same bytecode to Python."""
        path.write_text(text)
        Path(cache_from_source(str(path))).unlink(missing_ok=True)

    def is_sound(self, test: str) -> bool:
        """A test that notices a fault has to pass without it; each is asked once."""
        if "::" in test and test not in self.sound:
            passed = self.run(tests=[test])["passed"]
            (self.sound if passed else self.unsound).add(test)
        return test not in self.unsound


def _mutant_of(row: dict) -> Mutant:
    return Mutant(*(row[field] for field in Mutant._fields))


def main() -> None:
    """Meet the mutants that have no result yet, and print the score."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--count", type=int, default=500, help="mutants in all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2, help="copies of the tree, one process each")
    parser.add_argument(
        "--again", action="store_true", help="meet what passed again, with every test of its line"
    )
    parser.add_argument("--out", type=Path, default=RESULTS, help="results, which are gone on with")
    args = parser.parse_args()
    wanted = draw(args.count, args.seed)
    rows = json.loads(args.out.read_text()) if args.out.exists() else []
    if args.again:
        wanted = [_mutant_of(row) for row in rows]
        rows = [row for row in rows if row["noticed"]]
    done = set(map(_mutant_of, rows))
    with tempfile.TemporaryDirectory(prefix="mutants_") as folder:
        trees: Queue[Tree] = Queue()
        for i in range(args.jobs):
            trees.put(Tree(Path(folder, str(i))))
        lines = Lines(measure(trees.queue[0].run, LINES))

        writing = Lock()

        def meet(mutant: Mutant) -> None:
            tree = trees.get()
            try:
                row = tree.meet(mutant, lines, args.again)
            finally:
                trees.put(tree)
            with writing:
                rows.append(row)
                ordered = sorted(rows, key=lambda r: (r["file"], r["line"]))
                write_atomic(args.out, json.dumps(ordered, indent=1))
            word = "noticed " if row["noticed"] else "SURVIVED"
            print(
                f"{len(rows)}/{len(wanted)} {word} {row['file']}:{row['line']} {row['after']}",
                flush=True,
            )

        with ThreadPoolExecutor(args.jobs) as pool:
            list(pool.map(meet, [m for m in wanted if m not in done]))
        while not trees.empty():
            warm = trees.get().warm
            warm.stdin.close()
            warm.wait()  # or its folder would be gone before it has begun
    noticed = sum(row["noticed"] for row in rows)
    low, high = wilson(noticed, len(rows)) if rows else (0, 1)  # what none say
    print(f"{noticed} of {len(rows)} noticed, {100 * low:.1f} to {100 * high:.1f} % (Wilson, 95 %)")


if __name__ == "__main__":
    main()
