"""The archive for Gradescope: its scripts run in folders like Gradescope's, its results are valid.

What is installed there is not downloaded here: a Python that writes down what pip is asked for
stands in for it.
"""

import json
import os
import subprocess
import sys
from zipfile import ZipFile

import pytest

import tests.grade.__main__ as grading
from solutions.__main__ import main as course
from tests.grade import gradescope
from tests.grade.__main__ import main
from tests.grade.exercise import find
from tests.test_grading_files import WRONG, notebook

NUMBER, TEXT = (int, float), str
# What the specification of results.json allows, in our words: types, or the values there are.
VISIBLE = {"hidden", "after_due_date", "after_published", "visible"}
FORMAT = {"text", "html", "simple_format", "md", "ansi"}
TOP = {
    "score": NUMBER, "execution_time": NUMBER, "output": TEXT, "output_format": FORMAT,
    "test_output_format": FORMAT, "test_name_format": FORMAT, "visibility": VISIBLE,
    "stdout_visibility": VISIBLE, "extra_data": dict, "tests": list, "leaderboard": list,
}  # fmt: skip
TEST = {
    "score": NUMBER, "max_score": NUMBER, "status": {"passed", "failed"}, "name": TEXT,
    "name_format": FORMAT, "number": TEXT, "output": TEXT, "output_format": FORMAT, "tags": list,
    "visibility": VISIBLE, "extra_data": dict,
}  # fmt: skip


def faults(results):
    """In what results differ from the specification."""
    found = [f"{key} at the top" for key in unlike(results, TOP)]
    if "score" not in results and not results.get("tests"):
        found.append("neither a score nor tests")
    for i, test in enumerate(results.get("tests", [])):
        found += [f"{key} of test {i}" for key in unlike(test, TEST)]
        if "score" not in results and "score" not in test and "status" not in test:
            found.append(f"no score of test {i}")
        if test.get("score", 0) > test.get("max_score", float("inf")):
            found.append(f"test {i} has more than its points")
    return found


def unlike(values, allowed):
    for key, value in values.items():
        kind = allowed.get(key)
        if isinstance(kind, set):
            if value not in kind:
                yield key
        elif kind is None or not isinstance(value, kind) or isinstance(value, bool):
            yield key


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"visibility": "always"}, "visibility at the top"),
        ({"score": "4"}, "score at the top"),
        ({"grade": 4}, "grade at the top"),
        ({"tests": []}, "neither a score nor tests"),
        ({"tests": [{"name": "x"}]}, "no score of test 0"),
        ({"tests": [{"score": 2, "max_score": 1}]}, "test 0 has more than its points"),
        ({"tests": [{"score": 2, "number": 6.1}]}, "number of test 0"),
    ],
)
def test_what_the_specification_forbids_is_noticed(change, fault):
    good = {"output": "", "tests": [{"score": 1, "max_score": 1, "name": "x"}]}
    assert faults(good) == [] and faults(good | change) == [fault]


# The archive

PYTHON = f"""#!/bin/sh
# venv makes a folder with this script in it; pip is written down; all else is Python.
case "$1 $2" in
    "-c import"*) exec {sys.executable} "$@" ;;
    "-m venv") mkdir -p "$3/bin" && cp "$0" "$3/bin/python" ;;
    "-m pip") echo "$@" >> "$AUTOGRADER/pip.log" ;;
    *) exec {sys.executable} "$@" ;;
esac
"""
APT = '#!/bin/sh\necho "$@" >> "$AUTOGRADER/apt.log"\n'


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder like Gradescope's /autograder, with the archive unpacked and set up."""
    root = tmp_path_factory.mktemp("autograder")
    gradescope.archive(root / "autograder.zip", "06")
    for name in ("source", "submission", "results", "bin"):
        (root / name).mkdir()
    with ZipFile(root / "autograder.zip") as packed:
        packed.extractall(root / "source")
    (root / "source" / "setup.sh").chmod(0o755)
    for name, text in (("python3.11", PYTHON), ("apt-get", APT)):
        (root / "bin" / name).write_text(text)
        (root / "bin" / name).chmod(0o755)
    (root / "run_autograder").write_bytes((root / "source" / "run_autograder").read_bytes())
    (root / "run_autograder").chmod(0o755)
    run(root, root / "source" / "setup.sh")
    return root


def run(root, script, check=True):
    """Run a script as Gradescope does, from that folder."""
    env = {"AUTOGRADER": str(root), "PATH": f"{root / 'bin'}:{os.environ['PATH']}"}
    done = subprocess.run([script], cwd=root, env=env, capture_output=True, text=True)
    assert not check or done.returncode == 0, done.stderr


def graded(root, files, check=True):
    """The results of a submission's files; None where there are none."""
    for folder in ("submission", "results"):
        for old in (root / folder).iterdir():
            old.unlink()
    for name, text in files.items():
        (root / "submission" / name).write_text(text)
    run(root, root / "run_autograder", check)
    found = root / "results" / "results.json"
    return json.loads(found.read_text()) if found.exists() else None


def test_the_scripts_are_at_the_root_and_can_be_executed(place):
    with ZipFile(place / "autograder.zip") as packed:
        modes = {i.filename: i.external_attr >> 16 for i in packed.infolist()}
    assert modes["setup.sh"] & 0o111 and modes["run_autograder"] & 0o111
    assert "requirements.txt" in modes and "tests/grade/__main__.py" in modes
    first = {(place / "source" / name).read_text().split("\n")[0] for name in SCRIPTS}
    assert first == {"#!/usr/bin/env bash"}


SCRIPTS = ("setup.sh", "run_autograder")


def test_no_solved_notebook_is_in_it(place):
    names = [p.relative_to(place / "source").as_posix() for p in (place / "source").rglob("*")]
    assert not [n for n in names if n.startswith(("solutions", "runs", ".")) or "pycache" in n]
    assert (place / "autograder.zip").stat().st_size < 2 << 20


def test_setup_installs_the_requirements_within_the_lock(place):
    (line,) = (place / "pip.log").read_text().splitlines()
    assert "-r requirements.txt -c requirements-lock.txt" in line
    assert "--extra-index-url https://download.pytorch.org/whl/cpu" in line
    assert (place / "apt.log").read_text().splitlines()[0] == "update"


R2 = "# Exercise 6.2\ndef r2(z, z_next, z_E):\n    return 1.0"  # wrong, so inputs are shown
FILES = {"my own name.ipynb": notebook(find("6.1").source, R2), "notes.txt": ""}


@pytest.fixture(scope="module")
def found(place):
    return graded(place, FILES)


def test_results_are_valid_and_shown_to_students_as_text(found):
    assert faults(found) == []
    assert [t["number"] for t in found["tests"]] == [f"6.{i}" for i in range(1, 6)]
    first, second = found["tests"][:2]
    assert (first["score"], first["status"]) == (find("6.1").points, "passed")
    assert (second["score"], second["status"]) == (0, "failed")
    assert {t["visibility"] for t in found["tests"]} == {found["visibility"]} == {"visible"}
    assert {t["output_format"] for t in found["tests"]} == {found["output_format"]} == {"text"}
    assert found["stdout_visibility"] == "hidden"


@pytest.mark.slow
def test_several_notebooks_are_one_submission_and_none_is_a_valid_result(place):
    found = graded(place, {"06_reward.ipynb": notebook(), "06_reward_2.ipynb": notebook(WRONG)})
    assert faults(found) == [] and found["tests"][0]["score"] == 0
    assert "6.1 stands in 06_reward.ipynb, too" in found["output"]
    nothing = graded(place, {})
    assert faults(nothing) == [] and "no notebook found" in nothing["output"]


def test_each_student_is_asked_the_same_with_the_seed_of_the_archive(place, found):
    assert graded(place, FILES) == found and "r2(" in found["tests"][1]["output"]
    said = (place / "source" / "set.env").read_text()
    assert said.startswith("NOTEBOOKS=6\nSEED=") and int(said.split("=")[2]) < 1 << 31
    gradescope.archive(place / "another.zip", "6")
    with ZipFile(place / "another.zip") as packed:
        assert packed.read("set.env").decode() != said


def test_where_the_grader_fails_there_is_no_result(place):
    """Gradescope says then that the autograder failed; a 0 would be the student's."""
    broken = place / "source" / "tests" / "grade" / "judge.py"
    text = broken.read_text()
    broken.write_text(text + "\nraise RuntimeError\n")
    try:
        assert graded(place, {"06_reward.ipynb": notebook()}, check=False) is None
    finally:
        broken.write_text(text)


def test_a_lost_worker_is_no_grade_either(tmp_path, monkeypatch):
    def breaks(*_):
        raise RuntimeError("a bug of ours")

    monkeypatch.setattr(grading, "grade", breaks)
    (tmp_path / "06_reward.ipynb").write_text(notebook())
    line = [str(tmp_path), "--one", "--out", str(tmp_path / "out"), "--gradescope"]
    assert main(line) == 1 and not list(tmp_path.rglob("results.json"))


def test_one_takes_any_folder_for_a_single_submission(tmp_path):
    for name in ("ann", "bob"):
        (tmp_path / "class" / name).mkdir(parents=True)
    (tmp_path / "class" / "ann" / "x.ipynb").write_text(notebook())
    line = [str(tmp_path / "class"), "--out", str(tmp_path / "out"), "--notebooks", "6"]
    assert main([*line, "--one"]) == 0
    (only,) = (tmp_path / "out").glob("*/result.json")
    assert json.loads(only.read_text())["submission"] == "class"
    assert main([str(tmp_path / "nowhere"), "--one"]) == 2


@pytest.mark.parametrize(
    ("line", "said"), [([], "say which notebooks"), (["66"], "no notebook 66")]
)
def test_the_command_builds_it_or_says_what_is_wrong(line, said, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("solutions.__main__.AUTOGRADER", tmp_path / "autograder.zip")
    monkeypatch.setattr("solutions.__main__.ROOT", tmp_path)
    monkeypatch.setattr("sys.argv", ["solutions", "gradescope", *line])
    assert course() == 2 and said in capsys.readouterr().err
    assert not (tmp_path / "autograder.zip").exists()
    monkeypatch.setattr("sys.argv", ["solutions", "gradescope", "05", "6"])
    assert course() == 0
    with ZipFile(tmp_path / "autograder.zip") as packed:
        assert b"NOTEBOOKS=5,6\n" in packed.read("set.env")


def test_the_archive_is_where_the_lecturer_is_told_that_it_is():
    text = (gradescope.ROOT / "solutions" / "README.md").read_text(encoding="utf-8")
    assert "python -m solutions gradescope" in text and "`runs/autograder.zip`" in text
