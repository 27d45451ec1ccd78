"""Which tests meet a fault: by the lines they run, what names a constant, and what they take."""

import ast

import pytest

from tests import by_line
from tests.by_line import Lines, statement

CODE = '''\
"""A file."""
NEAR = (
    3
)

def far(x, most=2):
    """Doc."""
    if x > NEAR and (
        x > most
    ):
        y = [
            x,
        ]
    return x


class Thing:
    size: int = 4
'''


@pytest.mark.parametrize(
    ("line", "found"),
    [
        (3, (2, 4, ["NEAR"], True)),
        (6, (6, 14, ["far"], False)),
        (9, (8, 10, [], False)),  # of an if the head
        (12, (11, 13, ["y"], False)),
        (18, (18, 18, ["size"], True)),
        (15, (15, 15, [], True)),
    ],
)
def test_the_innermost_statement_at_a_line_and_its_names(line, found):
    first, last, names, at_import = statement(ast.parse(CODE), line)
    assert (first, last, names, at_import) == found


@pytest.fixture
def lines(monkeypatch):
    """Of one file, which three tests run; the others are of the same test files."""
    seconds = {
        "tests/test_a.py::runs": 0.1, "tests/test_a.py::beside": 0.01,
        "tests/test_b.py::runs": 0.05, "tests/test_b.py::long": 3.0,
        "tests/test_far.py::own": 0.3, "tests/test_c.py::other": 0.01,
    }  # fmt: skip
    run = {
        "tests/test_a.py::runs": [8, 14], "tests/test_b.py::runs": [11],
        "tests/test_b.py::long": [8], "tests/test_far.py::own": [8, 11],
        "tests/test_c.py::other": [2],
    }  # fmt: skip
    known = Lines({"seconds": seconds, "lines": {"kit/far.py": run}})
    known.code = {"kit/far.py": CODE.splitlines()}
    return known


def test_a_constant_is_met_by_the_tests_of_what_names_it_whoever_imported_it(lines):
    """Line 8 names NEAR. The file was first imported in test_c."""
    running, at_import = lines.running("kit/far.py", 3)
    assert running >= {"tests/test_a.py::runs", "tests/test_b.py::long", "tests/test_far.py::own"}
    assert at_import


def test_a_constant_is_met_by_the_list_of_constants_too_and_what_a_test_runs_is_not(
    lines, monkeypatch
):
    monkeypatch.setattr(by_line, "LISTS", "tests/test_c.py")
    assert "tests/test_c.py::other" in lines.tests("kit/far.py", 3)
    assert "tests/test_c.py::other" not in lines.tests("kit/far.py", 8)


def test_the_tests_of_a_statement_are_those_of_all_of_its_lines(lines):
    running, at_import = lines.running("kit/far.py", 12)
    assert running == {"tests/test_b.py::runs", "tests/test_far.py::own"} and not at_import
    assert lines.running("kit/far.py", 13) == (running, at_import)


def test_brief_tests_come_first_and_the_others_of_their_files_last(lines):
    assert lines.tests("kit/far.py", 8) == [
        "tests/test_a.py::runs", "tests/test_far.py::own", "tests/test_b.py::long",
        "tests/test_a.py::beside", "tests/test_b.py::runs",
    ]  # fmt: skip


def test_what_goes_beyond_the_budget_is_left_out_and_so_are_further_files(lines, monkeypatch):
    monkeypatch.setattr(by_line, "BUDGET", 1.0)
    assert "tests/test_b.py::long" not in lines.tests("kit/far.py", 8)
    monkeypatch.setattr(by_line, "MOST_FILES", 1)
    assert lines.tests("kit/far.py", 8) == ["tests/test_far.py::own"]
    assert len(lines.tests("kit/far.py", 8, every=True)) == 5


def test_lines_are_measured_once_and_again_where_a_test_file_has_changed(tmp_path, monkeypatch):
    """A test that fails without a fault is left out, and what is not there any more forgotten."""
    monkeypatch.setattr(by_line, "ROOT", tmp_path)
    monkeypatch.setattr(by_line, "KIT", ("kit",))
    for name in ("kit", "tests"):
        (tmp_path / name).mkdir()
    (tmp_path / "kit" / "far.py").write_text(CODE)
    test = tmp_path / "tests" / "test_a.py"
    test.write_text("import tasks\n")
    (tmp_path / "tests" / "test_other.py").write_text("import json\n")
    asked, ids = [], ["tests/test_a.py::one", "tests/test_a.py::fails"]

    def run(tests, cover):
        asked.append(tests)
        lines = {f"{tmp_path}/kit/far.py": {i: [8] for i in ids}}
        failed = [i for i in ids if i.endswith("fails")]
        return {"lines": lines, "seconds": dict.fromkeys(ids, 0.5), "failed": failed,
                "root": str(tmp_path)}  # fmt: skip

    out = tmp_path / "runs" / "lines.json"
    known = by_line.measure(run, out)
    assert asked == [["tests/test_a.py"]]
    assert known["seconds"] == {"tests/test_a.py::one": 0.5}
    assert known["lines"] == {"kit/far.py": {"tests/test_a.py::one": [8]}}
    assert by_line.measure(run, out) == known and len(asked) == 1
    test.write_text("import tasks  # changed\n")
    ids[:] = ["tests/test_a.py::two"]
    assert list(by_line.measure(run, out)["seconds"]) == ["tests/test_a.py::two"]
    (tmp_path / "kit" / "far.py").write_text(CODE + "\n")
    by_line.measure(run, out)
    assert len(asked) == 3
