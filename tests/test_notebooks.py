"""The notebooks: the student version is the source without its answers; both fit the checks."""

import ast
import re
import sys
import time

import nbformat
import pytest
from nbconvert.preprocessors import ExecutePreprocessor

from solutions.__main__ import (
    GLOSSARY,
    HERE,
    MATH,
    NOTEBOOKS,
    ROOT,
    contents,
    page,
    sources,
    student,
)
from tests.grade.__main__ import grade, main
from tests.grade.cell.answer import STUB
from tests.grade.exercise import everything
from tests.grade.handed_in import Submission
from tests.grade.notebook import StillOpen

pytestmark = pytest.mark.usefixtures("workers_wait")

ALL = everything()
SOURCES = sources()
by_name = pytest.mark.parametrize("path", SOURCES, ids=lambda p: p.stem)


def of(path):
    """The exercises of a notebook."""
    return [e for id, e in ALL.items() if int(id.split(".")[0]) == int(path.stem[:2])]


def grading(notebook):
    """grade id -> cell, but for a star's, which is worth no points."""
    cells = {c.metadata.nbgrader.grade_id: c for c in notebook.cells if "nbgrader" in c.metadata}
    return {id: cell for id, cell in cells.items() if not id.startswith("star-")}


def test_every_exercise_belongs_to_a_notebook():
    assert len(SOURCES) == 14
    assert {e.id for path in SOURCES for e in of(path)} == set(ALL)


@by_name
def test_the_student_version_is_made_from_the_source(path):
    """`python -m solutions release` was run after the last change."""
    assert (NOTEBOOKS / path.name).read_text() == student(path)


def test_nothing_but_the_glossary_is_among_the_notebooks():
    made = [*SOURCES, GLOSSARY]
    assert sorted(p.name for p in NOTEBOOKS.iterdir()) == [p.name for p in made]
    assert (NOTEBOOKS / GLOSSARY.name).read_text() == GLOSSARY.read_text()


@by_name
def test_a_notebook_has_two_to_five_exercises_each_with_its_check(path):
    cells, exercises = grading(nbformat.read(path, 4)), of(path)
    assert 2 <= len(exercises) <= 5
    ids = {e.grade_id for e in exercises}
    assert set(cells) == ids | {id.replace("ex-", "check-") for id in ids}
    for e in exercises:
        task, check = cells[e.grade_id], cells[e.grade_id.replace("ex-", "check-")]
        assert task.source.startswith(f"# Exercise {e.id}\n") and e.name in task.source
        assert check.source.startswith(f'check("{e.id}")')
        assert check.metadata.nbgrader.points == e.points


@by_name
def test_no_answer_is_left_in_the_student_version(path):
    notebook = nbformat.read(NOTEBOOKS / path.name, 4)
    text = "\n".join(c.source for c in notebook.cells)
    assert not re.search("SOLUTION|HIDDEN", text)
    assert text.count(STUB) >= len(of(path))


@pytest.mark.parametrize("path", [p for s in SOURCES for p in (s, NOTEBOOKS / s.name)], ids=str)
def test_no_outputs_and_no_machines_paths_are_stored(path):
    notebook = nbformat.read(path, 4)
    cells = [c for c in notebook.cells if c.cell_type == "code"]
    assert all(not c.outputs and c.execution_count is None for c in cells)
    assert not re.search(r"/home/|/root/|/tmp/|/work/|/Users/", path.read_text())
    assert "/" not in str(dict(notebook.metadata))


@by_name
def test_no_cell_is_longer_than_a_screen(path):
    """25 lines; an exercise's cell may hold its marks and its text besides."""
    for cell in nbformat.read(path, 4).cells:
        if cell.cell_type == "code" and "nbgrader" not in cell.metadata:
            assert len(cell.source.splitlines()) <= 25, cell.source[:200]


@by_name
def test_it_is_python_and_asks_a_question_first(path):
    notebook = nbformat.read(path, 4)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            ast.parse(cell.source)
    title = notebook.cells[0].source
    assert title.startswith(f"# {int(path.stem[:2])}. ") and "question" in title and "?" in title


@pytest.mark.slow
@pytest.mark.parametrize("folder", [ROOT, NOTEBOOKS], ids=["root", "notebooks"])
@by_name
def test_a_solution_runs_headless_within_two_minutes(path, folder, monkeypatch):
    """Started in either folder, as JupyterLab and editors do."""
    monkeypatch.setenv("LBW_FAST", "1")
    notebook = nbformat.read(path, 4)
    start = time.monotonic()
    run = ExecutePreprocessor(timeout=120, kernel_name="python3")
    run.preprocess(notebook, {"metadata": {"path": str(folder)}})
    assert time.monotonic() - start < 120


@pytest.mark.parametrize("folder", [ROOT, NOTEBOOKS, HERE], ids=lambda p: p.name)
@by_name
def test_the_kit_is_found_wherever_a_notebook_is_started(path, folder, monkeypatch):
    head, _, _ = nbformat.read(path, 4).cells[1].source.partition("FAST = ")
    monkeypatch.chdir(folder)
    monkeypatch.setattr("sys.path", ["elsewhere"])
    exec(head, {})
    assert sys.path == [str(ROOT), "elsewhere"]


def relative(tree):
    """Texts in code that are paths from the folder in which it runs."""
    takes = {"Path", "open", "read", "load", "save", "savefig", "imread", "imwrite", "exists"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            if node.value == ".." or node.value.startswith(("./", "../", "~")):
                yield node.value
        elif isinstance(node, ast.Call):
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            for given in node.args[:1] if name in takes else []:
                if isinstance(given, ast.Constant) and isinstance(given.value, str):
                    yield given.value


@by_name
def test_no_path_depends_on_where_a_notebook_is_started(path):
    for cell in nbformat.read(path, 4).cells:
        if cell.cell_type == "code":
            assert not [*relative(ast.parse(cell.source))], cell.source
            if not cell.source.startswith("import os\n"):
                assert not re.search(r"\bcwd\b|\bgetcwd\b|chdir|\bPath\(\)", cell.source)


@pytest.mark.parametrize(
    "code",
    [
        'Path("..") / "solutions"',
        'open("results/x.json")',
        'video.read("my.mp4")',
        'plt.savefig("a.png")',
        'name = "./x"',
    ],
)
def test_a_path_from_the_working_folder_is_noticed(code):
    assert [*relative(ast.parse(code))]


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (0.0, 0.0, "no width"),
        (1.0, 1.0, "no width"),
        (0.1, 0.4, "costs something"),
        (-0.1, 0.2, "cannot tell"),
        (0.0, 0.3, "cannot tell"),
        (-0.4, -0.1, "better left out"),
    ],
)
def test_an_interval_without_width_is_not_read_as_a_proof(low, high, said):
    """Three equal seeds against three others: however far apart, the bootstrap is blind."""
    cells = [c.source for c in nbformat.read(SOURCES[10], 4).cells]
    tree = ast.parse(next(c for c in cells if "def reading(" in c))
    tree.body = [node for node in tree.body if getattr(node, "name", "") == "reading"]
    space = {}
    exec(compile(tree, "notebook 10", "exec"), space)
    assert said in space["reading"](low, high)


@by_name
def test_the_student_version_stops_at_its_first_exercise_with_one_sentence(path):
    """Its cells up to there are those of the solution; what is raised there shows no traceback."""
    notebook = nbformat.read(NOTEBOOKS / path.name, 4)
    kinds = [c.metadata.get("nbgrader", {}).get("grade_id", "") for c in notebook.cells]
    first = kinds.index(of(path)[0].grade_id)
    assert next(k for k in kinds[first + 1 :] if k) == of(path)[0].grade_id.replace("ex-", "check-")
    space = {}
    exec("import torch, numpy as np\nfrom tests.grade import check", space)
    exec(notebook.cells[first].source, space)
    with pytest.raises(StillOpen, match="still open") as stop:
        exec(f'check("{of(path)[0].id}")', space)
    assert len(stop.value._render_traceback_()) == 1


def test_the_solutions_earn_every_point_in_the_sandbox():
    results, notes = grade(Submission.of(ROOT / "solutions").files()[0], list(ALL))
    assert not notes
    wrong = [(r.id, r.lines()) for r in results if r.points < r.most]
    assert not wrong


def test_untouched_student_notebooks_earn_nothing(tmp_path):
    results, notes = grade(Submission.of(NOTEBOOKS).files()[0], list(ALL))
    assert not notes
    assert [r.points for r in results] == [0] * len(ALL) and all(r.open for r in results)


def test_by_default_the_notebooks_that_were_handed_in_are_graded(tmp_path, capsys):
    (tmp_path / "class" / "ann").mkdir(parents=True)
    (tmp_path / "class" / "ann" / "n.ipynb").write_text((NOTEBOOKS / SOURCES[6].name).read_text())
    assert main([str(tmp_path / "class"), "--out", str(tmp_path / "out")]) == 0
    assert f"ann: 0 of {sum(e.points for e in of(SOURCES[6])):g}" in capsys.readouterr().out


def test_a_page_of_the_book_needs_no_network_and_no_script_for_its_equations():
    source = SOURCES[1]
    notebook = nbformat.read(source, as_version=4)
    notebook.cells = [c for c in notebook.cells if c.cell_type == "markdown"]
    stream = nbformat.v4.new_output("stream", text="pybullet build time: Jan 29 2025\n")
    progress = "\rpolicy 0%\rpolicy 50%\rpolicy 100%\n"
    bar = nbformat.v4.new_output("stream", name="stderr", text=progress)
    notebook.cells.append(nbformat.v4.new_code_cell("import pybullet", outputs=[stream, bar]))
    equations = sum(not m[1] for c in notebook.cells for m in MATH.finditer(c.source))
    html = page(notebook, source)
    assert not re.search(r"(?:src|href)=.https?://[^>]*(?:\.js|\.css|cdn)", html)
    assert html.count("<math") == equations > 10
    assert "EQUATION" not in html and "build time" not in html
    assert "policy 100%" in html and "policy 50%" not in html
    neighbours = ("index", SOURCES[0].stem, SOURCES[2].stem)
    assert all(f'href="{name}.html"' in html for name in neighbours)
    assert 'id="plain"' in html


def test_the_books_contents_ask_every_notebooks_question():
    html = contents()
    assert html.count("<li>") == len(SOURCES) + 1 and "glossary.html" in html
    assert html.count("?") >= len(SOURCES)
