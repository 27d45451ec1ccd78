"""Grading a class of which some crash, hang, or cheat.

Each gets what its answers are worth, and nobody else pays for it. The submissions are notebook 6,
with exercise 6.1 answered in one of many bad ways.
"""

import copy
import csv
import functools
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest

import tests.grade.__main__ as grading
from tests.grade import judge as judging
from tests.grade import sandbox
from tests.grade.__main__ import main, safe
from tests.grade.cell.answer import STUB
from tests.grade.cell.walls import has_landlock
from tests.grade.exercise import Exercise, find
from tests.grade.files import File
from tests.grade.judge import _questions
from tests.grade.sandbox import Sandbox
from tests.grade.submission import Answer
from tests.kept import Kept

pytestmark = pytest.mark.usefixtures("workers_wait")

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "solutions" / "06_reward.ipynb"
SOLVED = json.loads(SOURCE.read_text())
E61 = find("6.1")
REWARD = [f"6.{i}" for i in range(1, 6)]
REST = sum(find(f"6.{i}").points for i in (2, 3, 4, 5))
RIGHT = E61.source
NEEDS = RIGHT.replace("    return", "    got\n    return")  # what it could not get hold of
COUNTING = RIGHT.replace("    return", "    global calls\n    calls += 1\n    return")
# What 6.1 is answered with, and how many points that is worth.
BAD = {
    "endless loop": ("def r1(z, z_E):\n    while True:\n        pass", 0),
    "sleep": ("import time\ndef r1(z, z_E):\n    time.sleep(10_000)", 0),
    "fork bomb": ("import os\nwhile True:\n    os.fork()", 0),
    "fork bomb, quiet": (
        "import os\nfor _ in range(10_000):\n    try:\n        os.fork()\n"
        "    except OSError:\n        pass\n" + RIGHT,
        E61.points,
    ),
    "100 GB": ("def r1(z, z_E):\n    return np.ones(100 << 27).sum()", 0),
    "a gigabyte printed": (
        "import sys\nfor _ in range(1 << 10):\n    sys.stdout.write('x' * (1 << 20))\n" + RIGHT,
        E61.points,
    ),
    "a full disk": ("def r1(z, z_E):\n    open('/tmp/x', 'wb').write(b'0' * (1 << 34))", 0),
    "os._exit(0)": ("import os\ndef r1(z, z_E):\n    os._exit(0)", 0),
    "sys.exit": ("import sys\nsys.exit()", 0),
    "sys.exit when called": ("import sys\ndef r1(z, z_E):\n    sys.exit(0)", 0),
    "kills the parent": ("import os\nos.kill(os.getppid(), 9)\n" + RIGHT, E61.points),
    "kills everybody, quietly": (
        "import os\nfor pid in {os.getppid(), 0, -1, *range(2, 400)} - {os.getpid()}:\n"
        "    try:\n        os.kill(pid, 9)\n    except OSError:\n        pass\n" + RIGHT,
        E61.points,
    ),
    "ignores signals": (
        "import signal\nfor s in (2, 3, 14, 15, 24):\n    signal.signal(s, signal.SIG_IGN)\n"
        "def r1(z, z_E):\n    while True:\n        pass",
        0,
    ),
    "patched comparisons": (
        "for name in ('allclose', 'isclose', 'array_equal'):\n"
        "    setattr(np, name, lambda *a, **k: True)\n"
        "torch.allclose = lambda *a, **k: True\ndef r1(z, z_E):\n    return 1.0",
        0,
    ),
    "patched wire": (
        "import wire\nwire.encode = lambda value: b'you win'\n" + RIGHT,
        E61.points,
    ),
    "equals everything": (
        "class Yes(float):\n    __hash__ = None\n"
        "    def __eq__(self, other):\n        return True\n"
        "def r1(z, z_E):\n    return Yes(1)",
        0,
    ),
    "NaN": ("def r1(z, z_E):\n    return float('nan')", 0),
    "wrong shape": ("def r1(z, z_E):\n    return np.zeros((2, 2))", 0),
    "wrong type": ("def r1(z, z_E):\n    return 'a large reward'", 0),
    "wrong dtype": ("def r1(z, z_E):\n    return np.zeros((), complex) + 1j", 0),
    "other device": ("def r1(z, z_E):\n    return torch.zeros((), device='meta')", 0),
    "changes an input": (RIGHT.replace("    return", "    z_E[:] = 0\n    return"), 0),
    "counts its calls": (
        "calls = 0\n" + COUNTING.replace("return", "return calls * "), 0,
    ),
    "counts, right at first": (
        "calls = 0\n" + COUNTING.replace("return", "return (calls > 9) + "), 0,
    ),
    "reads the solutions": (f"got = open({str(SOURCE)!r}).read()\n" + NEEDS, 0),
    "reads another submission": ("got = open(CLASS + '/good/06_reward.ipynb').read()\n" + NEEDS, 0),
    "reads the checks": (
        f"got = open({str(ROOT / 'tests' / 'test_grading.py')!r}).read()\n" + NEEDS, 0,
    ),
    "opens a socket": ("import socket\ngot = socket.socket()\n" + NEEDS, 0),
    "imports the answer": (
        "from lbw_minimal.reward import LiteralReward\n"
        "def r1(z, z_E):\n    return LiteralReward(z_E)(z, z)[1]['r1']",
        0,
    ),
    "imports when called": (
        "def r1(z, z_E):\n    from lbw_minimal.reward import LiteralReward\n    return 0.0", 0,
    ),
    "starts a program": ("import subprocess\ngot = subprocess.run(['ls'])\n" + NEEDS, 0),
    "forges the channel": (
        "import os\ndef r1(z, z_E):\n    for fd in range(3, 64):\n"
        "        try:\n            os.write(fd, bytes(8) + b'{}' * 100)\n"
        "        except OSError:\n            pass\n"
        + "\n".join(RIGHT.splitlines()[1:]),
        0,
    ),
    "forges the channel beside its answer": (
        "import os\nfor fd in range(3, 64):\n"
        "    try:\n        os.write(fd, bytes(8) + b'{}' * 100)\n"
        "    except OSError:\n        pass\n" + RIGHT,
        E61.points,  # tried again with its definitions alone, which are right
    ),
    "nearly always the same": ("def r1(z, z_E):\n    return -1e-9 * np.abs(z).sum()", 0),
    "endless recursion": ("def r1(z, z_E):\n    return r1(z, z_E)", 0),
    "crashes Python": ("import ctypes\nctypes.string_at(0)", 0),
    "a list that holds itself": ("def r1(z, z_E):\n    x = []\n    x.append(x)\n    return x", 0),
    "no Python": ("this is no Python", 0),
    "a thread that stays": (
        "import threading, time\n"
        "threading.Thread(target=time.sleep, args=(10_000,)).start()\n" + RIGHT,
        E61.points,
    ),
    # Right answers that do not look like ours.
    "the stub left below": (RIGHT + f"    {STUB}\n", E61.points),
    "the stub as a comment": (f"# {STUB}\n{RIGHT}", E61.points),
    "a lambda": (
        "r1 = lambda z, z_E: -np.sqrt(((z_E[:-1] - z) ** 2).sum((1, 2))).min()", E61.points,
    ),
    "tries it out": (
        f"{RIGHT}\nprint(r1(z_E[0], z_E))\ndisplay(r1)\nassert not r1(z_E[0], z_E)", E61.points,
    ),
    "checks itself": (f"from tests.grade import check\n{RIGHT}\ncheck('6.1')", E61.points),
    "plots": (f"import matplotlib.pyplot as plt\n{RIGHT}\nplt.plot([0, 1])", E61.points),
    "magic": (f"%%time\n{RIGHT}\nnp.linalg.norm?\n!ls\n%timeit r1", E61.points),
    "a line that begins with %": (RIGHT + "\nprint('%s of %s'\n      % (1, 2))", E61.points),
    "from the future": ("from __future__ import annotations\n" + RIGHT, E61.points),
}  # fmt: skip


def learnt_by_heart(exercise):
    """An answer that has the inputs of the students' own check and their results in a table."""
    reference, table = exercise.run(exercise.source), {}
    for _, args in _questions(exercise, 0):
        table[b"".join(x.tobytes() for x in args)] = float(reference(args))
    lookup = "[z.tobytes() + z_E.tobytes()]"
    return f"TABLE = {table!r}\ndef r1(z, z_E):\n    return TABLE{lookup}"


BAD["learnt by heart"] = (learnt_by_heart(E61), 0)
READERS = [name for name in BAD if name.startswith("reads ")]
CLOSED = shutil.which("bwrap") or has_landlock()


def cell_of(notebook, grade_id):
    marks = (cell["metadata"].get("nbgrader", {}) for cell in notebook["cells"])
    pairs = zip(notebook["cells"], marks, strict=True)
    return next(cell for cell, mark in pairs if mark.get("grade_id") == grade_id)


def answered(source):
    """Notebook 6 as JSON, all solved but 6.1, which is `source`."""
    notebook = copy.deepcopy(SOLVED)
    cell_of(notebook, "ex-6-1")["source"] = source
    return notebook


def write(folder, name, notebook):
    (folder / name).mkdir(parents=True)
    text = notebook if isinstance(notebook, str) else json.dumps(notebook)
    (folder / name / "06_reward.ipynb").write_text(text)


def grades(out):
    """submission -> (points of 6.1, points of all others, messages)."""
    found = {}
    for path in out.glob("*/result.json"):
        done = json.loads(path.read_text())
        first, *others = done["exercises"]
        said = {o["message"] for o in first["outcomes"]} | set(done["notes"])
        rest = sum(e["points"] for e in others)
        found[done["submission"]] = first["points"], rest, " ".join(sorted(said))
    return found


@pytest.fixture(scope="module")
def class_of_cheats(tmp_path_factory):
    """The grades of a class with all of BAD and an honest student in it."""
    folder, out = tmp_path_factory.mktemp("class"), tmp_path_factory.mktemp("grades")
    write(folder, "good", SOLVED)
    for name, (source, _) in BAD.items():
        write(folder, name, answered(source.replace("CLASS", repr(str(folder)))))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sandbox, "WALL", 4)
        patch.setattr(sandbox, "CPU", 2)
        assert main([str(folder), "--out", str(out), "--notebooks", "6"]) == 0
    return grades(out)


@pytest.mark.parametrize("name", BAD)
def test_a_bad_answer_gets_what_it_is_worth_and_the_others_count(class_of_cheats, name):
    if name in READERS and not CLOSED:
        pytest.skip("needs bubblewrap or Landlock; the grader warns of it")
    first, others, message = class_of_cheats[name]
    assert (first, others) == (BAD[name][1], REST), message
    assert message or first == E61.points


def test_the_honest_student_of_that_class_has_all_points(class_of_cheats):
    assert class_of_cheats["good"][:2] == (E61.points, REST)


def test_what_a_cell_could_not_get_is_said(class_of_cheats):
    for name in ("opens a socket", "starts a program"):
        assert "the cell had failed: PermissionError" in class_of_cheats[name][2]


def test_importing_the_answer_gets_a_hint_that_says_so(class_of_cheats):
    for name in ("imports the answer", "imports when called"):
        assert "your own lines" in class_of_cheats[name][2]


# Notebooks that are not what they should be


def without(grade_id):
    notebook = copy.deepcopy(SOLVED)
    notebook["cells"].remove(cell_of(notebook, grade_id))
    return notebook


def duplicated():
    notebook = copy.deepcopy(SOLVED)
    stub = copy.deepcopy(cell_of(notebook, "ex-6-1"))
    stub["source"] = 'def r1(z, z_E):\n    raise NotImplementedError("your lines here")'
    notebook["cells"] += [stub]
    return notebook


def reordered():
    notebook = copy.deepcopy(SOLVED)
    notebook["cells"].reverse()
    return notebook


def renamed():
    notebook = copy.deepcopy(SOLVED)
    cell_of(notebook, "ex-6-1")["metadata"]["nbgrader"]["grade_id"] = "my-first-exercise"
    return notebook


def other_kernel():
    notebook = copy.deepcopy(SOLVED)
    notebook["metadata"] = {
        "kernelspec": {"name": "julia-1.11", "language": "julia", "display_name": "Julia"}
    }
    return notebook


def strange_metadata():
    notebook = copy.deepcopy(SOLVED)
    notebook["cells"][1]["metadata"] = {"nbgrader": [1, 2, 3]}
    magics = {"cell_type": "code", "metadata": {}, "source": ["%timeit 1\n", "!ls\n"]}
    notebook["cells"].append(magics)
    return notebook


def more(below, above=(), own=f"def r1(z, z_E):\n    {STUB}"):
    """Notebook 6 with other cells around that of 6.1."""
    notebook = answered(own)
    at = notebook["cells"].index(cell_of(notebook, "ex-6-1"))
    new = [{"cell_type": "code", "metadata": {}, "source": text} for text in (*above, *below)]
    notebook["cells"][at + 1 : at + 1] = new[len(above) :]
    notebook["cells"][at:at] = new[: len(above)]
    return notebook


def split():
    notebook = more([""], own=RIGHT)
    at = notebook["cells"].index(cell_of(notebook, "ex-6-1"))
    notebook["cells"][at + 1]["metadata"] = notebook["cells"][at]["metadata"]
    return notebook


def unmarked():
    """Neither grade ids nor the lines that name the exercises."""
    notebook = copy.deepcopy(SOLVED)
    for cell in notebook["cells"]:
        cell["metadata"] = {}
        cell["source"] = re.sub(r"^# Exercise .*\n", "", "".join(cell["source"]))
    return notebook


USES = (
    "def r1(z, z_E):\n"
    "    return -sqrt(sq(z_E[:-1] - z).sum(AXES).min() + EPS) * ONE + length(z - z)"
)
HELPERS = [
    "from math import *",
    "sq = lambda x: np.square(x)",
    "ONE, TWO = 1, 2",
    "EPS: float = 0.0",
    "AXES = tuple(np.array([1, 2]))",
    "length = np.linalg.norm",
]
FULL = E61.points + REST
ODD = {
    "invalid JSON": ('{"cells": [', 0),
    "deep JSON": ("[" * 100_000, 0),
    "no cells": ('{"nbformat": 4}', 0),
    "nothing at all": ("", 0),
    "an empty notebook": ('{"cells": [], "metadata": {}, "nbformat": 4, "nbformat_minor": 5}', 0),
    "a cell deleted": (without("ex-6-1"), REST),
    "a cell duplicated": (duplicated(), FULL),
    "cells reordered": (reordered(), FULL),
    "a grade id renamed": (renamed(), FULL),
    "answered in a cell below": (more([RIGHT]), FULL),
    "a helper in the cell, the answer below": (
        more([RIGHT.replace("np.sqrt", "root")], own="root = np.sqrt"),
        FULL,
    ),
    "a cell split in two": (split(), FULL),
    "helpers of all kinds": (more([], HELPERS, USES), FULL),
    "a helper that means something else below": (
        more(
            ["def length(x):\n    return 0"],
            ["length = np.linalg.norm"],
            RIGHT.replace(
                "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=(1, 2)))",
                "np.array([length(x - z) for x in z_E[:-1]])",
            ),
        ),
        FULL,
    ),
    "no marks at all": (unmarked(), FULL),
    "another kernel": (other_kernel(), FULL),
    "strange metadata": (strange_metadata(), FULL),
    "José Müller  (2)": (SOLVED, FULL),
    "..\\..\\evil": (SOLVED, FULL),
    "<script>alert(1)</script>"[:8] + "> & 'x'": (SOLVED, FULL),
    "=cmd()": (SOLVED, FULL),
}


@pytest.fixture(scope="module")
def class_of_odd_files(tmp_path_factory):
    folder, out = tmp_path_factory.mktemp("odd"), tmp_path_factory.mktemp("grades")
    for name, (notebook, _) in ODD.items():
        write(folder, name, notebook)
    with (folder / "200 MB.ipynb").open("wb") as f:
        f.truncate(200 << 20)
    (folder / "an empty folder").mkdir()
    (folder / "a link").symlink_to(ROOT / "solutions")
    assert main([str(folder), "--out", str(out), "--notebooks", "6", "--gradescope"]) == 0
    return folder, out


@pytest.mark.parametrize("name", ODD)
def test_an_odd_notebook_gets_what_is_in_it(class_of_odd_files, name):
    first, others, message = grades(class_of_odd_files[1])[name]
    assert first + others == ODD[name][1], message


@pytest.mark.parametrize("name", ["200 MB.ipynb", "an empty folder", "a link"])
def test_what_is_no_notebook_gets_nothing_and_a_reason(class_of_odd_files, name):
    first, others, message = grades(class_of_odd_files[1])[name]
    assert first + others == 0
    assert "notebook" in message


def test_results_stay_in_their_folder_whatever_a_submission_is_called(class_of_odd_files):
    folder, out = class_of_odd_files
    entries = {p.name for p in folder.iterdir()}
    assert {p.name for p in out.iterdir() if p.is_dir()} == {safe(name) for name in entries}
    assert safe("../../x") != safe("....x") and "/" not in safe("../../x")


def test_the_class_table_has_a_row_each_and_no_formula(class_of_odd_files):
    folder, out = class_of_odd_files
    rows = list(csv.reader((out / "class.csv").open()))
    assert len(rows) == 1 + len(list(folder.iterdir()))
    assert rows[0][:3] == ["submission", "points", "of"]
    assert "'=cmd()" in {row[0] for row in rows}


def test_junit_and_gradescope_hold_the_same_points(class_of_odd_files):
    _, out = class_of_odd_files
    suites = ElementTree.parse(out / "junit.xml").getroot()
    failed = {s.get("name"): int(s.get("failures")) for s in suites}
    kinds = ("another kernel", "a cell deleted", "invalid JSON")
    assert [failed[kind] for kind in kinds] == [0, 1, 5]
    tests = json.loads((out / safe("a cell deleted") / "results.json").read_text())["tests"]
    first, second = [(t["number"], t["score"]) for t in tests][:2]
    assert (first, second) == (("6.1", 0), ("6.2", find("6.2").points))
    assert sum(t["max_score"] for t in tests) == FULL


def test_a_page_says_what_was_wrong_and_runs_nothing(class_of_odd_files):
    _, out = class_of_odd_files
    page = (out / safe("<script>> & 'x'") / "feedback.html").read_text()
    assert "<script>" not in page and "&lt;script&gt;" in page


# The grader itself


def test_two_gradings_are_equal_to_the_byte(tmp_path):
    write(tmp_path / "class", "ann", answered(E61.wrong(E61.mistakes[0])))
    write(tmp_path / "class", "bob", SOLVED)
    for out in ("a", "b"):
        line = [str(tmp_path / "class"), "--out", str(tmp_path / out), "-j", "1", "--seed", "3"]
        assert main(line) == 0
    for a in sorted((tmp_path / "a").rglob("*.*")):
        assert a.read_bytes() == (tmp_path / "b" / a.relative_to(tmp_path / "a")).read_bytes()


def test_a_killed_grading_goes_on_and_repeats_nothing(tmp_path):
    for i in range(6):
        write(tmp_path / "class", f"s{i}", answered(f"# {i}\n{RIGHT}"))
    line = [str(tmp_path / "class"), "--out", str(tmp_path / "out"), "-j", "1"]
    command = [sys.executable, "-m", "tests.grade", *line]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, start_new_session=True)
    deadline = time.monotonic() + 120
    while len(list((tmp_path / "out").glob("*/result.json"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    done = {p: p.stat().st_mtime_ns for p in (tmp_path / "out").glob("*/result.json")}
    assert 2 <= len(done) < 6
    assert main(line) == 0
    assert len(list((tmp_path / "out").glob("*/result.json"))) == 6
    assert all(p.stat().st_mtime_ns == t for p, t in done.items())


def test_a_changed_submission_is_graded_again(tmp_path):
    write(tmp_path / "class", "ann", answered(E61.wrong(E61.mistakes[0])))
    main([str(tmp_path / "class"), "--out", str(tmp_path / "out")])
    (tmp_path / "class" / "ann" / "06_reward.ipynb").write_text(json.dumps(SOLVED))
    main([str(tmp_path / "class"), "--out", str(tmp_path / "out")])
    assert grades(tmp_path / "out")["ann"][0] == E61.points


def test_one_submission_is_a_job_of_its_own(tmp_path):
    write(tmp_path / "class", "ann", SOLVED)
    for entry in (tmp_path / "class" / "ann", tmp_path / "class" / "ann" / "06_reward.ipynb"):
        assert main([str(entry), "--out", str(tmp_path / "out")]) == 0
    assert {name: g[:2] for name, g in grades(tmp_path / "out").items()} == {
        "ann": (E61.points, REST),
        "06_reward.ipynb": (E61.points, REST),
    }


def opened(monkeypatch):
    """The ids of exercises in the order in which processes are started for them."""
    ids, start = [], Sandbox.open

    def noted(box, exercise, *args, **how):
        ids.append(exercise.id)
        return start(box, exercise, *args, **how)

    monkeypatch.setattr(Sandbox, "open", noted)
    return ids


def test_a_right_answer_is_repeated_in_the_next_ones_process(monkeypatch):
    ids = opened(monkeypatch)
    results, _ = grading.grade([File("06_reward.ipynb", json.dumps(SOLVED).encode())], REWARD)
    assert sum(r.points for r in results) == FULL
    assert ids == [*REWARD, "6.5"]


def test_an_answer_that_spoils_its_process_costs_no_other_exercise(monkeypatch):
    """6.2 is right, and leaves numpy broken when it is called: 6.1 is repeated elsewhere."""
    notebook = answered(RIGHT)
    spoilt = find("6.2").source.replace("return ", "value = ").rstrip()
    spoilt += "\n    np.sqrt = lambda x: x * 0\n    return value\n"
    spoilt = "import numpy as np\nroot = np.sqrt\n" + spoilt.replace("np.sqrt(", "root(")
    cell_of(notebook, "ex-6-2")["source"] = spoilt
    ids = opened(monkeypatch)
    file = File("06_reward.ipynb", json.dumps(notebook).encode())
    results, _ = grading.grade([file], ["6.1", "6.2"])
    assert [r.points for r in results] == [r.most for r in results]
    assert ids.count("6.1") == 3  # judged; judged again, and then repeated, by processes of its own


def test_what_breaks_the_grader_costs_one_submission_and_is_told(tmp_path, monkeypatch, capsys):
    write(tmp_path / "class", "ann", answered("# a bug"))
    write(tmp_path / "class", "bob", SOLVED)
    right = grading.grade

    def breaks(files, ids, seed, box):
        if b"a bug" in files[0].data:
            raise RuntimeError("a bug of ours")
        return right(files, ids, seed, box)

    monkeypatch.setattr(grading, "grade", breaks)
    assert main([str(tmp_path / "class"), "--out", str(tmp_path / "out")]) == 1
    assert "ann: NOT GRADED" in capsys.readouterr().err
    assert set(grades(tmp_path / "out")) == {"bob"}
    rows = list(csv.reader((tmp_path / "out" / "class.csv").open()))
    assert [row[0] for row in rows] == ["submission", "ann", "bob"]
    assert "a bug of ours" in rows[1][-1]


@pytest.mark.parametrize(
    "line",
    ["nowhere", "empty", "class --notebooks 66", "class --notebooks 6,x", "a.zip",
     "class --out a.zip", "class --out a.zip/x", "no_notebooks"],
)  # fmt: skip
def test_a_wrong_command_is_one_sentence(tmp_path, capsys, monkeypatch, line):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "class", "ann", SOLVED)
    (tmp_path / "empty").mkdir()
    (tmp_path / "no_notebooks" / "ann").mkdir(parents=True)
    (tmp_path / "a.zip").write_bytes(b"PK")
    assert main(line.split()) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_flat_folder_is_a_class_unless_its_names_are_those_of_the_course(tmp_path):
    (tmp_path / "flat").mkdir()
    (tmp_path / "one").mkdir()
    for path in ("flat/ann.ipynb", "flat/bob.ipynb", "one/06_reward.ipynb"):
        (tmp_path / path).write_text(json.dumps(unmarked()))
    # Inside the class: it is no submission, neither then nor later.
    out = tmp_path / "flat" / "grades"
    for folder in ("flat", "flat", "one"):
        assert main([str(tmp_path / folder), "--out", str(out), "--notebooks", " 06"]) == 0
    assert {name: sum(g[:2]) for name, g in grades(out).items()} == {
        "ann.ipynb": FULL, "bob.ipynb": FULL, "one": FULL,
    }  # fmt: skip


def test_one_students_marks_and_a_loose_notebook_do_not_stop_the_class(tmp_path):
    strange = copy.deepcopy(SOLVED)
    marks = (("ex-99-1", "x = 1"), (["ex-6-1"], "y = 1"), ("z", "# Exercise 77.3\nz = 1"))
    for grade_id, source in marks:
        note = {"nbgrader": {"grade_id": grade_id}}
        strange["cells"].append({"cell_type": "code", "metadata": note, "source": source})
    write(tmp_path / "class", "ann", strange)
    write(tmp_path / "class", "bob", SOLVED)
    (tmp_path / "class" / "06_reward.ipynb").write_text(json.dumps(SOLVED))
    assert main([str(tmp_path / "class"), "--out", str(tmp_path / "out")]) == 0
    assert {name: sum(g[:2]) for name, g in grades(tmp_path / "out").items()} == {
        "ann": FULL, "bob": FULL, "06_reward.ipynb": FULL,
    }  # fmt: skip


def test_an_interrupted_grading_says_how_to_go_on(tmp_path, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    write(tmp_path / "class", "ann", SOLVED)
    monkeypatch.setattr(grading, "grade", interrupted)
    assert main([str(tmp_path / "class"), "--out", str(tmp_path / "out")]) == 130
    assert "goes on where" in capsys.readouterr().err


def test_of_two_versions_the_one_with_the_released_name_counts_and_it_is_said(tmp_path):
    write(tmp_path / "class", "ann", SOLVED)
    (tmp_path / "class" / "ann" / "z_old.ipynb").write_text(
        json.dumps(answered("def r1(z, z_E):\n    return 1"))
    )
    assert main([str(tmp_path / "class"), "--out", str(tmp_path / "out")]) == 0
    first, others, message = grades(tmp_path / "out")["ann"]
    assert (first, others) == (E61.points, REST) and "6.1 stands in z_old.ipynb, too" in message


def test_an_answer_that_counts_its_calls_and_remembers_what_it_said_earns_nothing():
    """It has guessed the order of the questions, and says the same again to what it has heard."""
    exercise = find("10.4")
    said = [str(exercise.run(exercise.source)(args)) for _, args in _questions(exercise, 2)]
    source = (
        f"said, heard = {said!r}, {{}}\n"
        "def verdict(*args):\n"
        "    key = b''.join(x.tobytes() for x in args)\n"
        "    return heard.setdefault(key, said[min(len(heard), len(said) - 1)])\n"
    )
    with Kept() as box:
        result = grading.grade_one(exercise, Answer(source, [], ""), box, seed=2)
    assert result.points == 0
    assert "after other inputs" in " ".join(result.lines())


def test_what_the_judge_works_out_is_worked_out_once_for_a_class(monkeypatch):
    """References and mistakes: they hang on the seed, not on who is graded."""
    monkeypatch.setattr(judging, "_mistaken", functools.cache(judging._mistaken.__wrapped__))
    judging.forget()
    wrong = E61.run(E61.wrong(E61.mistakes[3]))
    ran, run = [], Exercise.run

    def counted(exercise, source):
        ran.append(source)
        return run(exercise, source)

    monkeypatch.setattr(Exercise, "run", counted)
    first = judging.judge(E61, lambda args: (wrong(args), False), 5)
    assert ran == [E61.source, *map(E61.wrong, E61.mistakes[:4])]
    assert judging.judge(E61, lambda args: (wrong(args), False), 5) == first
    assert len(ran) == 5


def test_a_judge_keeps_the_memory_that_it_has_used():
    """Where the kernel gives it anew each time, there is a fault for each of its 5,120 pages."""
    code = """if True:
    from resource import RUSAGE_SELF, getrusage
    from tests.grade.judge import settle
    def faults():
        before = getrusage(RUSAGE_SELF).ru_minflt
        b"x" * (20 << 20)
        return getrusage(RUSAGE_SELF).ru_minflt - before
    settle()
    print(faults(), faults())
    """
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    first, again = map(int, done.stdout.split())
    assert first > 5000 and again < 500


def test_one_open_case_costs_its_own_checks_only():
    exercise = find("10.4")
    last = "    if not expert.all():"
    source = exercise.source.replace(last, f"    {STUB}\n{last}")
    with Kept() as box:
        result = grading.grade_one(exercise, Answer(source, [], ""), box)
    assert 0 < result.points < result.most and not result.open


def test_without_either_wall_the_warning_says_that_files_can_be_read(monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: None)
    assert ("READ THE FILES" in sandbox.warning()) != has_landlock()
    monkeypatch.setattr(sandbox, "has_landlock", lambda: False)
    assert "READ THE FILES" in sandbox.warning()


def test_without_bubblewrap_there_is_a_warning_and_the_limits_stay(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setattr(sandbox, "WALL", 4)
    names = ["sleep", "fork bomb, quiet", "a full disk", "opens a socket", "imports the answer"]
    names.append("100 GB")
    names += READERS if has_landlock() else []
    for name in names:
        source = BAD[name][0].replace("CLASS", repr(str(tmp_path / "class")))
        write(tmp_path / "class", name, answered(source))
    assert main([str(tmp_path / "class"), "--out", str(tmp_path / "out"), "--notebooks", "6"]) == 0
    assert "bubblewrap is not installed" in capsys.readouterr().err
    got = {n: g[:2] for n, g in grades(tmp_path / "out").items()}
    assert got == {n: (BAD[n][1], REST) for n in names}
