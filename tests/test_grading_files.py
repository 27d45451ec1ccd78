"""Submissions as they come: odd names, damaged files, several attempts, whole kits, downloads.

A class of these is graded once; each costs at most itself.
"""

import contextlib
import csv
import errno
import json
import os
import re
import subprocess
import time
from xml.etree import ElementTree
from zipfile import ZipFile

import pytest

import tests.grade.__main__ as grading
from tests.grade import files, sandbox
from tests.grade.__main__ import main, safe
from tests.grade.cell.answer import STUB
from tests.grade.exercise import everything, find
from tests.grade.files import File, in_order, printable, released
from tests.grade.handed_in import Submission, is_one, submissions, wanted
from tests.grade.judge import Outcome, Result
from tests.grade.sheets import harmless
from tests.grade.submission import Unreadable, parse

E61 = find("6.1")
FULL = E61.points
WRONG = "def r1(z, z_E):\n    return 1.0"


def cell(source, **metadata):
    return {"cell_type": "code", "metadata": metadata, "source": source}


def notebook(source=E61.source, *more, **metadata):
    """Notebook 6 with an answer to 6.1 and nothing else."""
    cells = [cell(f"# Exercise 6.1\n{source}", **metadata), *map(cell, more)]
    return json.dumps({"cells": cells, "metadata": {}, "nbformat": 4, "nbformat_minor": 5})


def ran(source, when):
    """One whose cells have noted when they ran."""
    return notebook(source, execution={"iopub.execute_input": when})


RIGHT = notebook()
RAISES = "def r1(z, z_E):\n    raise ValueError('\\ud800 \\x1b[31m')"
# path in the class's folder: what is written there
PLAIN = {
    "ann/06_reward.ipynb": RIGHT,
    b"M\xfcller/06_reward.ipynb": RIGHT,
    "a lone surrogate/06_reward.ipynb": notebook(RAISES),
    "colours\x1b[31m\r/06_reward.ipynb": RIGHT,
    "turned \u202e round/06_reward.ipynb": RIGHT,
    "=SUM(A1)/=cmd().ipynb": "{",
    "06_reward.ipynb/06_reward.ipynb": RIGHT,
    "capitals/06_REWARD.IPYNB": RIGHT,
    "a browser's ending/06_reward.ipynb.txt": RIGHT,
    "UTF-16/06_reward.ipynb": RIGHT.encode("utf-16"),
    "UTF-8 with a mark/06_reward.ipynb": RIGHT.encode("utf-8-sig"),
    "Latin-1/06_reward.ipynb": notebook("# \xfc").replace("\\u00fc", "\xfc").encode("latin-1"),
    "a conflict/06_reward.ipynb": RIGHT.replace('"cells"', '\n<<<<<<< HEAD\n"a"\n=======\n', 1),
    "a conflict in a cell/06_reward.ipynb": notebook(
        f"<<<<<<< HEAD\n{WRONG}\n=======\n{E61.source}\n>>>>>>> main"
    ),
    "cut off/06_reward.ipynb": RIGHT[:-20],
    "a web page/06_reward.ipynb": "<!doctype html><title>Log in</title>",
    "empty/06_reward.ipynb": "",
    "many parts/06_reward.ipynb": '{"cells": [' + "{}," * 600_000 + "{}]}",
    "many cells/06_reward.ipynb": json.dumps({"cells": [cell("x = 1")] * 2_000}),
    "a damaged cell/06_reward.ipynb": RIGHT.replace('"cells": [', '"cells": [7, {"a": 1}, '),
    "two attempts/06_reward.ipynb": notebook(WRONG),
    "two attempts/06_reward (1).ipynb": RIGHT,
    "ten attempts/06_reward-9.ipynb": notebook(WRONG),
    "ten attempts/06_reward-10.ipynb": RIGHT,
    "the final one/06_reward_final.ipynb": RIGHT,
    "the final one/06_reward_v2.ipynb": notebook(WRONG),
    "dated/06_reward.ipynb": ran(E61.source, "2026-11-03T10:00:00"),
    "dated/06_reward (1).ipynb": ran(WRONG, "2026-11-02T10:00:00"),
    "doejane_4321_98765_06_reward-1.ipynb": RIGHT,
    "doejane_LATE_4321_98766_05_transporter.ipynb": json.dumps({"cells": []}),
    "doejane_4321_98767_report.pdf": "%PDF",
    "Jo Moe_77_assignsubmission_file_06_reward.ipynb": RIGHT,
    "Jo Moe_77_assignsubmission_file_plan.ipynb": json.dumps({"cells": []}),
    "Di Roe_78_assignsubmission_file_/06_reward.ipynb": RIGHT,
    "Di Roe_78_assignsubmission_onlinetext_/onlinetext.html": "<p>",
    "kit/lbw_minimal/reward.py": "",
    "kit/notebooks/06_reward.ipynb": RIGHT,
    "kit/solutions/06_reward.ipynb": notebook(WRONG),
    "kit/venv/pyvenv.cfg": "",
    "kit/venv/share/06_reward.ipynb": notebook(WRONG),
    "kit/lib/site-packages/x/06_reward.ipynb": notebook(WRONG),
    "kit/.ipynb_checkpoints/06_reward.ipynb": notebook(WRONG),
    "kit/__MACOSX/06_reward.ipynb": notebook(WRONG),
    "kit/notebooks/._06_reward.ipynb": "\0\5\x16\7",
    "a stray cell/06_reward.ipynb": RIGHT,
    "a stray cell/scratch.ipynb": json.dumps({"cells": [cell("# Exercise 7.3\nx = 1")]}),
    "__MACOSX/ann/._06_reward.ipynb": "\0\5\x16\7",
    "._ann.ipynb": "\0\5\x16\7",
    "desktop.ini": "",
    "Thumbs.db": "",
    ".DS_Store": "",
}
# submission: points, and a word of what is said
EXPECTED = {
    "ann": (FULL, ""),
    "M\\xfcller": (FULL, ""),
    "a lone surrogate": (0, "\\ud800 \\x1b[31m"),
    "colours\\x1b[31m\\x0d": (FULL, ""),
    "turned \\u202e round": (FULL, ""),
    "=SUM(A1)": (0, "=cmd().ipynb: no Jupyter notebook"),
    "06_reward.ipynb": (FULL, ""),
    "capitals": (FULL, ""),
    "a browser's ending": (FULL, ""),
    "UTF-16": (FULL, ""),
    "UTF-8 with a mark": (FULL, ""),
    "Latin-1": (0, "not UTF-8"),
    "a conflict": (0, "a merge conflict is left in it (<<<<<<<, near line 2)"),
    "a conflict in a cell": (0, "a merge conflict is left in its cell"),
    "cut off": (0, "its end is missing"),
    "a web page": (0, "a web page"),
    "empty": (0, "the file is empty"),
    "many parts": (0, "lists and objects"),
    "many cells": (0, "2,000 cells"),
    "a damaged cell": (FULL, ""),
    "two attempts": (FULL, "6.1 stands in 06_reward.ipynb, too; that of 06_reward (1).ipynb was"),
    "ten attempts": (FULL, "that of 06_reward-10.ipynb was graded"),
    "the final one": (FULL, "that of 06_reward_final.ipynb was graded"),
    "dated": (FULL, "that of 06_reward.ipynb was graded"),
    "doejane_4321": (FULL, ""),
    "Jo Moe_77": (FULL, ""),
    "Di Roe_78": (FULL, ""),
    "kit": (FULL, ""),
    "a stray cell": (FULL, ""),
    "a pipe": (0, "06_reward.ipynb: not a plain file"),
    "a pipe.ipynb": (0, "not a plain file"),
    "a link": (0, "06_reward.ipynb: not a plain file but a link"),
    "a loop": (0, "no notebook found"),
    "deep": (FULL, ""),
    "a page that cannot be written": (FULL, "could not be written"),
    "an empty result.json": (FULL, ""),
    "half a result.json": (FULL, ""),
}


def write(folder, path, text):
    path = folder / os.fsdecode(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())


@pytest.fixture(scope="module")
def graded(tmp_path_factory):
    """The odd class: its output folder, what was printed, and the workers that were started."""
    folder, out = tmp_path_factory.mktemp("class"), tmp_path_factory.mktemp("grades")
    for path, text in PLAIN.items():
        write(folder, path, text)
    for name in ("a page that cannot be written", "an empty result.json", "half a result.json"):
        write(folder, f"{name}/06_reward.ipynb", RIGHT)
        (out / safe(name)).mkdir()
    (out / safe("a page that cannot be written") / "feedback.html").mkdir()
    (out / safe("an empty result.json") / "result.json").touch()
    (out / safe("half a result.json") / "result.json").write_text('[{"digest": 1')
    (folder / "a pipe").mkdir()
    os.mkfifo(folder / "a pipe" / "06_reward.ipynb")
    os.mkfifo(folder / "a pipe.ipynb")
    (folder / "a link").mkdir()
    (folder / "a link" / "06_reward.ipynb").symlink_to(folder / "ann" / "06_reward.ipynb")
    (folder / "a loop").symlink_to(folder / "a loop")
    deep = folder / "deep"
    deep.mkdir()
    write(deep, "06_reward.ipynb", RIGHT)
    down = os.open(deep, os.O_RDONLY)
    for _ in range(2_100):  # longer than a path may be
        os.mkdir("d", dir_fd=down)
        down, up = os.open("d", os.O_RDONLY, dir_fd=down), down
        os.close(up)
    os.close(down)
    with pytest.MonkeyPatch.context() as patch:
        printed = []
        patch.setattr(grading, "say", lambda text, where=None: printed.append(printable(str(text))))
        patch.setattr(grading, "Sandbox", sandbox.Sandbox)  # not one whose worker waits already
        starts, command = [], sandbox.command
        patch.setattr(sandbox, "command", lambda fd: starts.append(fd) or command(fd))
        patch.setattr(sandbox, "LEAVING", 60)  # s: a machine with too much to do starts none anew
        assert main([str(folder), "--out", str(out), "--gradescope"]) == 1
    yield out, printed, starts
    subprocess.run(["rm", "-rf", deep], check=True)  # too deep for pytest to clean up


def rows(out):
    with (out / "class.csv").open(newline="") as file:
        return {row["submission"].lstrip("'"): row for row in csv.DictReader(file)}


@pytest.mark.parametrize("name", EXPECTED)
def test_an_odd_submission_gets_what_is_in_it_and_a_reason(graded, name):
    points, words = EXPECTED[name]
    row = rows(graded[0])[name]
    said = row["notes"]
    for path in graded[0].glob("*/result.json"):
        done = json.loads(path.read_text())
        if done["submission"] == name:
            said += " ".join(o["message"] for e in done["exercises"] for o in e["outcomes"])
    assert (float(row["6.1"]), words in said) == (points, True), said


def test_every_student_has_a_row_and_no_system_has_one(graded):
    assert set(rows(graded[0])) == set(EXPECTED)


def test_the_set_is_what_most_handed_in_and_it_is_said(graded):
    assert list(rows(graded[0])["ann"])[3:-1] == [f"6.{n}" for n in (1, 2, 3, 4, 5)]
    assert any(
        line.startswith("graded are the notebooks that were handed in: 6") for line in graded[1]
    )


def test_two_workers_do_for_a_class_and_progress_is_shown(graded):
    _, printed, starts = graded
    assert len(starts) == 2
    many = len(EXPECTED)
    assert sum(line.startswith(f"[{many}/{many}] ") for line in printed) == 1


def test_nothing_that_is_written_or_printed_holds_control_characters(graded):
    out, printed, _ = graded
    texts = [p.read_text() for p in out.rglob("*.*") if p.is_file() and p.suffix != ".zip"]
    with ZipFile(out / "moodle_feedback.zip") as packed:
        texts += [*packed.namelist(), *(packed.read(name).decode() for name in packed.namelist())]
    texts += printed
    assert not [t for t in texts if re.search("[\0-\x08\x0b-\x1f\x7f\u202e\ud800-\udfff]", t)]


def test_no_cell_of_the_table_begins_a_formula(graded):
    cells = [c for row in rows(graded[0]).values() for c in row.values()]
    text = (graded[0] / "class.csv").read_text()
    assert "'=SUM(A1)" in text and "'=cmd()" in text
    assert not [c for c in cells if c[:1] in "=+-@" and c]
    suites = ElementTree.parse(graded[0] / "junit.xml").getroot()
    assert {s.get("name") for s in suites} == set(EXPECTED)


@pytest.mark.parametrize(
    ("text", "safe_text"),
    [("=1", "'=1"), (" =1", " '=1"), ("a;=1", "a;'=1"), ("a\n@b", "a\n'@b"), ("-1", "'-1"),
     ("\uff1d1", "'\uff1d1"), ("a-b", "a-b"), ("ann", "ann"), ("", "")],
)  # fmt: skip
def test_a_formula_is_made_text_wherever_a_spreadsheet_may_see_its_begin(text, safe_text):
    assert harmless(text) == safe_text


# What a full disk, a closed terminal and missing rights do


@pytest.fixture
def ann(tmp_path, monkeypatch):
    """A class of one, graded without a sandbox."""
    points = {"6.1": [Outcome("", FULL, FULL)]}
    results = [Result(id, "", points.get(id, [])) for id in everything() if id[0] == "6"]
    monkeypatch.setattr(grading, "grade", lambda *_: (results, []))
    write(tmp_path / "class", "ann/06_reward.ipynb", RIGHT)
    return [str(tmp_path / "class"), "--out", str(tmp_path / "out")]


def test_on_a_full_disk_the_table_is_printed(ann, monkeypatch, capsys):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(grading, "write_atomic", full)
    assert main(ann) == 1
    said = capsys.readouterr()
    assert "class.csv: NOT WRITTEN, No space left on device" in said.err
    line = next(line for line in said.out.splitlines() if line.startswith("ann,"))
    assert line.startswith(f"ann,{FULL:g},") and "could not be written" in line


def test_a_terminal_that_is_gone_stops_no_class(ann, tmp_path, monkeypatch):
    def gone(*_, **__):
        raise BrokenPipeError

    monkeypatch.setattr("builtins.print", gone)
    assert main(ann) == 0
    assert rows(tmp_path / "out")["ann"]["6.1"] == f"{FULL:g}"


@pytest.mark.skipif(os.geteuid() == 0, reason="needs a user who may not read every file")
def test_a_file_without_the_right_to_read_it_is_said(tmp_path):
    write(tmp_path, "ann/06_reward.ipynb", RIGHT)
    (tmp_path / "ann" / "06_reward.ipynb").chmod(0)
    write(tmp_path, "bob/x/06_reward.ipynb", RIGHT)
    (tmp_path / "bob" / "x").chmod(0)
    (file,), _ = Submission.of(tmp_path / "ann").files()
    assert file.why == "cannot be read (Permission denied)"
    assert Submission.of(tmp_path / "bob").files()[1] == ["x/: cannot be read (Permission denied)"]
    (tmp_path / "bob" / "x").chmod(0o700)


# What counts


def test_one_student_does_not_change_what_the_class_is_graded_in(tmp_path):
    for name in ("ann", "bob", "cy"):
        write(tmp_path, f"{name}/06_reward.ipynb", RIGHT)
    write(tmp_path, "ann/07_slide.ipynb", json.dumps({"cells": [cell("# Exercise 7.3\nx = 1")]}))
    ids, said = wanted(None, submissions(tmp_path, tmp_path / "out"))
    assert {id[0] for id in ids} == {"6"}
    assert "not 7 (by 1 of 3): --notebooks 6,7 would" in said
    assert {id[0] for id in wanted("7", submissions(tmp_path, tmp_path / "out"))[0]} == {"7"}


def test_a_notebook_as_it_was_handed_out_counts_only_where_nobody_did_more(tmp_path):
    stub = f"def r1(z, z_E):\n    {STUB}"
    for name in ("ann", "bob", "cy"):
        write(tmp_path, f"{name}/06_reward.ipynb", notebook(stub))
    assert wanted(None, submissions(tmp_path, tmp_path / "out"))[0][0] == "6.1"
    done = json.dumps({"cells": [cell("# Exercise 7.3\nx = 1")]})
    write(tmp_path, "ann/07_slide.ipynb", done)
    assert wanted(None, submissions(tmp_path, tmp_path / "out"))[0][0] == "7.1"


@pytest.mark.parametrize(
    ("names", "one"),
    [
        (["06_reward.ipynb"], True),
        (["06_reward.ipynb", "scratch.ipynb"], True),
        (["06_reward.ipynb", "06_reward (1).ipynb"], True),
        (["lbw_minimal/__init__.py", "notebooks/06_reward.ipynb", "x/y.ipynb"], True),
        (["ann.ipynb"], False),
        (["06_reward.ipynb", "ann.ipynb"], False),  # both answer notebook 6
        (["06_reward.ipynb", "ann/06_reward.ipynb"], False),
        (["ann/06_reward.ipynb"], False),
    ],
)
def test_a_folder_is_one_submission_or_a_class(tmp_path, names, one):
    for name in names:
        scratch = json.dumps({"cells": [cell("x = 1")]})
        write(tmp_path, name, scratch if "scratch" in name else notebook())
    assert is_one(tmp_path) == one


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("06_reward.ipynb", "06_reward"),
        ("a/06_Reward - Copy (2).IPYNB", "06_reward"),
        ("06_reward_final_final.ipynb", "06_reward"),
        ("06_reward-10.ipynb", "06_reward"),
        ("06_reward_v2.ipynb.txt", "06_reward"),
        ("Copy of 06_reward.ipynb", "06_reward"),
        ("Kopie von Copy of 06_Reward (1).ipynb", "06_reward"),
        ("Copies of 06_reward.ipynb", ""),
        ("06_reward_miller.ipynb", ""),
        ("06_reward_1234567.ipynb", ""),  # a student's number
        ("06_rewards.ipynb", ""),
        ("06_reward" + "1" * 200 + "x.ipynb", ""),
    ],
)
def test_a_later_version_is_known_by_its_name(name, stem):
    assert released(name) == stem


def test_a_copy_is_later_than_what_it_was_copied_from():
    old, new = File("06_reward.ipynb", changed=2.0), File("Copy of 06_reward.ipynb", changed=1.0)
    assert in_order([new, old]) == [old, new]


def test_of_versions_without_a_date_the_one_written_last_counts():
    old, new = File("a/06_reward.ipynb", changed=1.0), File("06_reward.ipynb", changed=2.0)
    other = File("z.ipynb", changed=3.0)
    assert in_order([new, other, old]) == [other, old, new]


def test_a_submission_of_many_files_has_an_end(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "LOOKED_AT", 30)
    monkeypatch.setattr(files, "MANY", 3)
    for n in range(9):
        write(tmp_path, f"{n}.ipynb", RIGHT)
    write(tmp_path, "x/06_reward.ipynb", RIGHT)
    found, said = Submission.of(tmp_path).files()
    assert (found[0].name, len(found)) == ("x/06_reward.ipynb", 3)
    assert said == ["10 notebooks, of which 3 were read"]
    for n in range(30):
        write(tmp_path, f"y/{n}", "")
    assert "not all of them were looked at" in Submission.of(tmp_path).files()[1][0]


# Cells of IPython's, and what reading costs


@pytest.mark.parametrize(
    ("source", "python"),
    [
        ("!ls\nx = 1", "pass\nx = 1"),
        ("%timeit f(\nx = 1", "pass\nx = 1"),
        ("files = !ls\nx = 1", "files = None\nx = 1"),
        ("x = 1\nx?\n?x\nx.y??", "x = 1\npass\npass\npass"),
        ("if 1:\n    %time x\ny = (1\n    % 2)", "if 1:\n    x\ny = (1\n    % 2)"),
        ('!ls\nx = """\n!ls\nwhy?\n"""\n!ls', 'pass\nx = """\n!ls\nwhy?\n"""\npass'),
        ("!ls \\\n  -l\nx = 1", "pass\nx = 1"),
        ("%%time\nx = 1", "x = 1"),
        (">>> x = 1\n>>> y = 2", "x = 1\ny = 2"),
        ("    x = 1\n    !ls", "x = 1\npass"),
        ("!echo it's (\nx = ')'\n!ls", "pass\nx = ')'\npass"),
        ("%time x = f(1)\n    %time f(2)\ny = %time f(3)", "x = f(1)\n    f(2)\ny = f(3)"),
        ("%time !ls\n%timeit x = 1\n%time", "pass\npass\npass"),
    ],
)
def test_ipythons_lines_are_left_out(source, python):
    text = json.dumps({"cells": [cell(source)]}).encode()
    assert parse(File("a.ipynb", text)).cells[0].source.strip() == python


@pytest.mark.parametrize(
    "cells",
    [
        [("x = [1, 2, 3]\n" * 20 + "!ls\n") * 400],
        ["\n".join(f"def f{i}(x):\n    return f{i + 1}(x)" for i in range(8_000))],
        [f"def f{i}(x):\n    return f{i + 1}(x)" for i in range(900)],
        ["x" + ".y" * 90_000],
        ["<<<<<<< a\n" * 15_000],
        ["%x = " * 30_000],
        ["'''" + "\\" * 150_000],
        ["%" + "(" * 150_000],
        ["!ls\n" + "'" * 150_000],
        ["x" * 199_000] * 90,
    ],
    ids=["magics", "functions", "cells", "dots", "conflicts", "escapes", "strings", "brackets",
         "quotes", "length"],
)  # fmt: skip
def test_reading_a_notebook_takes_no_time(cells):
    text = json.dumps({"cells": [*map(cell, cells), cell(f"# Exercise 6.1\n{E61.source}")]})
    began = time.process_time()
    with contextlib.suppress(Unreadable):
        parse(File("a.ipynb", text.encode()))
    assert time.process_time() - began < 3
