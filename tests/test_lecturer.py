"""What the lecturer gets of a graded class: item statistics and the report of alike answers."""

import csv
import io
import json
import math
import random
from collections import Counter
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from tests.grade import alike, feedback, items, trees
from tests.grade.__main__ import main
from tests.grade.cell.answer import STUB
from tests.grade.exercise import find
from tests.grade.files import RELEASED
from tests.grade.handed_in import Submission
from tests.grade.reports import reports
from tests.grade.sheets import sheet
from tests.grade.webpage import words
from tests.test_grading_files import notebook

pytestmark = pytest.mark.usefixtures("workers_wait")

E61, E62 = find("6.1"), find("6.2")
HINT = E61.mistakes[0].hint


def outcome(points, message="", label="a check"):
    return {"label": label, "points": points, "most": 2, "message": message}


def exercise(id, points, message="", open=False):
    outcomes = [outcome(points, "" if points == 2 else message or "it is wrong")]
    return {"id": id, "title": find(id).title, "open": open, "points": points, "most": 2,
            "outcomes": outcomes, "example": "", "source": ""}  # fmt: skip


def record(name, *exercises, **more):
    points = sum(e["points"] for e in exercises)
    return {"submission": name, "notes": [], "points": points, "most": 2 * len(exercises),
            "exercises": list(exercises)} | more  # fmt: skip


def rows(text):
    return list(csv.DictReader(io.StringIO(text)))


# Item statistics


def of_class(first, second, third):
    """Points of three exercises, one number a student each."""
    ids = ("6.1", "6.2", "6.3")
    points = zip(first, second, third, strict=True)
    return [
        record(f"s{i}", *(exercise(id, p) for id, p in zip(ids, some, strict=True)))
        for i, some in enumerate(points)
    ]


def test_difficulty_and_item_rest_correlation_by_hand():
    grades = of_class((2, 2, 0, 0), (2, 1, 1, 0), (2, 0, 2, 0))
    first = items.statistics(grades, ["6.1", "6.2", "6.3"])[0]
    assert (first.share, first.mean, first.answers) == (0.5, 0.5, 4)
    # the rest: 4, 1, 3, 0; deviations 2, -1, 1, -2 and 1, 1, -1, -1
    r = 2 / math.sqrt(10 * 4)
    assert first.rest == pytest.approx(r)
    assert math.atanh(first.high) - math.atanh(r) == pytest.approx(1.96 / math.sqrt(4 - 3))
    assert math.atanh(r) - math.atanh(first.low) == pytest.approx(1.96 / math.sqrt(4 - 3))


def test_an_exercises_own_points_are_not_among_the_rest():
    """With them nothing would correlate below 0 where three exercises weigh the same."""
    (first, *_) = items.statistics(
        of_class((2, 2, 0, 0), (0, 0, 2, 2), (1, 1, 1, 1)), ["6.1", "6.2", "6.3"]
    )
    assert first.rest == -1 and first.low is None


def test_where_points_do_not_vary_there_is_no_correlation():
    assert items.correlation(np.ones(9), np.arange(9)) == (None, None, None)
    assert items.correlation(np.arange(2), np.arange(2)) == (None, None, None)


def test_who_failed_what_and_which_hint_fired_how_often():
    grades = [
        record("ann", exercise("6.1", 2)),
        record("bob", exercise("6.1", 0, HINT)),
        record("cat", exercise("6.1", 1, HINT)),
        record("dan", exercise("6.1", 0, "it raises NameError")),
        record("eve", exercise("6.1", 0, "not done yet", open=True), exercise("6.2", 2)),
    ]
    grades[3]["exercises"][0]["outcomes"].append(outcome(0, HINT, "another check"))
    for g in grades[:4]:
        g["exercises"].append(exercise("6.2", 2))
    (item, other) = items.statistics(grades, ["6.1", "6.2"])
    assert item.failed == ["bob", "cat", "dan", "eve"] and (item.right, item.open) == (1, 1)
    assert item.hints == {HINT: 3} and item.unexplained == 0
    assert item.checks == {"a check": 3, "another check": 1}
    assert not other.failed and not other.hints
    table = rows(items.hints_csv([item]))
    assert (table[0]["hint"], table[0]["submissions"]) == (HINT, "3")
    assert {row["hint"] for row in table} == {m.hint for m in E61.mistakes}
    (row,) = rows(items.items_csv([item]))
    assert row["not right"] == "bob; cat; dan; eve" and row["share right"] == "0.2"


def test_a_message_that_is_no_hint_counts_as_wrong_without_one():
    (item,) = items.statistics(
        [record("ann", exercise("6.1", 0, "it is too long")), record("bob", exercise("6.1", 2))],
        ["6.1"],
    )
    assert item.unexplained == 1 and not item.hints


def test_who_tried_nothing_and_who_could_not_be_graded_do_not_count():
    grades = [
        record("ann", exercise("6.1", 2)),
        record("bob", exercise("6.1", 0, "no cell with this exercise", open=True)),
        record("cat", exercise("6.1", 0, "NOT GRADED"), failed=True),
    ]
    (item,) = items.statistics(grades, ["6.1"])
    assert item.answers == 1 and item.failed == []
    assert "2 more" in items.items_page([item], 2)
    assert items.statistics(grades[1:], ["6.1"]) == [] and items.items_page([], 2)


def test_what_stands_between_backticks_is_code_and_nothing_becomes_a_tag():
    assert words("1 < `x > 0` `") == "1 &lt; <code>x &gt; 0</code> `"
    item = items.Item("6.1", "", 1, 0, 1.0, hints=Counter(["`a`"]), checks=Counter(["`b`"]))
    shown = items.items_page([item], 0)
    assert "<code>a</code>" in shown and "<code>b</code>" in shown and "`" not in shown
    shown = feedback.page(record("s", exercise("6.1", 0, "`a` is missing", "`b`")))
    assert "<code>a</code>" in shown and "`" not in shown


def test_a_name_becomes_neither_a_formula_nor_a_tag():
    grades = [record("=cmd()|<b>", exercise("6.1", 0)), record("ann; =1", exercise("6.1", 2))]
    found = items.statistics(grades, ["6.1"])
    assert rows(items.items_csv(found))[0]["not right"] == "'=cmd()|<b>"
    assert "<b>" not in items.items_page(found, 0)


def test_a_sheet_defuses_text_and_leaves_numbers():
    assert sheet(["a"], [["-1"], [-1.5], [None]]) == 'a\n\'-1\n-1.5\n""\n'


# Alike answers


def same_tree(a, b):
    return trees.pieces(a) == trees.pieces(b) != {}


RIGHT = E61.source


@pytest.mark.parametrize(
    "changed",
    [
        RIGHT.replace("distances", "d"),
        RIGHT.replace("z_E", "expert"),
        RIGHT.replace("def r1(", "def helper("),
        RIGHT.replace("axis=(1, 2)", "axis = ( 2,1 )"),
        RIGHT.replace("** 2", "**  3"),
        RIGHT.replace("(z, z_E)", "(z: np.ndarray, z_E: list) -> float"),
        RIGHT.replace(":\n", ':\n    """What it does."""\n    # a comment\n', 1),
        "import numpy as np\n" + RIGHT + "\nprint(r1(1, 2))\n'text'",
        RIGHT + '\n\ndef stub():\n    raise NotImplementedError("your lines here")',
    ],
)
def test_names_numbers_and_formatting_make_no_difference(changed):
    assert changed != RIGHT and same_tree(changed, RIGHT)


@pytest.mark.parametrize(
    "changed",
    [
        RIGHT.replace("np.sqrt", "np.abs"),
        RIGHT.replace("axis=", "dims="),
        RIGHT.replace("- z)", "+ z)"),
        RIGHT.replace(".min()", ".max()"),
        RIGHT.replace("** 2", '** "2"'),
    ],
)
def test_what_is_computed_makes_a_difference(changed):
    assert changed != RIGHT and not same_tree(changed, RIGHT)


@pytest.mark.parametrize(
    "source",
    ["def f(:", "x = " + "(" * 5_000 + ")" * 5_000, "x = " + "+".join("a" * 3_000), "\0",
     "x = " + "-" * 300 + "1"],
)  # fmt: skip
def test_what_cannot_be_an_answer_has_no_pieces(source):
    assert trees.pieces(source) == {}


def a_class(*extra, n=20, seed=0):
    """Answers of n students who each wrote some lines of their own, and of those in `extra`."""
    rng = random.Random(seed)
    texts = []
    for _ in range(n):
        some = rng.sample(["np.abs", "np.sum", "len", "max", "min", "sorted", "np.sqrt"], 4)
        body = "".join(f"    q{i} = {f}(a[{f}(b)] * c)\n" for i, f in enumerate(some))
        texts.append(f"def r1(z, z_E):\n{body}    return q0\n")
    texts += extra
    return alike.compare([f"s{i}" for i in range(len(texts))], {"6.1": dict(enumerate(texts))})


ODD = """
def r1(z, z_E):
    best = math.inf
    for frame in z_E[:-1]:
        best = min(best, math.dist(frame.flat, z.flat))
    return -best
"""


def test_who_copied_and_renamed_is_on_top():
    class_ = a_class(ODD, ODD.replace("best", "least").replace("frame", "f"))
    top, second = class_.pairs[:2]
    assert (top.a, top.b) == (20, 21) and top.total > second.total
    assert alike.same(class_, top) == (["6.1"], ["6.1"])


def test_a_piece_weighs_what_few_have_and_nothing_that_all_have():
    two = "def r1(z, z_E):\n    return z[0] * z[1]\n"
    others = [f"def r1(z, z_E):\n    return np.f{i}(z[0])\n" for i in range(6)]
    class_ = alike.compare(list("abcdefgh"), {"6.1": dict(enumerate([two, two, *others]))})
    (pair,) = class_.pairs
    kit = trees.ours(E61)
    assert pair.total == pytest.approx(len(set(trees.pieces(two)) - kit) * math.log2(8 / 2))


def test_what_a_submission_answered_is_taken_apart_once(monkeypatch):
    asked, names = [], [ODD.replace("best", name) for name in ("one", "two")]
    monkeypatch.setattr(alike, "pieces", lambda text: asked.append(text) or trees.pieces(text))
    alike.read({"exercises": [{"id": "6.1", "source": names[0]}, {"id": "6.2", "source": ""}]})
    assert alike.compare(["a", "b"], {"6.1": dict(enumerate(names))}).trees["6.1"].keys() == {0, 1}
    assert [text for text in asked if text] == names


def test_the_references_answer_and_the_cell_that_was_handed_out_are_nobodys():
    class_ = a_class(RIGHT, RIGHT.replace("distances", "d"))
    assert not [p for p in class_.pairs if p.b == 21 or p.a >= 20]
    assert alike.same(class_, alike.Pair(20, 21))[0] == ["6.1"]


def test_what_was_handed_out_is_nobodys():
    (path,) = RELEASED.glob("01_*.ipynb")
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    (handed,) = (c for c in cells if c["metadata"].get("nbgrader", {}).get("grade_id") == "ex-1-5")
    source = "".join(handed["source"])
    half = source.replace(STUB, "self.x = options['x'] * self.y", 1)
    assert trees.pieces(source) == {}
    new = set(trees.pieces(half)) - trees.ours(find("1.5"))
    assert len(new) == len(trees.pieces("self.x = options['x'] * self.y")) + 2  # reset, Point


def test_what_very_many_wrote_counts_for_nobody(monkeypatch):
    monkeypatch.setattr(alike, "COMMON", 3)
    class_ = a_class(ODD, ODD, ODD)
    assert class_.pairs[0].a >= 20
    class_ = a_class(ODD, ODD, ODD, ODD)
    assert not [p for p in class_.pairs if p.a >= 20]


def test_chance_by_hand():
    """Of four answers two are the same: one of six pairs."""
    texts = {
        0: ODD,
        1: ODD.replace("best", "b"),
        2: ODD + "    # x",
        3: "def r1(z, z_E):\n    return f(g(z))",
    }
    texts[2] = "def r1(z, z_E):\n    return g(f(z, z_E))"
    class_ = alike.compare(list("abcd"), {"6.1": texts, "6.2": texts})
    assert class_.chance == {"6.1": pytest.approx(1 / 6), "6.2": pytest.approx(1 / 6)}
    mean, pairs = alike.expected(class_, alike.Pair(0, 1))
    assert mean == pytest.approx(2 / 6) and pairs == pytest.approx(6 / 36)
    mean, pairs = alike.expected(class_, alike.Pair(0, 2))
    assert pairs == pytest.approx(6)  # none the same, as any pair has or more


def test_the_quantile_counts_pairs_that_share_nothing():
    class_ = a_class(ODD, ODD, n=8)
    class_.pairs = [alike.Pair(0, 1, {"6.1": 30.0}), alike.Pair(0, 2, {"6.1": 10.0})]
    assert alike.quantile(class_, 0.5) == 0 and alike.quantile(class_, 0.97) == 10
    assert alike.quantile(class_, 0.99) == 30


def test_in_a_class_of_two_nothing_is_said():
    class_ = alike.compare(["a", "b"], {"6.1": {0: ODD, 1: ODD}})
    page = alike.alike_page(class_, [set(), set()])
    assert class_.pairs == [] and "nothing can be said" in page
    assert "No pair shares anything" in page and "The pairs that share most" not in page


def test_what_is_compared_is_what_was_graded(tmp_path):
    """The cell of each answer that was worked on; of a stub and of what is missing nothing."""
    for name, source in (("ann", E61.source), ("bob", f"def r1(z, z_E):\n    {STUB}")):
        (tmp_path / "class" / name).mkdir(parents=True)
        (tmp_path / "class" / name / "06_reward.ipynb").write_text(notebook(source))
    assert main([str(tmp_path / "class"), "--out", str(tmp_path / "out")]) == 0
    graded = [json.loads(p.read_text()) for p in sorted(tmp_path.glob("out/*/result.json"))]
    found = alike.answers(graded)
    assert found.pop("6.1") == {0: f"# Exercise 6.1\n{E61.source}"}
    assert found and not any(found.values())


def test_the_page_shows_both_answers_and_says_what_is_wrong_alike():
    class_ = a_class(ODD, ODD.replace("best", "<least>").replace("<", "_").replace(">", "_"))
    class_.sources["6.1"][20] += "# <script>\x1b"
    page = alike.alike_page(class_, [{"6.1"}] * 22)
    assert "_least_" in page and "<script>" not in page and "\x1b" not in page
    assert "The same, and not right: 6.1" in page and "accuses nobody" in page
    assert "not right: 6.1" not in alike.alike_page(class_, [set()] * 22)
    table = rows(alike.alike_csv(class_))
    assert (table[0]["first"], table[0]["second"], table[0]["same answers"]) == ("s20", "s21", "1")


# Gradebooks


def entry(*names):
    return Submission(names[0], tuple((Path("/class") / name, name) for name in names))


CANVAS = ["doejane_LATE_4321_98766_06_reward.ipynb", "=evil_77_12_06_reward.ipynb"]
MOODLE = [
    "Jo Moe_77_assignsubmission_file_06_reward.ipynb",
    "Anna-Lena O'Neil_78_assignsubmission_file_",
    "Participant_79_assignsubmission_file_",
]


def books(names, ids=("6.1", "6.2")):
    """What the lecturer gets of submissions with these names, file by file. One more has a name of
    no platform, and one could not be graded."""
    entries = [entry(name) for name in [*names, "ann", names[-1].replace("7", "8")]]
    grades = [record(e.name, *(exercise(id, 2) for id in ids)) for e in entries]
    grades[0]["points"] = 1.5
    grades[-1]["failed"] = True
    return dict(reports(entries, grades, list(ids)))


def test_canvas_finds_students_by_id_and_their_points_in_the_last_column():
    """As its importer reads it: five columns on the student, Section the last of them; a row that
    says what is possible; a row a student."""
    found = books(CANVAS)
    head, possible, *students = csv.reader(io.StringIO(found["canvas.csv"]))
    assert head == ["Student", "ID", "SIS User ID", "SIS Login ID", "Section", "LbW notebook 6"]
    assert "Points Possible" in possible[0] and possible[1:] == ["", "", "", "", "4"]
    assert students == [["doejane", "4321", "", "", "", "1.5"], ["'=evil", "77", "", "", "", "4"]]
    assert "moodle.csv" not in found and "moodle_feedback.zip" not in found


def test_several_notebooks_have_one_column():
    assert "LbW notebooks 5, 6" in books(CANVAS, ("5.1", "5.2", "6.1"))["canvas.csv"]


def test_moodle_finds_students_by_identifier():
    """As its importer reads it: Identifier, "Participant " and a number; Grade; Last modified
    (grade). A column Feedback comments would erase those that are there."""
    found = books(MOODLE)
    table = rows(found["moodle.csv"])
    assert [row["Identifier"] for row in table] == [f"Participant {n}" for n in (77, 78, 79)]
    assert [row["Grade"] for row in table] == ["1.5", "4", "4"]
    assert {row["Last modified (grade)"] for row in table} == {"-"}
    assert {row["Maximum Grade"] for row in table} == {"4"} and "Feedback comments" not in table[0]
    assert table[1]["Full name"] == "Anna-Lena O'Neil" and "canvas.csv" not in found


def test_moodle_finds_the_feedback_of_each_student_in_the_zip():
    """As its importer reads a path: name_number_type_plugin_rest, split at the first four _."""
    names = [*MOODLE, "A_Group-..\\x_80_assignsubmission_file_"]
    with ZipFile(io.BytesIO(books(names)["moodle_feedback.zip"])) as packed:
        found = {}
        for path in packed.namelist():
            folder, file = path.split("/")
            _, number, *plugin, rest = folder.split("_", 4)
            assert plugin == ["assignsubmission", "file"] and (rest, file) == ("", "feedback.html")
            found[number] = packed.read(path).decode()
    assert set(found) == {"77", "78", "79", "80"}
    assert "1.5 of 4 points" in found["77"] and "4 of 4 points" in found["78"]


def test_names_that_no_platform_gave_make_no_gradebook():
    names = {"items.csv", "hints.csv", "items.html", "alike.csv", "alike.html"}
    assert set(books(["ann.ipynb", "bob_1"])) == names


def test_a_download_from_canvas_is_graded_into_its_gradebook(tmp_path):
    (tmp_path / "class").mkdir()
    for name, source in (("doejane_4321_98765_06_reward-1", RIGHT), ("roe_7_8_06_reward", ODD)):
        (tmp_path / "class" / f"{name}.ipynb").write_text(notebook(source))
    assert main([str(tmp_path / "class"), "--out", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out" / "canvas.csv").read_text()
    assert [row["ID"] for row in rows(text)] == ["", "4321", "7"]
    (item, *_) = rows((tmp_path / "out" / "items.csv").read_text())
    assert item["submissions"] == "2" and (tmp_path / "out" / "alike.html").exists()


def test_a_fault_in_a_report_costs_no_grade(tmp_path, monkeypatch, capsys):
    def breaks(*_):
        raise RecursionError("a bug of ours")

    monkeypatch.setattr(alike, "compare", breaks)
    for name in ("ann", "bob"):
        (tmp_path / "class" / name).mkdir(parents=True)
        (tmp_path / "class" / name / "06_reward.ipynb").write_text(notebook())
    assert main([str(tmp_path / "class"), "--out", str(tmp_path / "out")]) == 1
    assert "the reports: NOT WRITTEN, RecursionError" in capsys.readouterr().err
    table = rows((tmp_path / "out" / "class.csv").read_text())
    assert {row["6.1"] for row in table} == {f"{E61.points:g}"}


def test_one_submission_alone_has_no_statistics():
    assert list(reports([entry("ann")], [record("ann", exercise("6.1", 2))], ["6.1"])) == []
