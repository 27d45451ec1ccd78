"""The lecturer's page: a section for each notebook, and numbers that the references give."""

import re

import nbformat
import numpy as np
import pytest
import torch

from solutions.__main__ import LECTURER, sources
from tests.grade.exercise import everything, find

TEXT = LECTURER.read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^## (\d+)\. (.*?)(?=^## |\Z)", TEXT, re.MULTILINE | re.DOTALL))
PARTS = ("**Objectives.**", "**For class.**", "**Common misunderstandings.**", "**For an exam.**")


@pytest.mark.parametrize("source", sources(), ids=lambda p: p.stem)
def test_each_notebook_has_its_section_with_all_parts(source):
    title = nbformat.read(source, as_version=4).cells[0].source.splitlines()[0]
    number, name = re.match(r"# (\d+)\. ([^:]*)", title).groups()
    text = SECTIONS[number]
    called = text.splitlines()[0]
    assert called in name or called == "Soft actor-critic"
    places = [text.index(part) for part in PARTS]
    assert places == sorted(places) and text.count("**") == 2 * len(PARTS)
    questions = re.findall(r"^\d\. \*[^*]+\?\*\s", text, re.MULTILINE)
    assert len(questions) >= 3 and text.count("Sketch: ") == 1


def test_each_exercise_has_what_goes_wrong_in_it_under_its_notebook():
    found = [(id, number) for number, text in SECTIONS.items()
             for id in re.findall(r"^- (\d+\.\d+): ", text, re.MULTILINE)]  # fmt: skip
    assert {id for id, _ in found} == set(everything())
    assert all(id.split(".")[0] == number for id, number in found)


def run(id, *args):
    exercise = find(id)
    return exercise.run(exercise.source)(args)


def line(*x):
    """Keypoints on a line, (n, 1, 2)."""
    return np.stack([np.array(x, float), np.zeros(len(x))], axis=1)[:, None]


DEMO, IDLE, OTHER = line(0, 0, 1, 2, 3), line(0, 0, 0, 0, 0), line(0.1, 0.1, 1.1, 2.1, 3.1)
CELLS = {name: torch.tensor(v)[None, None, None] for name, v in {
    "x": (5.0, 0, 0), "y": (0, 0, 5.0), "left": (1.0, 0, 0), "right": (0, 0, 1.0),
    "middle": (0, 1.0, 0),
}.items()}  # fmt: skip


def timed(z):
    return sum(run("6.5", z[t + 1], DEMO, t) for t in range(len(z) - 1))


def test_the_exams_numbers_are_those_of_the_references():
    """Of the notebooks whose exam asks for what an exercise computes."""
    low, high = run("7.2", 0.30, 0.04, 0.2)
    _, seconds = run("7.1", (2 * 0.2 * 9.81 * 0.30) ** 0.5, 0.2)
    wilson, all_ten = run("10.1", 8, 10), run("10.2", 0.8, 10, 10)
    points = run("12.3", *map(np.array, [(300, 200), (100, 220), (0.5, 0.1), (0.7, 0.1)]))
    places = run("12.1", np.array([0, 0.1, 0.3]), np.array([[0.0], [1], [5]]), 10)
    channel = run("4.1", torch.tensor([[[[1.0, 3]]]]), *torch.tensor([[[5.0]], [[2.0]]]), "values")
    for number, words in {
        "4": f"becomes {channel.ravel()[0]:.0f} and {channel.ravel()[1]:.0f}",
        "7": f"{low:.2f} to {high:.2f} m/s; 1.08 m/s stops after {seconds:.2f} s",
        "8": f"h = r / μ = {100 * run('8.1', 0.04, 0.4):.0f} cm",
        "10": f"{wilson[0]:.2f} to {wilson[1]:.2f}. 0.8¹⁰ = {all_ten:.2f}; "
        f"1 − 0.893³ = {1 - (1 - all_ten) ** 3:.2f}",
        "12": f"c_x = {points[0, 2]:.1f}, c_z = {points[1, 2]:.2f}. "
        f"{', '.join(f'{x:.0f}' for x in places[:-1, 0])} and {places[-1, 0]:.0f} cm",
    }.items():
        assert words in " ".join(SECTIONS[number].split()), words
    assert points[:, :2].ravel() == pytest.approx([-0.001, 0, -0.0001, -0.001])


def test_the_exams_rewards_and_pictures_are_those_of_the_references():
    literal = [run("6.3", z, DEMO, 1.0, 1.0) for z in (IDLE, OTHER)]
    assert literal == [0, pytest.approx(-0.4)]
    assert [timed(IDLE), timed(OTHER)] == [-6, pytest.approx(-0.4)]
    c = CELLS
    found = run("5.3", c["x"], c["y"], c["left"], c["right"], "values")
    assert found.ravel().tolist() == [0, 0, 5]
    found = run("5.3", c["x"], c["y"], c["middle"], c["middle"], "values")
    assert found.ravel().tolist() == [5, 0, 0]


def test_the_corridor_turns_round_where_the_clock_is_an_end():
    def plans(count):
        return 0.5 / (1 - count), count**19 / (1 - count)

    stay, walk = plans(0.98)
    assert (round(stay), round(walk)) == (25, 34)
    stay, walk = plans(0.98 * 0.9)
    assert (round(stay, 1), round(walk, 2)) == (4.2, 0.78)


def test_the_exams_object_earns_what_the_reference_pays():
    d_E = np.array([[0.0, 0], [3, 0], [6, 0]])
    first = np.zeros(2), np.array([2.0, 0]), np.array([-2.0, 0]), d_E, 0
    parts = [run("13.4", *first, lam) for lam in np.eye(3)]
    assert parts == [pytest.approx(-1 / 6)] * 3
    knocked = np.zeros(2), np.array([-30.0, 0]), np.zeros(2), d_E, 1
    assert run("13.4", *knocked, np.eye(3)[0]) == -2
    assert np.linalg.norm(knocked[1] - d_E[2]) / 6 == 6
