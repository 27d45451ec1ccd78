"""Grading a class of which some crash, hang, or cheat: each gets what its answers are worth, and nobody else
pays for it. The submissions are notebook 6, with exercise 6.1 answered in one of many bad ways."""

import copy
import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import tests.grade.__main__ as grading
from tests.grade import sandbox
from tests.grade.__main__ import main, safe
from tests.grade.cell.worker import has_landlock
from tests.grade.exercise import find

ROOT = Path(__file__).resolve().parent.parent
SOLVED = json.loads((ROOT / "solutions" / "06_reward.ipynb").read_text())
E61 = find("6.1")
REST = sum(find(f"6.{i}").points for i in (2, 3, 4, 5))
RIGHT = E61.source
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
        "import sys\nfor _ in range(1 << 10):\n    sys.stdout.write('x' * (1 << 20))\n" + RIGHT, E61.points,
    ),
    "a full disk": ("def r1(z, z_E):\n    open('/tmp/x', 'wb').write(b'0' * (1 << 34))", 0),
    "os._exit(0)": ("import os\ndef r1(z, z_E):\n    os._exit(0)", 0),
    "sys.exit": ("import sys\nsys.exit()", 0),
    "sys.exit when called": ("import sys\ndef r1(z, z_E):\n    sys.exit(0)", 0),
    "kills the parent": ("import os\nos.kill(os.getppid(), 9)\n" + RIGHT, 0),
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
        "for name in ('allclose', 'isclose', 'array_equal'):\n    setattr(np, name, lambda *a, **k: True)\n"
        "torch.allclose = lambda *a, **k: True\ndef r1(z, z_E):\n    return 1.0",
        0,
    ),
    "patched wire": (
        "import sys\nwire = sys.modules['wire']\nwire.encode = lambda value: b'you win'\n" + RIGHT,
        0,
    ),
    "equals everything": (
        "class Yes(float):\n    def __eq__(self, other):\n        return True\n    __hash__ = None\n"
        "def r1(z, z_E):\n    return Yes(1)",
        0,
    ),
    "NaN": ("def r1(z, z_E):\n    return float('nan')", 0),
    "wrong shape": ("def r1(z, z_E):\n    return np.zeros((2, 2))", 0),
    "wrong type": ("def r1(z, z_E):\n    return 'a large reward'", 0),
    "wrong dtype": ("def r1(z, z_E):\n    return np.zeros((), complex) + 1j", 0),
    "other device": ("def r1(z, z_E):\n    return torch.zeros((), device='meta')", 0),
    "changes its inputs": (RIGHT.replace("    return", "    z_E[:] = 0\n    return"), 0),
    "counts its calls": (
        "calls = 0\n" + COUNTING.replace("return", "return calls * "), 0,
    ),
    "counts, right at first": (
        "calls = 0\n" + COUNTING.replace("return", "return (calls > 9) + "), 0,
    ),
    "reads the solutions": (f"open({str(ROOT / 'solutions' / '06_reward.ipynb')!r}).read()\n" + RIGHT, 0),
    "reads another submission": ("open(CLASS + '/good/06_reward.ipynb').read()\n" + RIGHT, 0),
    "reads the checks": (f"open({str(ROOT / 'tests' / 'test_grading.py')!r}).read()\n" + RIGHT, 0),
    "opens a socket": ("import socket\nsocket.create_connection(('127.0.0.1', 80), 1)\n" + RIGHT, 0),
    "imports the answer": (
        "from lbw_minimal.reward import KeypointReward\n"
        "def r1(z, z_E):\n    return KeypointReward(z_E, form='literal')(z, z)[1]['r1']",
        0,
    ),
    "imports when called": (
        "def r1(z, z_E):\n    from lbw_minimal.reward import KeypointReward\n    return 0.0", 0,
    ),
    "starts a program": ("import subprocess\nsubprocess.run(['ls'])\n" + RIGHT, 0),
    "forges the channel": (
        "import os\nfor fd in range(3, 64):\n    try:\n        os.write(fd, bytes(8) + b'{}' * 100)\n"
        "    except OSError:\n        pass\n" + RIGHT,
        0,
    ),
    "endless recursion": ("def r1(z, z_E):\n    return r1(z, z_E)", 0),
    "crashes Python": ("import ctypes\nctypes.string_at(0)", 0),
    "a list that holds itself": ("def r1(z, z_E):\n    x = []\n    x.append(x)\n    return x", 0),
    "no Python": ("this is not Python", 0),
    "a thread that stays": (
        "import threading, time\nthreading.Thread(target=time.sleep, args=(10_000,)).start()\n" + RIGHT,
        E61.points,
    ),
}  # fmt: skip


def learnt_by_heart(exercise):
    """An answer that has the inputs of the students' own check and their results in a table."""
    reference, table = exercise.run(exercise.source), {}
    for i, check in enumerate(exercise.checks):
        rng = np.random.default_rng([0, i])
        for _ in range(check.trials):
            args = check.inputs(rng)
            table[b"".join(x.tobytes() for x in args)] = float(reference(args))
    lookup = "[z.tobytes() + z_E.tobytes()]"
    return f"TABLE = {table!r}\ndef r1(z, z_E):\n    return TABLE{lookup}"


BAD["learnt by heart"] = (learnt_by_heart(E61), 0)
READERS = [name for name in BAD if name.startswith("reads ")]
CLOSED = shutil.which("bwrap") or has_landlock()


def cell_of(notebook, grade_id):
    return next(c for c in notebook["cells"] if c["metadata"].get("nbgrader", {}).get("grade_id") == grade_id)


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
        found[done["submission"]] = first["points"], sum(e["points"] for e in others), " ".join(sorted(said))
    return found


@pytest.fixture(scope="module")
def class_of_cheats(tmp_path_factory):
    """The grades of a class with all of BAD and an honest student in it."""
    folder, out = tmp_path_factory.mktemp("class"), tmp_path_factory.mktemp("grades")
    write(folder, "good", SOLVED)
    for name, (source, _) in BAD.items():
        write(folder, name, answered(source.replace("CLASS", repr(str(folder)))))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sandbox, "WALL", 6)
        patch.setattr(sandbox, "CPU", 3)
        assert main([str(folder), "--out", str(out), "--notebooks", "6"]) == 0
    return grades(out)


@pytest.mark.parametrize("name", BAD)
def test_a_bad_answer_gets_what_it_is_worth_and_the_others_count(class_of_cheats, name):
    if name in READERS and not CLOSED:
        pytest.skip("neither bubblewrap nor Landlock here; the grader warns of it")
    first, others, message = class_of_cheats[name]
    assert (first, others) == (BAD[name][1], REST), message
    assert message or first == E61.points


def test_the_honest_student_of_that_class_has_all_points(class_of_cheats):
    assert class_of_cheats["good"][:2] == (E61.points, REST)


def test_importing_the_answer_gets_a_hint_that_says_so(class_of_cheats):
    for name in ("imports the answer", "imports when called"):
        assert "your own lines" in class_of_cheats[name][2]


# Notebooks that are not what they should be ------------------------------------------------------------


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
    notebook["cells"].append({"cell_type": "code", "metadata": {}, "source": ["%timeit 1\n", "!ls\n"]})
    return notebook


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
    assert failed["another kernel"] == 0 and failed["a cell deleted"] == 1 and failed["invalid JSON"] == 5
    tests = json.loads((out / safe("a cell deleted") / "results.json").read_text())["tests"]
    assert [(t["name"][:3], t["score"]) for t in tests][:2] == [("6.1", 0), ("6.2", find("6.2").points)]
    assert sum(t["max_score"] for t in tests) == FULL


def test_a_page_says_what_was_wrong_and_runs_nothing(class_of_odd_files):
    _, out = class_of_odd_files
    page = (out / safe("<script>> & 'x'") / "feedback.html").read_text()
    assert "<script>" not in page and "&lt;script&gt;" in page


# The grader itself -------------------------------------------------------------------------------------


def test_two_gradings_are_equal_to_the_byte(tmp_path):
    write(tmp_path / "class", "ann", answered(E61.wrong(E61.mistakes[0])))
    write(tmp_path / "class", "bob", SOLVED)
    for out in ("a", "b"):
        assert main([str(tmp_path / "class"), "--out", str(tmp_path / out), "-j", "1"]) == 0
    for a in sorted((tmp_path / "a").rglob("*.*")):
        assert a.read_bytes() == (tmp_path / "b" / a.relative_to(tmp_path / "a")).read_bytes()


def test_a_killed_grading_goes_on_and_repeats_nothing(tmp_path):
    for i in range(6):
        write(tmp_path / "class", f"s{i}", answered(f"# {i}\n{RIGHT}"))
    command = [
        sys.executable,
        "-m",
        "tests.grade",
        str(tmp_path / "class"),
        "--out",
        str(tmp_path / "out"),
        "-j",
        "1",
    ]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, start_new_session=True)
    deadline = time.monotonic() + 120
    while len(list((tmp_path / "out").glob("*/result.json"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    done = {p: p.stat().st_mtime_ns for p in (tmp_path / "out").glob("*/result.json")}
    assert 2 <= len(done) < 6
    assert subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL).returncode == 0
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


def test_what_breaks_the_grader_costs_one_submission_and_is_told(tmp_path, monkeypatch, capsys):
    for name in ("ann", "bob"):
        write(tmp_path / "class", name, SOLVED)
    right = grading.grade

    def breaks(entry, ids, seed):
        if entry.name == "ann":
            raise RuntimeError("a bug of ours")
        return right(entry, ids, seed)

    monkeypatch.setattr(grading, "grade", breaks)
    assert main([str(tmp_path / "class"), "--out", str(tmp_path / "out")]) == 1
    assert "ann: NOT GRADED" in capsys.readouterr().err
    assert set(grades(tmp_path / "out")) == {"bob"}
    rows = list(csv.reader((tmp_path / "out" / "class.csv").open()))
    assert [row[0] for row in rows] == ["submission", "ann", "bob"] and "a bug of ours" in rows[1][-1]


def test_a_wrong_folder_is_one_sentence(tmp_path, capsys):
    assert main([str(tmp_path / "nowhere")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_without_either_wall_the_warning_says_that_files_can_be_read(monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: None)
    assert ("READ THE FILES" in sandbox.warning()) != has_landlock()
    monkeypatch.setattr(sandbox, "has_landlock", lambda: False)
    assert "READ THE FILES" in sandbox.warning()


def test_without_bubblewrap_there_is_a_warning_and_the_limits_stay(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setattr(sandbox, "WALL", 4)
    names = ["sleep", "fork bomb, quiet", "a full disk", "opens a socket", "imports the answer", "100 GB"]
    names += READERS if has_landlock() else []
    for name in names:
        source = BAD[name][0].replace("CLASS", repr(str(tmp_path / "class")))
        write(tmp_path / "class", name, answered(source))
    assert main([str(tmp_path / "class"), "--out", str(tmp_path / "out"), "--notebooks", "6"]) == 0
    assert "bubblewrap is not installed" in capsys.readouterr().err
    assert {n: g[:2] for n, g in grades(tmp_path / "out").items()} == {n: (BAD[n][1], REST) for n in names}
