"""An instructor who has nbgrader releases and grades the notebooks with it, unchanged."""

import os
import shutil
import sys
from pathlib import Path

import nbformat
import pytest
from nbgrader.api import Gradebook
from nbgrader.apps import NbGraderAPI
from traitlets.config import Config

from solutions.__main__ import ROOT
from tests.grade.exercise import find

NAME = "06_reward"


@pytest.fixture(scope="module")
def scores(tmp_path_factory):
    """Points by student and check, as nbgrader gives them, and the released notebook's path."""
    course = tmp_path_factory.mktemp("course")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(ROOT))
        patch.setenv("LBW_FAST", "1")
        # nbgrader calls alembic, which an activated environment would find.
        patch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
        patch.setenv("HOME", str(course))
        patch.chdir(course)
        config = Config()
        config.CourseDirectory.root, config.CourseDirectory.course_id = str(course), "lbw"
        config.CourseDirectory.db_url = f"sqlite:///{course / 'gradebook.db'}"
        api = NbGraderAPI(config=config)
        source = course / "source" / "ps6"
        source.mkdir(parents=True)
        shutil.copy(ROOT / "solutions" / f"{NAME}.ipynb", source)
        done = api.generate_assignment("ps6", create=True)
        assert done["success"], done
        released = course / "release" / "ps6" / f"{NAME}.ipynb"
        for student, answer in (("ann", None), ("bob", "z_E[:-1]"), ("cem", "open")):
            folder = course / "submitted" / student / "ps6"
            folder.mkdir(parents=True)
            notebook = nbformat.read(released, 4)
            for cell in notebook.cells:
                id = cell.metadata.get("nbgrader", {}).get("grade_id", "")
                if id.startswith("ex-") and answer != "open":
                    exercise = find(id[3:].replace("-", "."))
                    cell.source = exercise.source
                    if answer and exercise.id == "6.1":
                        cell.source = exercise.source.replace(answer, "z_E")
            nbformat.write(notebook, folder / released.name)
            done = api.autograde("ps6", student, create=True)
            assert done["success"], done
        with Gradebook(config.CourseDirectory.db_url) as book:
            points = {}
            for student in ("ann", "bob", "cem"):
                work = book.find_submission_notebook(NAME, "ps6", student)
                points[student] = {g.name: g.auto_score for g in work.grades}
        yield points, released


def test_nbgrader_takes_the_answers_out(scores):
    text = scores[1].read_text()
    assert "SOLUTION" not in text and "HIDDEN" not in text and "NotImplementedError" in text


def test_nbgrader_gives_the_points_of_the_checks(scores):
    want = {f"check-6-{i}": find(f"6.{i}").points for i in range(1, 6)}
    assert scores[0]["ann"] == want


def test_nbgrader_gives_part_of_the_points_for_part_of_the_checks(scores):
    want = {f"check-6-{i}": find(f"6.{i}").points for i in range(1, 6)}
    assert 0 < scores[0]["bob"].pop("check-6-1") < want.pop("check-6-1")
    assert scores[0]["bob"] == want


def test_nbgrader_gives_nothing_for_nothing(scores):
    assert set(scores[0]["cem"].values()) == {0}
