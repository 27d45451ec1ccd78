"""Which tests run which lines: for `make mutants`, which so asks none that cannot notice a fault.

Each test file runs once under coverage.py, which writes down the lines that each test has run. A
constant runs when its file is imported, in no test: it is met by the tests of the lines that name
it, in whatever file they are, and by those that list constants; a function's head by those of its
body.
"""

from __future__ import annotations

import ast
import hashlib
import json
import re
from bisect import bisect
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

ROOT = Path(__file__).parent.parent
KIT = ("lbw_minimal", "tasks")
USES_KIT = re.compile(r"^ *(from|import) (lbw_minimal|tasks)\b", re.M)
# The house's rules are of the text, and three others need what is not there.
NOT_ASKED = {"test_house.py", "test_builds.py", "test_cluster.py", "test_systems.py"}
BANDS = (0.2, 1.0, 5.0)  # s: brief tests first
MOST_FILES = 12
LISTS = "tests/test_golden_settings.py"  # of constants
BUDGET = 10.0  # s of processor time that the tests of one fault may take, by what they took before


def asked() -> list[str]:
    """The test files that use the kit's code themselves."""
    return [
        f"tests/{path.name}"
        for path in sorted((ROOT / "tests").glob("test_*.py"))
        if path.name not in NOT_ASKED and USES_KIT.search(path.read_text())
    ]


def measure(run: Callable[..., dict], out: Path) -> dict:
    """{"lines": {file: {test: [line, ...]}}, "seconds": {test: s}} of all tests, kept in a file.

    What is kept holds for as long as the kit and the test file stay as they are. A test that fails
    without a fault is left out. `run` asks `tests.warm`.
    """
    known = json.loads(out.read_text()) if out.exists() else {"lines": {}, "seconds": {}, "of": {}}
    kit = "".join(path.read_text() for folder in KIT for path in sorted(files(folder)))
    digests = {tests: _digest(kit + (ROOT / tests).read_text()) for tests in asked()}
    out.parent.mkdir(exist_ok=True)
    for tests in (t for t, digest in digests.items() if known["of"].get(t) != digest):
        for by_test in (known["seconds"], *known["lines"].values()):
            for test in [test for test in by_test if file_of(test) == tests]:
                del by_test[test]
        answer = run(tests=[tests], cover=True)
        sound = answer["seconds"].keys() - set(answer["failed"])
        for file, by_test in answer["lines"].items():
            rows = known["lines"].setdefault(str(Path(file).relative_to(answer["root"])), {})
            rows |= {test: lines for test, lines in by_test.items() if test in sound}
        known["seconds"] |= {test: answer["seconds"][test] for test in sound}
        known["of"][tests] = digests[tests]
        out.write_text(json.dumps(known))
        print(f"{tests}: {len(answer['seconds'])} tests, {len(answer['failed'])} fail", flush=True)
    return known


def files(folder: str) -> Iterable[Path]:
    return (ROOT / folder).rglob("*.py")


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def file_of(test: str) -> str:
    return test.partition("::")[0]


class Lines:
    """What runs the lines of the kit, from `measure`."""

    def __init__(self, known: dict):
        self.seconds = known["seconds"]
        self.by_line: dict[tuple[str, int], set[str]] = {}
        for file, by_test in known["lines"].items():
            for test, lines in by_test.items():
                for line in lines:
                    self.by_line.setdefault((file, line), set()).add(test)
        self.code = {
            str(path.relative_to(ROOT)): path.read_text().splitlines()
            for folder in KIT
            for path in files(folder)
        }

    def tests(self, file: str, line: int, every: bool = False) -> list[str]:
        """The tests that can notice a fault in a line, the likeliest and cheapest first.

        They are of a few files: the line's own, and those of whose tests most run it. Behind these
        tests come the others of their files, which may share what it made. What goes beyond the
        budget is left out; every: nothing is.
        """
        running, at_import = self.running(file, line)
        own = f"tests/test_{Path(file).stem}.py"
        count, whole = (Counter(map(file_of, tests)) for tests in (running, self.seconds))
        most = sorted(count, key=lambda name: (name != own, -count[name] / whole[name]))
        most = (most if every else most[:MOST_FILES]) + [LISTS] * at_import
        some = {t for t in self.seconds if file_of(t) in most}

        def rank(test: str) -> tuple:
            seconds = self.seconds[test]
            return test not in running, bisect(BANDS, seconds), file_of(test) != own, seconds

        chosen, spent = [], 0.0
        for test in sorted(some, key=rank):
            spent += self.seconds[test]
            if every or spent < BUDGET or not chosen:
                chosen.append(test)
        return chosen

    def running(self, file: str, line: int) -> tuple[set[str], bool]:
        """The tests that run the statement of a line, or what names it; whether it runs when the
        file is imported."""
        first, last, names, at_import = statement(ast.parse("\n".join(self.code[file])), line)
        tests = self.of_lines((file, n) for n in range(first, last + 1))
        if at_import or not tests:
            word = re.compile(rf"\b({'|'.join(names)})\b")
            tests = self.of_lines(
                (other, n)
                for other, text in self.code.items()
                for n, code in enumerate(text, 1)
                if names and word.search(code)
            )
        if at_import and not tests:
            tests = self.of_lines(place for place in self.by_line if place[0] == file)
        return tests, at_import

    def of_lines(self, places: Iterable[tuple[str, int]]) -> set[str]:
        return set().union(*(self.by_line.get(place, ()) for place in places))


def statement(tree: ast.Module, line: int) -> tuple[int, int, list[str], bool]:
    """First and last line of the innermost statement at a line, the names that it gives, and
    whether it runs when the file is imported.

    Of a `for`, `if` or `with` it is the head alone, of a function all.
    """
    around = [n for n in ast.walk(tree) if isinstance(n, ast.stmt) and _holds(n, line)]
    if not around:
        return line, line, [], True
    node = max(around, key=lambda n: (n.lineno, -n.end_lineno))
    last = node.end_lineno
    if hasattr(node, "body") and not isinstance(node, ast.FunctionDef | ast.ClassDef):
        last = max(node.lineno, node.body[0].lineno - 1)
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        names = [node.name]
    else:
        targets = getattr(node, "targets", [getattr(node, "target", None)])
        inside = [part for target in filter(None, targets) for part in ast.walk(target)]
        names = [part.id for part in inside if isinstance(part, ast.Name)]
    at_import = not any(isinstance(n, ast.FunctionDef) for n in around)
    return node.lineno, last, names, at_import


def _holds(node: ast.stmt, line: int) -> bool:
    return node.lineno <= line <= node.end_lineno
