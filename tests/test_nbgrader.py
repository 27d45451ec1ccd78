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

pytestmark = pytest.mark.slow
NAME = "06_reward"


# One student for all: nbgrader starts a kernel for each, of some ten seconds.
WRONG = find("6.1").source.replace("z_E[:-1]", "z_E")
OPEN = "6.5"
RIGHT = ("6.2", "6.3", "6.4")


@pytest.fixture(scope="module")
def graded(tmp_path_factory):
    """Points by check, as nbgrader gives them, and the released notebook's path."""
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
        folder = course / "submitted" / "ann" / "ps6"
        folder.mkdir(parents=True)
        notebook = nbformat.read(released, 4)
        for cell in notebook.cells:
            id = cell.metadata.get("nbgrader", {}).get("grade_id", "")
            if id.startswith("ex-"):
                exercise = find(id[3:].replace("-", "."))
                if exercise.id != OPEN:
                    cell.source = WRONG if exercise.id == "6.1" else exercise.source
        nbformat.write(notebook, folder / released.name)
        done = api.autograde("ps6", "ann", create=True)
        assert done["success"], done
        with Gradebook(config.CourseDirectory.db_url) as book:
            work = book.find_submission_notebook(NAME, "ps6", "ann")
            yield {g.name: g.auto_score for g in work.grades}, released


def points(graded, id):
    return graded[0]["check-" + id.replace(".", "-")]


def test_nbgrader_takes_the_answers_out(graded):
    text = graded[1].read_text()
    assert "SOLUTION" not in text and "HIDDEN" not in text and "NotImplementedError" in text


def test_nbgrader_gives_the_points_of_the_checks(graded):
    assert [points(graded, id) for id in RIGHT] == [find(id).points for id in RIGHT]
    assert len(graded[0]) == 5


def test_nbgrader_gives_part_of_the_points_for_part_of_the_checks(graded):
    assert 0 < points(graded, "6.1") < find("6.1").points


def test_nbgrader_gives_nothing_for_nothing(graded):
    assert points(graded, OPEN) == 0
